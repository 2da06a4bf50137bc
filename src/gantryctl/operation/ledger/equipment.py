"""Rows of what a CSV axis is made of: mode, telegrams, scales; and the consequence of each object that is missing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.operation.ledger.rows import (
    INCREMENTS_PER_TURN,
    LedgerRow,
    Question,
    Spoken,
    Standing,
    costs,
    step_failed,
)
from gantryctl.operation.ledger.silence import watch_step
from gantryctl.program.alarms.words import Clauses, Said, Words

CSV: Final = "runs_csv"
TELEGRAMS: Final = "maps_telegrams"
COUNTS: Final = "knows_counts"
UNITS: Final = "knows_speed_unit"
SIGN_STEP: Final = "sign"
_CSV_MODE: Final = 9
_NEEDED: Final = (0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x60FF)
_MAPPED: Final = (0x6040, 0x6041, 0x6064, 0x60FF)
_TELEGRAMS: Final = ((0x1400, 1), (0x1600, 0), (0x1800, 1), (0x1A00, 0))
# Transmission types: at each SYNC; on arrival (CiA 301).
_AT_SYNC: Final = range(1, 2)
_ON_ARRIVAL: Final = (254, 255)


def csv_row(q: Question) -> LedgerRow:
    """Mode cyclic synchronous velocity."""
    facts = q.facts
    missing = ", ".join(f"{index:04X}" for index in _NEEDED if not facts.has(index))
    if missing:
        return _lacking(CSV, costs(Words.LEDGER_NO_OBJECT(object=missing), Words.LEDGER_NOTHING_STANDS_IN))
    model = q.profile
    if model is not None and _CSV_MODE not in model.modes:
        said = Words.LEDGER_NO_CSV_BY_PROFILE(number=_CSV_MODE, profile=model.name)
        return _lacking(CSV, said, Words.LEDGER_PROFILE_MODE)
    if q.verdict("6502:00") is ParameterVerdict.DIFFERS:
        said = Words.LEDGER_NO_CSV_BIT(have=q.parameters["6502:00"].have)
        return _lacking(CSV, said, Words.LEDGER_PROFILE_MODE)
    if not facts.objects[0x6060, 0].takes(_CSV_MODE):
        return _lacking(CSV, Words.LEDGER_CSV_NOT_TAKEN(number=_CSV_MODE), Words.LEDGER_PROFILE_MODE)
    if facts.has(0x6502):
        return LedgerRow(CSV, Standing.OBJECT, "6502")
    return LedgerRow(CSV, Standing.MADE_UP, "6061", Clauses((Words.LEDGER_CSV_SEEN,)))


def _lacking(what: str, *why: object) -> LedgerRow:
    """A row that no proof, no key and no name ends."""
    return LedgerRow(what, Standing.LACKING, "", Clauses(why))


def telegram_row(q: Question) -> LedgerRow:
    """Telegrams that can be set up: command and speed in one, status and position in the other."""
    facts = q.facts
    fixed = ", ".join(f"{i:04X}:{s:02X}" for i, s in _TELEGRAMS if not facts.writable(i, s))
    if fixed:
        fixed_ones = Words.LEDGER_NOT_WRITABLE(objects=fixed)
        return _lacking(TELEGRAMS, costs(fixed_ones, Words.LEDGER_TELEGRAMS_STAY))
    unmapped = [i for i in _MAPPED if facts.has(i) and not facts.objects[i, 0].mappable]
    if unmapped:
        names = Words.LEDGER_NOT_MAPPABLE(objects=", ".join(f"{index:04X}" for index in unmapped))
        return _lacking(TELEGRAMS, costs(names, Words.LEDGER_SDO_TOO_SLOW))
    if not facts.writable(0x1800, 2) and facts.value(0x1800, 2) not in (*_AT_SYNC, None):
        return _lacking(TELEGRAMS, Words.LEDGER_NOT_AT_SYNC)
    kind = facts.value(0x1400, 2)
    if not facts.writable(0x1400, 2) and kind not in (*_AT_SYNC, None):
        stays = Words.LEDGER_KIND_STAYS(number=kind)
        if kind in _ON_ARRIVAL:
            cost = Clauses((costs(stays, Words.LEDGER_ON_ARRIVAL),))
            return LedgerRow(TELEGRAMS, Standing.OBJECT, "1600, 1A00", cost)
        return _lacking(TELEGRAMS, costs(stays, Words.LEDGER_TELEGRAMS_STAY))
    return LedgerRow(TELEGRAMS, Standing.OBJECT, "1600, 1A00")


def counts_row(q: Question) -> LedgerRow:
    """Increments of a motor turn."""
    if q.verdict("608F:01") is ParameterVerdict.DIFFERS:
        row = q.parameters["608F:01"]
        said = Words.LEDGER_AGAINST_FILE(
            object="608F:01", have=row.have, key="increments_per_turn", want=row.want
        )
        return _one_is_wrong(COUNTS, said)
    if q.has("608F:01"):
        return LedgerRow(COUNTS, Standing.OBJECT, "608F")
    from gantryctl.wiring.canopen import counts_increments  # only a machine on a bus loads the bus

    shown = _by_sign(q, COUNTS, *q.why_not("608F:01"))
    if shown.lacking or INCREMENTS_PER_TURN in q.proofs.measured or not counts_increments(q.machine, q.facts):
        return shown
    # Position and 60FF in the same increments agree whatever their number in a turn is.
    why = Clauses((*shown.detail, Words.LEDGER_COUNTS_UNSEEN))
    return LedgerRow(COUNTS, Standing.LACKING, "", why, "", True)


def _one_is_wrong(what: str, *said: Said) -> LedgerRow:
    detail = Clauses((Words.LEDGER_ONE_WRONG(said=Clauses(said)),))
    return LedgerRow(what, Standing.LACKING, "", detail, by_file=True)


def unit_row(q: Question) -> LedgerRow:
    """Unit of 60FF."""
    from gantryctl.wiring.canopen import contradictions  # only a machine on a bus loads the bus

    if found := contradictions(q.machine, q.facts):
        said = (
            Words.LEDGER_AGAINST_PROFILE(
                object=each.object, have=each.have, profile=each.profile, want=each.want
            )
            for each in found
        )
        return _one_is_wrong(UNITS, *said)
    if q.verdict("60A9:00") is ParameterVerdict.DIFFERS:
        have, unit = q.parameters["60A9:00"].have, f'"{q.machine.can.velocity_unit}"'
        against = Words.LEDGER_AGAINST_FILE(object="60A9", have=have, key="velocity_unit", want=unit)
        return _one_is_wrong(UNITS, against)
    if q.has("60A9:00"):
        return LedgerRow(UNITS, Standing.OBJECT, "60A9")
    return _by_sign(q, UNITS, Words.LEDGER_NO_OBJECT(object="60A9"))


def _by_sign(q: Question, what: str, *why: object) -> LedgerRow:
    """Scale that a short motion shows: the way by position, by speed, and as commanded agree."""
    if SIGN_STEP in q.proofs.failed:
        return LedgerRow(what, Standing.LACKING, "", Clauses((*why, step_failed(SIGN_STEP))), SIGN_STEP)
    if SIGN_STEP in q.proofs.passed:
        return LedgerRow(what, Standing.PROVEN, Words.LEDGER_STEP(step=SIGN_STEP), Clauses(why), SIGN_STEP)
    return LedgerRow(what, Standing.LACKING, "", Clauses((*why, Words.LEDGER_MOTION_TO_SHOW)), SIGN_STEP)


# Object, property, what makes up for it (None: the step that shows a silent controller), and the consequence. What
# none of these needs is not in the list: of nine real object dictionaries six have no 603F, four no 6077, and 605B,
# shutdown, is never asked to ramp here.
_CONSEQUENCES: Final = (
    (0x1005, 0, "hears_sync", Words.LEDGER_ANSWERS_TO_SYNC, Words.LEDGER_WITHOUT_1005),
    (0x1006, 0, "knows_sync_period", "60C2", Words.LEDGER_WITHOUT_1006),
    (0x1017, 0, "shows_its_life", Words.LEDGER_ITS_TELEGRAMS, Words.LEDGER_WITHOUT_1017),
    (0x1029, 1, "leaves_operational", None, Words.LEDGER_WITHOUT_1029),
    (0x6007, 0, "reacts_to_lost_bus", None, Words.LEDGER_WITHOUT_6007),
    (0x603F, 0, "tells_its_fault", Words.LEDGER_EMERGENCY_MESSAGES, Words.LEDGER_WITHOUT_603F),
    (0x6076, 0, "knows_rated_torque", "[motor] torque_rated_nm", Words.LEDGER_WITHOUT_6076),
    (0x6077, 0, "tells_its_torque", Words.LEDGER_SAG, Words.LEDGER_WITHOUT_6077),
    (0x60B2, 0, "takes_preload", Words.LEDGER_BRAKE_SEQUENCE, Words.LEDGER_WITHOUT_60B2),
    (0x606C, 0, "tells_its_speed", Words.LEDGER_DIFFERENCES, Words.LEDGER_WITHOUT_606C),
    (0x60FE, 1, "has_outputs", Words.LEDGER_BRAKE_SEQUENCE, Words.LEDGER_WITHOUT_60FE),
)  # fmt: skip


def sync_row(q: Question) -> LedgerRow | None:
    """SYNC without a counter, where the drive can have one; None where it cannot."""
    if q.verdict("1019:00") is not ParameterVerdict.FIXED:
        return None
    return _lacking("takes_plain_sync", costs(q.why_not("1019:00"), Words.LEDGER_COUNTED_SYNC))


def window_row(q: Question) -> LedgerRow | None:
    """Commands that count whenever they come in a cycle, where the drive has a window for them and keeps it."""
    if q.verdict("1007:00") is not ParameterVerdict.FIXED:
        return None
    window_us = q.value("1007:00") or 0
    why = q.why_not("1007:00")
    if window_us >= round(1e3 * q.machine.control.scan_period_ms):
        return _made_up("takes_late_commands", "[control] scan_period_ms", why, Words.LEDGER_WIDE_WINDOW)
    detail = Clauses((costs(why, Words.LEDGER_NARROW_WINDOW),))
    return LedgerRow("takes_late_commands", Standing.LACKING, "", detail, by_file=True)


def emergency_row(q: Question) -> LedgerRow | None:
    """Emergency messages under the identifier of the drive, where it keeps another one, or sends none."""
    if q.verdict("1014:00") is not ParameterVerdict.FIXED:
        return None
    held, why = q.value("1014:00") or 0, q.why_not("1014:00")
    if not held & _NO_MESSAGE and held & _IDENTIFIER == _SYNC:
        return _lacking("is_heard", costs(why, Words.LEDGER_EMERGENCY_IS_SYNC))
    return _made_up("is_heard", "6041", why, Words.LEDGER_WITHOUT_1014)


# Of 1014, by CiA 301: bit 31, no message is sent; the identifier; and that of SYNC.
_NO_MESSAGE: Final = 1 << 31
_IDENTIFIER: Final = 0x1FFF_FFFF
_SYNC: Final = 0x80


def consequence_rows(q: Question) -> Iterator[LedgerRow]:
    """A row for each optional object that is missing, cannot be mapped, or holds another value for good."""
    facts = q.facts
    yield from filter(None, (sync_row(q), window_row(q), emergency_row(q)))
    for index, sub, what, named, cost in _CONSEQUENCES:
        place = f"{index:04X}:{sub:02X}"
        name = place.removesuffix(":00")
        if index == 0x60FE and q.machine.brake.owner == "object_60FE":
            continue
        by = named or Words.LEDGER_STEP(step=watch_step(q))
        fixed = q.verdict(place) is ParameterVerdict.FIXED
        fact = facts.objects.get((index, sub))
        if fact is None:
            yield _made_up(what, by, Words.LEDGER_NO_OBJECT(object=name), cost)
        elif fixed:
            yield _made_up(what, by, q.why_not(place), cost)
        elif index in _TELEGRAM_ONLY and not fact.mappable:
            yield _made_up(what, by, Words.LEDGER_NOT_MAPPABLE(objects=name), cost)
    if not q.has("605E:00"):
        yield _made_up("ramps_fault", Words.LEDGER_THE_BRAKE, q.why_not("605E:00"), Words.LEDGER_WITHOUT_605E)
    if not q.has("60C2:01") or q.verdict("60C2:02") is ParameterVerdict.FIXED:
        why = q.why_not("60C2:01", "60C2:02")
        yield _made_up("interpolates", "SYNC", why, Words.LEDGER_WITHOUT_60C2)


def _made_up(what: str, by: Spoken, objects: object, cost: Words) -> LedgerRow:
    return LedgerRow(what, Standing.MADE_UP, by, Clauses((costs(objects, cost),)))


# Of no use by SDO: too slow for the scan.
_TELEGRAM_ONLY: Final = (0x6077, 0x60B2, 0x606C)
