"""Parameter check: what decides what happens when something breaks, written and read back before enabling."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError, abort_text
from gantryctl.drives.canopen.scaling import BusUnits
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.od.standard import STANDARD
from gantryctl.drives.od.velocity_units import VELOCITY_UNITS
from gantryctl.drives.od.verdicts import ParameterRow, ParameterVerdict
from gantryctl.errors import DeviceError
from gantryctl.units import r_min_from_rad_s

CSV: Final = 9
CSV_BIT: Final = 1 << (CSV - 1)
SYNC_ID: Final = 0x80
_COUNTER: Final = (0x1019, 0)
_PERIOD: Final = (0x1006, 0)
_MASK_ID: Final = 0x7FF
_EMCY_ID: Final = 0x80
# Bit 31: not valid, no EMCY is sent; bit 29: an identifier of 29 bits (CiA 301).
_MASK_EMCY: Final = 0xA000_07FF


class WantedParameter(NamedTuple):
    """Parameter and its set value."""

    obj: int
    sub: int
    value: int
    meaning: str
    writable: bool = True
    """The controller writes it; else it is only compared."""
    mask: int = -1
    """Bits that are compared."""
    tolerance: int = 0
    may_lack: bool = False
    """A drive without it does as wanted."""


def wanted_parameters(
    settings: CanopenSettings, units: BusUnits, rated_nm: float
) -> tuple[WantedParameter, ...]:
    """Parameters that the controller writes before it enables, and those that it only compares."""
    s = settings
    period_us = round(s.period_s * 1e6)
    value, exponent = interpolation(period_us)
    torque = round(1000.0 * s.torque_max_nm / (rated_nm * s.torque_reference))
    ceiling = round(r_min_from_rad_s(s.speed_ceiling_rad_s))
    quick = units.ramp(s.quick_dec_rad_s2)
    # docs/reference/canopen.md gives the reason for each. 6007 = 1 with 605E = 2, not 6007 = 3: with 605A = 6 a quick
    # stop by lost communication would hold the load on a servo whose controller is gone; a fault ramps down, closes
    # the brake and takes the torque off (decision 0012). Of nine real object dictionaries none has both 1016 and
    # 1400:05, and five have no 6072: what a drive lacks is judged by the ledger.
    return (
        # First: in some drives ramps and limits count in it.
        *_velocity_unit(s),
        WantedParameter(0x1005, 0, SYNC_ID, "identifier of SYNC", mask=_MASK_ID),
        # Before 1006, which must be 0 while it changes (`write_parameters`).
        WantedParameter(
            *_COUNTER,
            0,
            "SYNC comes without a counter: a drive that expects one may not hear it",
            may_lack=True,
        ),
        WantedParameter(*_PERIOD, period_us, "SYNC period, us"),
        WantedParameter(0x1007, 0, 0, "commands count whenever they come after SYNC: 0 sets no window, us"),
        WantedParameter(0x60C2, 1, value, "SYNC period: some drives do not move without it"),
        WantedParameter(0x60C2, 2, exponent, "the same, power of ten of a second"),
        WantedParameter(
            0x1014, 0, _EMCY_ID + s.node, "the drive is heard when it complains (EMCY)", mask=_MASK_EMCY
        ),
        WantedParameter(0x1017, 0, round(s.heartbeat_s * 1e3), "the drive shows that it lives, ms"),
        WantedParameter(
            0x1016, 1, s.watched_heartbeat, "the drive watches the controller's heartbeat: node and ms"
        ),
        WantedParameter(0x1400, 5, round(s.rpdo_deadline_s * 1e3), "the drive watches for commands, ms"),
        WantedParameter(
            0x6007, 0, 1, "lost communication is a fault: 0 lets a silent controller's axis run on"
        ),
        WantedParameter(
            0x605E, 0, 2, "a fault ramps down, then brake and torque off: 0 drops the load on the brake"
        ),
        _quick_stop_option(s),
        WantedParameter(0x605B, 0, 1, "shutdown ramps down first"),
        WantedParameter(
            0x605C, 0, 1, "disable operation ramps down, closes the brake, then takes the torque off"
        ),
        WantedParameter(0x605D, 0, 1, "halt ramps down (it may have no function in CSV)"),
        WantedParameter(0x1029, 1, 0, "after lost communication the drive leaves OPERATIONAL"),
        WantedParameter(0x6085, 0, quick, "quick-stop deceleration: some drives come with 360 000 deg/s2"),
        WantedParameter(0x6080, 0, ceiling, "speed ceiling in the drive, r/min", tolerance=1),
        WantedParameter(0x6072, 0, torque, "torque limit, per mille", tolerance=1),
        rated_torque(s),
        WantedParameter(0x6502, 0, CSV_BIT, "the drive must have mode 9 (CSV)", writable=False, mask=CSV_BIT),
        WantedParameter(0x608F, 1, s.increments_per_turn, "[can] increments_per_turn", writable=False),
        WantedParameter(0x608F, 2, 1, "the same, per motor turn", writable=False),
    )


def _velocity_unit(settings: CanopenSettings) -> tuple[WantedParameter, ...]:
    word = VELOCITY_UNITS[settings.speed_unit].si_unit
    if word is None:
        return ()
    return (WantedParameter(0x60A9, 0, word, "[can] velocity_unit", writable=settings.sets_speed_unit),)


def rated_torque(settings: CanopenSettings) -> WantedParameter:
    """6076, which scales every torque of the drive; entered with the motor, in the maker's tool."""
    # Drives are delivered with 0 or 1, and a wrong unit is a factor of 1000. Catalogues round, and some makers give
    # the torque at the rated current, not at the rated speed: half as much again is still the same motor.
    per_nm = settings.rated_torque_per_nm
    rated = round(per_nm * settings.torque_rated_nm)
    meaning = (
        f"[motor] torque_rated_nm = {settings.torque_rated_nm:g}, {per_nm:g} to 1 N m, and half of it more or less: it "
        "scales torque limit and torque reading · enter the motor with the drive maker's tool"
    )
    return WantedParameter(_RATED, 0, rated, meaning, writable=False, tolerance=rated // 2)


def _quick_stop_option(settings: CanopenSettings) -> WantedParameter:
    # Quick stop active is left for torque off or for Operation enabled only (CiA 402). A drive that owns its brake
    # must end the stop by itself: torque off with the brake still open let the gear unwind by 0.020 deg.
    if settings.brake_owner == "drive":
        return WantedParameter(
            0x605A, 0, 2, "quick stop ramps down, closes the brake, then takes the torque off"
        )
    return WantedParameter(
        0x605A, 0, 6, "quick stop ramps down and holds while the controller closes the brake"
    )


def interpolation(period_us: int) -> tuple[int, int]:
    """Interpolation time period 60C2:01 x 10^(60C2:02) s; the value has 8 bits.

    Raises:
        DeviceError: no pair of value and exponent gives this period.
    """
    for exponent in (-3, -4, -5, -6):
        unit_us = 10 ** (6 + exponent)
        if period_us % unit_us == 0 and 1 <= period_us // unit_us <= 255:
            return period_us // unit_us, exponent
    raise DeviceError(f"a SYNC period of {period_us} us cannot be told to the drive (60C2)")


def set_value_places(wanted: Iterable[WantedParameter]) -> tuple[tuple[int, int], ...]:
    """Objects whose values decide what the drive does: those that are compared, and the scales of its name plate."""
    return (*((parameter.obj, parameter.sub) for parameter in wanted), *_PLATE)


# Rated current and torque, limits of current, gear and feed, motor type, profile velocity, polarity: a change of one of
# them changes what a torque or a speed on the bus means, and nothing here writes them.
_PLATE: Final = (
    (0x6075, 0), (0x6076, 0), (0x6073, 0), (0x6091, 1), (0x6091, 2), (0x6092, 1), (0x6092, 2), (0x6402, 0), (0x607F, 0),
    (0x607E, 0),
)  # fmt: skip


def parameter_checksum(facts: DriveFacts, wanted: Iterable[WantedParameter]) -> str:
    """Checksum of the values that decide what the drive does, as the set-up has left them."""
    values = {place: facts.value(*place) for place in set_value_places(wanted)}
    held = [f"{i:04X}:{s:02X}={v}" for (i, s), v in sorted(values.items()) if v is not None]
    return hashlib.sha256("\n".join(held).encode()).hexdigest()


def compare_parameters(facts: DriveFacts, wanted: Iterable[WantedParameter]) -> tuple[ParameterRow, ...]:
    """Compare what a drive holds with the set values."""
    return tuple(_compare_fact(facts, parameter) for parameter in wanted)


def _compare_fact(facts: DriveFacts, wanted: WantedParameter) -> ParameterRow:
    fact = facts.objects.get((wanted.obj, wanted.sub))
    row = compare(wanted, facts.value(wanted.obj, wanted.sub))
    if fact is None or row.verdict is ParameterVerdict.OK:
        return row
    if row.value is None:
        return row._replace(verdict=ParameterVerdict.UNKNOWN, have="not known")
    # What is only compared differs whoever may write it; what is written and stays is fixed.
    if wanted.writable and not fact.takes(wanted.value):
        return row._replace(verdict=ParameterVerdict.FIXED)
    return row


def as_set_up(facts: DriveFacts, wanted: Iterable[WantedParameter]) -> DriveFacts:
    """A drive as its set-up would leave it, by an EDS or by what was read before: it holds what it takes.

    A default of an object that only the maker's tool writes is no promise: only the drive can say its value.
    """
    objects = dict(facts.objects)
    for parameter in wanted:
        place = parameter.obj, parameter.sub
        fact = objects.get(place)
        if fact is None:
            continue
        if parameter.writable and fact.takes(parameter.value):
            objects[place] = replace(fact, default=_written(parameter, fact))
        elif (
            not parameter.writable
            and (fact.writable or parameter.obj == _RATED)
            and parameter.obj in _OF_THE_MOTOR
        ):
            objects[place] = replace(fact, default=None)
    return replace(facts, objects=objects)


_RATED: Final = 0x6076
# Encoder increments and motor revolutions, rated torque: commissioned with the motor by the maker's tool. The rated
# torque of an EDS is a default, also where it cannot be written over the bus.
_OF_THE_MOTOR: Final = frozenset({0x608F, _RATED})


def _written(parameter: WantedParameter, fact: ObjectFact) -> int:
    have = fact.default if isinstance(fact.default, int) else None
    return have if have is not None and _equal(parameter, have) else parameter.value


# CiA 301: cannot be written, access not possible, value out of range, too high, too low.
_TAKES_NONE: Final = (0x0601_0002, 0x0601_0000, 0x0609_0030, 0x0609_0031, 0x0609_0032)


def write_parameters(
    sdo: SdoClient, wanted: Iterable[WantedParameter]
) -> tuple[frozenset[tuple[int, int]], dict[str, int]]:
    """Write what differs; return the objects for which the drive takes no value, and every abort code by place."""
    refused_by_drive, codes = set(), {}
    for parameter in wanted:
        if not parameter.writable:
            continue
        try:
            have = sdo.optional(parameter.obj, parameter.sub)
            if have is None or _equal(parameter, have):
                continue
            if (parameter.obj, parameter.sub) == _COUNTER:
                stop_sync_period(sdo)
            sdo.set(parameter.obj, parameter.sub, parameter.value)
        except DeviceError as refused:
            if isinstance(refused, SdoError) and refused.silent:
                raise
            if isinstance(refused, SdoError):
                codes[_place(parameter)] = refused.code
            # What a drive takes, but not now, it must take: it differs, and is refused. An object of another type than
            # the standard gives it takes no value either: nobody knows what it means.
            if isinstance(refused, SdoError) and refused.code not in _TAKES_NONE:
                continue
            refused_by_drive.add((parameter.obj, parameter.sub))
    return frozenset(refused_by_drive), codes


def stop_sync_period(sdo: SdoClient) -> None:
    """Set 1006 to 0, where it is there: until it is written again the counter of SYNC may change (CiA 301)."""
    try:
        if sdo.optional(*_PERIOD):
            sdo.set(*_PERIOD, 0)
    except SdoError as refused:
        if refused.silent:
            raise


def with_abort_codes(rows: Iterable[ParameterRow], codes: Mapping[str, int]) -> tuple[ParameterRow, ...]:
    """Rows that say why the drive did not take a value."""
    return tuple(
        row._replace(meaning=f"{row.meaning} · writing it: {abort_text(codes[row.place])}")
        if row.place in codes and row.verdict is not ParameterVerdict.OK
        else row
        for row in rows
    )


def refusals(rows: Iterable[ParameterRow]) -> tuple[str, ...]:
    """Lines that forbid enabling."""
    return tuple(row.line for row in rows if row.verdict.refuses)


def _equal(wanted: WantedParameter, have: int) -> bool:
    if wanted.mask != -1:
        return (have & wanted.mask) == (wanted.value & wanted.mask)
    return abs(have - wanted.value) <= wanted.tolerance


def compare(wanted: WantedParameter, have: int | None) -> ParameterRow:
    """Compare one parameter; `have` is None where the drive has no value."""
    known = STANDARD.get((wanted.obj, wanted.sub))
    name = known.name if known is not None else ""
    if have is None:
        verdict = ParameterVerdict.OK if wanted.may_lack else ParameterVerdict.ABSENT
    else:
        verdict = ParameterVerdict.OK if _equal(wanted, have) else ParameterVerdict.DIFFERS
    seen = "nothing" if have is None else _shown(wanted.obj, have)
    return ParameterRow(
        _place(wanted), name, _shown(wanted.obj, wanted.value), seen, verdict, wanted.meaning, have
    )


def _place(parameter: WantedParameter) -> str:
    return f"{parameter.obj:04X}:{parameter.sub:02X}"


def _shown(index: int, value: int) -> str:
    """Value as in a manual: identifiers and bit fields hexadecimal."""
    if index == 0x1016:
        return f"node {value >> 16 & 0x7F}, {value & 0xFFFF} ms"
    return f"{value:X}h" if index in (0x1005, 0x1014, 0x6502, 0x60A9) else str(value)
