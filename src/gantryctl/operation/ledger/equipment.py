"""Rows of what a CSV axis is made of: mode, telegrams, scales; and the consequence of each object that is missing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.operation.ledger.rows import INCREMENTS_PER_TURN, LedgerRow, Question, Standing

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
        return LedgerRow(
            CSV, Standing.LACKING, "", f"no {missing}: nothing stands in for these in a CSV axis"
        )
    profile = "a drive in a profile mode makes set-points of its own, and nothing here replaces CSV"
    model = q.profile
    if model is not None and _CSV_MODE not in model.modes:
        detail = f"no mode {_CSV_MODE}, CSV, by the profile {model.name}; {profile}"
        return LedgerRow(CSV, Standing.LACKING, "", detail)
    if q.verdict("6502:00") is ParameterVerdict.DIFFERS:
        detail = f"6502 = {q.parameters['6502:00'].have} has no CSV (bit 8); {profile}"
        return LedgerRow(CSV, Standing.LACKING, "", detail)
    if not facts.objects[0x6060, 0].takes(_CSV_MODE):
        return LedgerRow(CSV, Standing.LACKING, "", f"6060 does not take {_CSV_MODE}, CSV; {profile}")
    if facts.has(0x6502):
        return LedgerRow(CSV, Standing.OBJECT, "6502")
    return LedgerRow(CSV, Standing.MADE_UP, "6061", "no 6502; that it shows mode 9, and moves in it, is seen")


def telegram_row(q: Question) -> LedgerRow:
    """Telegrams that can be set up: command and speed in one, status and position in the other."""
    facts = q.facts
    fixed = ", ".join(f"{i:04X}:{s:02X}" for i, s in _TELEGRAMS if not facts.writable(i, s))
    stays = "the telegrams stay as they are, and SDO is too slow for a speed each SYNC"
    if fixed:
        return LedgerRow(TELEGRAMS, Standing.LACKING, "", f"{fixed} cannot be written: {stays}")
    unmapped = [i for i in _MAPPED if facts.has(i) and not facts.objects[i, 0].mappable]
    if unmapped:
        names = ", ".join(f"{index:04X}" for index in unmapped)
        return LedgerRow(TELEGRAMS, Standing.LACKING, "", f"{names} cannot be mapped: SDO is too slow for it")
    if not facts.writable(0x1800, 2) and facts.value(0x1800, 2) not in (*_AT_SYNC, None):
        return LedgerRow(TELEGRAMS, Standing.LACKING, "", "1800:02 is fixed: feedback does not come at SYNC")
    kind = facts.value(0x1400, 2)
    if not facts.writable(0x1400, 2) and kind not in (*_AT_SYNC, None):
        if kind in _ON_ARRIVAL:
            cost = f"1400:02 stays {kind}: a command acts when it arrives, sooner than at the next SYNC"
            return LedgerRow(TELEGRAMS, Standing.OBJECT, "1600, 1A00", cost)
        return LedgerRow(TELEGRAMS, Standing.LACKING, "", f"1400:02 stays {kind}: {stays}")
    return LedgerRow(TELEGRAMS, Standing.OBJECT, "1600, 1A00")


def counts_row(q: Question) -> LedgerRow:
    """Increments of a motor turn."""
    if q.verdict("608F:01") is ParameterVerdict.DIFFERS:
        row = q.parameters["608F:01"]
        detail = f"608F:01 = {row.have}, [can] increments_per_turn = {row.want}: one of them is wrong"
        return LedgerRow(COUNTS, Standing.LACKING, "", detail, by_file=True)
    if q.has("608F:01"):
        return LedgerRow(COUNTS, Standing.OBJECT, "608F")
    from gantryctl.wiring.canopen import counts_increments  # only a machine on a bus loads the bus

    shown = _by_sign(q, COUNTS, q.why_not("608F:01"))
    if shown.lacking or INCREMENTS_PER_TURN in q.proofs.measured or not counts_increments(q.machine, q.facts):
        return shown
    # Position and 60FF in the same increments agree whatever their number in a turn is.
    why = f"{shown.detail}; 60FF counts increments: nothing in this drive shows those of a turn"
    return LedgerRow(COUNTS, Standing.LACKING, "", why, "", True)


def unit_row(q: Question) -> LedgerRow:
    """Unit of 60FF."""
    from gantryctl.wiring.canopen import contradictions  # only a machine on a bus loads the bus

    if said := contradictions(q.machine, q.facts):
        return LedgerRow(
            UNITS, Standing.LACKING, "", f"{'; '.join(said)}: one of them is wrong", by_file=True
        )
    if q.verdict("60A9:00") is ParameterVerdict.DIFFERS:
        unit = q.machine.can.velocity_unit
        detail = (
            f'60A9 = {q.parameters["60A9:00"].have}, [can] velocity_unit = "{unit}": one of them is wrong'
        )
        return LedgerRow(UNITS, Standing.LACKING, "", detail, by_file=True)
    if q.has("60A9:00"):
        return LedgerRow(UNITS, Standing.OBJECT, "60A9")
    return _by_sign(q, UNITS, "no 60A9")


def _by_sign(q: Question, what: str, why: str) -> LedgerRow:
    """Scale that a short motion shows: the way by position, by speed, and as commanded agree."""
    if SIGN_STEP in q.proofs.failed:
        return LedgerRow(what, Standing.LACKING, "", f"{why}; step {SIGN_STEP} has failed", SIGN_STEP)
    if SIGN_STEP in q.proofs.passed:
        return LedgerRow(what, Standing.PROVEN, f"step {SIGN_STEP}", why, SIGN_STEP)
    return LedgerRow(what, Standing.LACKING, "", f"{why}; a short motion is to show it", SIGN_STEP)


# Object, property, what makes up for it, and the consequence. What none of these needs is not in the list: of nine real
# object dictionaries six have no 603F, four no 6077, and 605B, shutdown, is never asked to ramp here.
_CONSEQUENCES: Final = (
    (0x1005, 0, "hears_sync", "the answers to SYNC", "80h is taken for it; a drive without an answer is refused"),
    (0x1006, 0, "knows_sync_period", "60C2", "the drive has the period from 60C2, or from SYNC itself"),
    (0x1017, 0, "shows_its_life", "its telegrams", "its loss is seen by missing telegrams, after 30 ms"),
    (0x1029, 1, "leaves_operational", "step silence", "what it does after lost communication is fixed by its maker"),
    (0x6007, 0, "reacts_to_lost_bus", "step silence", "its reaction is fixed by its maker: what the step sees"),
    (0x603F, 0, "tells_its_fault", "emergency messages", "a fault without a message has no code"),
    (0x6076, 0, "knows_rated_torque", "[motor] torque_rated_nm", "nothing in the drive confirms the scale of torque"),
    (0x6077, 0, "tells_its_torque", "the sag after release", "no torque proof before the brake opens, no brake test"),
    (0x60B2, 0, "takes_preload", "the drive's brake sequence", "the load sags a little when the brake opens"),
    (0x606C, 0, "tells_its_speed", "differences of 6064", "speed has the steps of the encoder"),
    (0x60FE, 1, "has_outputs", "the drive's brake sequence", "no output of this drive can be set"),
)  # fmt: skip


def consequence_rows(q: Question) -> Iterator[LedgerRow]:
    """A row for each optional object that is missing, cannot be mapped, or holds another value for good."""
    facts = q.facts
    for index, sub, what, by, cost in _CONSEQUENCES:
        place = f"{index:04X}:{sub:02X}"
        if index == 0x60FE and q.machine.brake.owner == "object_60FE":
            continue
        fixed = q.verdict(place) is ParameterVerdict.FIXED
        fact = facts.objects.get((index, sub))
        if fact is None:
            yield LedgerRow(what, Standing.MADE_UP, by, f"no {place.removesuffix(':00')}: {cost}")
        elif fixed:
            yield LedgerRow(what, Standing.MADE_UP, by, f"{q.why_not(place)}: {cost}")
        elif index in _TELEGRAM_ONLY and not fact.mappable:
            yield LedgerRow(
                what, Standing.MADE_UP, by, f"{place.removesuffix(':00')} cannot be mapped: {cost}"
            )
    if not q.has("605E:00"):
        why = q.why_not("605E:00")
        yield LedgerRow("ramps_fault", Standing.MADE_UP, "the brake", f"{why}: count on torque off and brake")
    if not q.has("60C2:01") or q.verdict("60C2:02") is ParameterVerdict.FIXED:
        why = q.why_not("60C2:01", "60C2:02")
        cost = "a drive that needs it does not move, or moves in steps: seen by step velocity"
        yield LedgerRow("interpolates", Standing.MADE_UP, "SYNC", f"{why}: {cost}")


# Of no use by SDO: too slow for the scan.
_TELEGRAM_ONLY: Final = (0x6077, 0x60B2, 0x606C)
