"""What an injection means to the oracle: what the axis may do because of it, and for how long."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.engineering.faults.injection import Injection
from gantryctl.engineering.faults.kinds.kind import Place
from gantryctl.engineering.faults.limits import goes_by_itself_s, stops_its_telegrams, unreached
from gantryctl.engineering.faults.oracle.axis_oracle import AxisOracle
from gantryctl.engineering.faults.oracle.known import Effect
from gantryctl.engineering.faults.oracle.limits import BRAKE_BEGINS_S
from gantryctl.engineering.faults.target import Target

_NOTHING: Final = Effect()
_DOUBT: Final = Effect(feedback=True, at_once=True)
_AT_ONCE: Final = Effect(at_once=True)
_DOUBT_OF: Final = frozenset(
    {
        (Place.ENCODER, "jump"), (Place.ENCODER, "freeze_reading"),
        (Place.ENCODER, "speed_reading"), (Place.ENCODER, "turns"), (Place.DRIVE, "sign"),
        (Place.DRIVE, "ignore_target"), (Place.DRIVE, "never_move"), (Place.DRIVE, "mode_display"),
        (Place.FRAME, "readings_late"), (Place.NODE, "encoder_frozen"), (Place.NODE, "encoder_alarm"),
        (Place.NODE, "encoder_jump"),
    }
)  # fmt: skip
_SEEN_AT_ONCE: Final = frozenset(
    {(Place.DRIVE, "trip"), (Place.DRIVE, "leaves_enabled"), (Place.INPUT, "off")}
)
# They stop the axis on a ramp of the program, which is no stop by an alarm: one that comes later has a way of its own
# (G11, seed 41800). The way of the ramp is the judge's.
_ON_THE_RAMP: Final = frozenset({"enabling_switch", "door_ok"})
# A coupling that slips by less drives nothing away: the axis goes where it is told to, and no comparison shows it
# before the angle is off by what may be told. The oracle finds that by itself, and counts the way from there (A17 with
# an encoder on the ring: 0.05 deg, so half a degree at any speed, 0.67 deg with the stop from 0.8 deg/s).
_SLIPS_LITTLE: Final = 0.8
# Bits of the reading: an alarm, and checksum errors that stay, are doubt; a warning and a single error are not.
_FLAG_ALARM: Final = 2
_FLAG_ERROR: Final = 1


def effect_of(each: Injection) -> Effect:
    """What one injection means."""
    key, values = (each.where, each.kind), each.values
    if key in _DOUBT_OF:
        return _DOUBT
    if key == (Place.ENCODER, "gain"):
        return _NOTHING if _SLIPS_LITTLE <= values["value"] <= 1.0 else _DOUBT
    if key in _SEEN_AT_ONCE:
        return _NOTHING if values.get("name") in _ON_THE_RAMP else _AT_ONCE
    match key:
        case (Place.ENCODER, "flags"):
            lasting = values["bits"] & _FLAG_ERROR and each.for_s is None
            return _DOUBT if values["bits"] & _FLAG_ALARM or lasting else _NOTHING
        case (Place.DRIVE, "quick_stop_off"):
            return Effect(feedback=True)
        case (Place.DRIVE, "no_torque" | "torque_limit") | (Place.BRAKE, "torque" | "slow"):
            return Effect(no_ramp=True)
        case (Place.BRAKE, "stuck"):
            closes = values["position"] == "closed"
            return Effect(no_ramp=True, at_once=closes, late_s=BRAKE_BEGINS_S if closes else 0.0)
        case _:
            # Seen within its own time, which the alarm tells: the way counts from there.
            return _NOTHING


def hides_state(each: Injection) -> bool:
    """The telegrams with the state of the drive do not come, or none that can be read."""
    tpdo = (each.where, each.kind) == (Place.FRAME, "tpdo")
    return tpdo and each.values["number"] == 1 and each.values["kind"] in ("drop", "length")


def tell(axis: AxisOracle, each: Injection, target: Target) -> None:
    """Tell the oracle of this axis of an injection that acts from now on."""
    known, now = axis.known, axis.now()
    # Nor does a drive that no command reaches take its torque off before the end of that ramp (axes 8109 on the bus).
    known.own_ramp = known.own_ramp or stops_its_telegrams((each,)) or unreached(each)
    watchdog_s = target.machine.can.watchdog_ms * 1e-3
    if each.kind == "slow":
        known.brake_late_s = each.values["late_s"]
    if (each.where, each.kind) == (Place.BRAKE, "torque"):
        known.brake_share = each.values["share"]
    if each.kind == "outputs_dead" or (each.kind == "silent" and each.values["which"] == "io"):
        # The brake that it works falls with the watchdog relay, which waits for an edge that does not come.
        known.brake_late_s = max(known.brake_late_s, watchdog_s)
    if each.kind == "readings_late":
        known.reading_late_s = each.values["late_s"]
    if each.kind in ("contact", "inputs_stuck"):
        # Stuck inputs, the contact of the brake among them, keep their level, and come when they live again.
        known.contact_lies = each.values.get("open", True)
    if hides_state(each):
        lasts_s = math.inf if each.for_s is None else each.for_s
        known.state_seen_ms = max(known.state_seen_ms, now.ms + 1e3 * lasts_s)
    if each.where is Place.ENCODER:
        known.encoder_lies_ms.append(now.ms)
    if each.kind == "load_shift":
        known.load_share = lambda motor_rad: load_share(target, motor_rad)
    if each.kind == "stall":
        known.hold(now, each.values["late_s"])
    if unreached(each):
        # Nobody reaches the drive either, until the watchdog relay has fallen. Where there is none, and no brake but
        # through the drive, it goes by its own deadline: a torque off that is told to a frozen encoder does not arrive
        # (axis-pairs 1099, 1122).
        machine = target.machine
        ended = machine.can.output_place("watchdog") or machine.brake.owner == "controller_output"
        known.hold(now, watchdog_s if ended else goes_by_itself_s(machine, axis.deg(axis.speed)))
    if (each.where, each.kind) == (Place.DRIVE, "torque_limit"):
        known.torque_share = each.values["share"]
    known.inject(now, effect_of(each), math.inf if each.for_s is None else each.for_s)


def load_share(target: Target, motor_rad: float) -> float:
    """What the eccentric load asks for at a motor angle, in parts of what the brake has."""
    machine = target.machine
    ratio = machine.axis.ratio
    lever = math.sin(motor_rad / ratio - math.radians(machine.plant.load.eccentric_angle_deg))
    moment_nm = target.plant_value("eccentric_moment_nm") * lever / ratio
    return abs(moment_nm) / target.plant_value("brake_torque_nm")
