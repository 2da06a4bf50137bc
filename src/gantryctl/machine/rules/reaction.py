"""Rules of the reaction: what the permitted stopping angle leaves for times and bands before a stop begins.

Rigid body and name plates, as in the other chapters; `gantryctl stops` checks the stops on the whole plant. With v the
highest speed setting, a the quick-stop deceleration and A the permitted angle, a quick stop takes v^2 / 2a, so that
A - v^2 / 2a is the *reaction room* and that angle over v the *reaction time*. Not bounded here, because nothing moves
meanwhile, or because another monitor has stopped the axis: the in-position keys, the power-up time, the SDO time-out
and the intervals of the brake test.
"""

from __future__ import annotations

import math
from typing import Final

from gantryctl.machine.rules.book import RATIO, Broken, at_most, rule
from gantryctl.machine.rules.can import bus_rule
from gantryctl.machine.rules.parts import ROTOR, motors, rigid_inertia_kg_m2
from gantryctl.machine.tables.model import Machine
from gantryctl.units import deg

STOP: Final = ("speed.setting_max_deg_s", "virtual_axis.quick_dec_deg_s2")
ROOM: Final = (*STOP, "required.stopping_angle_deg")
SCAN: Final = "control.scan_period_ms"
BODY: Final = (*RATIO, "plant.load.inertia_kg_m2", *ROTOR, "plant.switches.second_pinion")
MOMENT: Final = "plant.load.eccentric_check_moment_nm"
# Drive at its torque limit, the eccentric moment helping it.
DRIVEN_AWAY: Final = ("motor.torque_max_nm", MOMENT, *BODY)
BRAKING: Final = ("brake.torque_nm", MOMENT, *BODY)

_TO_DO: Final = "shorten it, go slower, stop harder or permit a larger angle"
_REACTION: Final = f"or a stop from the highest setting leaves the permitted stopping angle; {_TO_DO}"
# The oldest position reading that the program still believes is three scans old (`program.feedback`).
_SCANS_OF_A_READING: Final = 3.0
REACTION_S: Final = 0.06
"""Time from the cause of a stop to the beginning of the ramp that permitted angles allow for, s."""


def reaction_room_deg(m: Machine) -> float:
    """Part of the permitted stopping angle that a quick stop from the highest setting leaves, 60 ms at the least."""
    v = m.speed.setting_max_deg_s
    rigid = m.required.stopping_angle_deg - v**2 / (2.0 * m.virtual_axis.quick_dec_deg_s2)
    # The rigid stop is longer than the real one, which friction helps (3.33 to 3.32 deg on the reference machine):
    # where it leaves less than the reaction that every stop is computed with, the check on the whole plant decides.
    return max(rigid, v * REACTION_S)


def reaction_time_ms(m: Machine) -> float:
    """How long the axis may go on at the highest setting before a quick stop begins."""
    return 1000.0 * reaction_room_deg(m) / m.speed.setting_max_deg_s


def _monitor_time_ms(m: Machine) -> float:
    """Reaction time of a monitor whose time is rounded up to whole scans."""
    return reaction_time_ms(m) - m.control.scan_period_ms


# --- scans and telegrams ------------------------------------------------------------------------------------
@rule(SCAN, *ROOM)
def scan_within_reaction(m: Machine) -> Broken:
    """Three scans, the oldest reading that counts, are within the reaction time of the permitted stopping angle."""
    return at_most(m.control.scan_period_ms, reaction_time_ms(m) / _SCANS_OF_A_READING, _REACTION)


@bus_rule("can.rpdo_deadline_ms", SCAN, *ROOM)
def deadline_within_reaction(m: Machine) -> Broken:
    """The drive's deadline and one scan are within the reaction time: it alone stops the axis of a dead controller."""
    return at_most(m.can.rpdo_deadline_ms, reaction_time_ms(m) - m.control.scan_period_ms, _REACTION)


@bus_rule(
    "can.heartbeat_timeout_ms", *STOP, "axis.mechanical_stop_min_deg", "axis.limit_switch_min_deg",
    "axis.limit_switch_max_deg", "axis.mechanical_stop_max_deg", "axis.kind",
)  # fmt: skip
def heartbeat_before_mechanical_stop(m: Machine) -> Broken:
    """The heartbeat, the guard behind the deadline, stops the axis between limit switch and mechanical stop."""
    if m.axis.modulo:  # no stop to run into
        return None
    v, a = m.speed.setting_max_deg_s, m.virtual_axis.quick_dec_deg_s2
    below_deg = m.axis.limit_switch_min_deg - m.axis.mechanical_stop_min_deg
    above_deg = m.axis.mechanical_stop_max_deg - m.axis.limit_switch_max_deg
    room = min(below_deg, above_deg) - v**2 / (2.0 * a)
    why = "or a stop at the limit switch ends at the mechanical stop; shorten it, go slower or stop harder"
    return at_most(m.can.heartbeat_timeout_ms, 1000.0 * room / v, why)


@bus_rule("can.stepped", "can.commissioning_required")
def stepped_is_for_virtual_drives(m: Machine) -> Broken:
    """A drive in virtual time is virtual: in real time a late scan stops the axis, in virtual time it cannot."""
    if m.can.stepped and m.can.commissioning_required:
        return "must be false on a real drive; a virtual one has commissioning_required = false"
    return None


# --- bands and times of the monitors ------------------------------------------------------------------------
@rule("monitors.following_error_time_ms", SCAN, *ROOM)
def following_error_time_within_reaction(m: Machine) -> Broken:
    """The time of the following error is within the reaction time."""
    return at_most(m.monitors.following_error_time_ms, _monitor_time_ms(m), _REACTION)


@rule("monitors.following_error_per_speed_s", "monitors.following_error_time_ms", SCAN, *ROOM)
def following_error_widening_within_reaction(m: Machine) -> Broken:
    """The widening of the following-error band and its time are within the reaction time."""
    left_ms = _monitor_time_ms(m) - m.monitors.following_error_time_ms
    return (
        at_most(m.monitors.following_error_per_speed_s, left_ms / 1000.0, _REACTION)
        if left_ms >= 0.0
        else None
    )


@rule(
    "monitors.following_error_base_deg",
    "monitors.following_error_per_speed_s",
    "monitors.following_error_time_ms",
    SCAN,
    *ROOM,
)
def following_error_band_within_reaction(m: Machine) -> Broken:
    """At the highest setting an axis that ignores its command leaves the following-error band within the room."""
    monitors = m.monitors
    left_ms = _monitor_time_ms(m) - monitors.following_error_time_ms
    left_s = left_ms / 1000.0 - monitors.following_error_per_speed_s
    if left_ms < 0.0 or left_s < 0.0:
        return None
    return at_most(monitors.following_error_base_deg, left_s * m.speed.setting_max_deg_s, _REACTION)


@rule("monitors.velocity_deviation_time_ms", SCAN, *ROOM)
def velocity_deviation_time_within_reaction(m: Machine) -> Broken:
    """The time of the velocity deviation is within the reaction time."""
    return at_most(m.monitors.velocity_deviation_time_ms, _monitor_time_ms(m), _REACTION)


@rule("monitors.velocity_deviation_deg_s", "monitors.velocity_deviation_time_ms", SCAN, *ROOM, *DRIVEN_AWAY)
def velocity_deviation_within_reaction(m: Machine) -> Broken:
    """An axis that its drive drives away at the torque limit shows the velocity deviation within the reaction time."""
    left_ms = _monitor_time_ms(m) - m.monitors.velocity_deviation_time_ms
    limit = driven_acc_deg_s2(m) * left_ms / 1000.0
    return at_most(m.monitors.velocity_deviation_deg_s, limit, _REACTION) if left_ms >= 0.0 else None


@rule("monitors.overspeed_time_ms", SCAN, *ROOM)
def overspeed_time_within_reaction(m: Machine) -> Broken:
    """The time of the overspeed is within the reaction time."""
    return at_most(m.monitors.overspeed_time_ms, _monitor_time_ms(m), _REACTION)


@rule("monitors.torque_saturation_time_ms", "speed.setting_max_deg_s", "required.stopping_angle_deg")
def saturation_within_stopping_angle(m: Machine) -> Broken:
    """Torque saturation is noticed within the permitted angle; the following error bounds what is lost meanwhile."""
    return at_most(m.monitors.torque_saturation_time_ms, _whole_angle_ms(m), _WHOLE_ANGLE)


@rule("monitors.brake_feedback_time_ms", "speed.setting_max_deg_s", "required.stopping_angle_deg")
def brake_feedback_within_stopping_angle(m: Machine) -> Broken:
    """A brake contact that contradicts the command is noticed within the permitted angle at the highest setting."""
    return at_most(m.monitors.brake_feedback_time_ms, _whole_angle_ms(m), _WHOLE_ANGLE)


_WHOLE_ANGLE: Final = f"permitted stopping angle / highest setting; {_TO_DO}"


def _whole_angle_ms(m: Machine) -> float:
    return 1000.0 * m.required.stopping_angle_deg / m.speed.setting_max_deg_s


_ENCODERS: Final = "control.compensation.load_encoder"


@rule(f"{_ENCODERS}.disagreement_time_ms", SCAN, *ROOM)
def disagreement_time_within_reaction(m: Machine) -> Broken:
    """The time of the disagreement of both encoders is within the reaction time."""
    return at_most(m.control.compensation.load_encoder.disagreement_time_ms, _monitor_time_ms(m), _REACTION)


@rule(f"{_ENCODERS}.disagreement_deg", f"{_ENCODERS}.disagreement_time_ms", SCAN, *ROOM)
def disagreement_within_reaction(m: Machine) -> Broken:
    """Encoders that part at the highest setting disagree within the reaction room."""
    encoders = m.control.compensation.load_encoder
    left_ms = _monitor_time_ms(m) - encoders.disagreement_time_ms
    limit = m.speed.setting_max_deg_s * left_ms / 1000.0
    return at_most(encoders.disagreement_deg, limit, _REACTION) if left_ms >= 0.0 else None


# --- a silent controller ------------------------------------------------------------------------------------
def silent_angle_deg(m: Machine, delay_ms: float, *, brake: bool = False, dec_deg_s2: float = 0.0) -> float:
    """Way from the last sign of a controller to rest, from the highest setting.

    Nobody works a brake any more that is not the drive's own: it closes behind the ramp, its torque gone.

    Args:
        delay_ms: until the drive misses the controller; it goes on at the speed of the last command meanwhile.
        brake: the drive takes the torque off and closes the brake instead of a ramp; inf where the brake is too weak.
        dec_deg_s2: ramp of the drive; the quick stop of the machine file when not given.
    """
    return silent_way_deg(m, m.speed.setting_max_deg_s, delay_ms, brake=brake, dec_deg_s2=dec_deg_s2)


def silent_way_deg(
    m: Machine, speed_deg_s: float, delay_ms: float, *, brake: bool = False, dec_deg_s2: float = 0.0
) -> float:
    """That way from another speed; its sign does not matter."""
    square, linear, constant = _silent_way(m, delay_ms, brake, dec_deg_s2)
    way = square * speed_deg_s**2 + linear * abs(speed_deg_s) + constant
    return way if brake or m.brake.owner == "drive" else way + unbraked_way_deg(m, speed_deg_s, dec_deg_s2)


def unbraked_way_deg(m: Machine, speed_deg_s: float, dec_deg_s2: float = 0.0) -> float:
    """Way of the motor behind a ramp whose torque goes off before its brake has closed, at most.

    A load of frequency w swings behind a ramp of the deceleration a with up to u = 2 a / w, behind one of speed v that
    is over sooner with u sin(w v / 2 a). The motor goes with it for the closing time t, and is thrown to the other side
    of the twist u / w of its gear: u t and 2 u / w, a quarter of a swing apart.
    """
    rate, dec = (
        2.0 * math.pi * m.control.compensation.first_mode_hz,
        dec_deg_s2 or m.virtual_axis.quick_dec_deg_s2,
    )
    part = math.sin(min(0.5 * math.pi, 0.5 * rate * abs(speed_deg_s) / dec))
    return 2.0 * dec / rate * part * math.hypot(m.brake.close_time_ms / 1000.0, 2.0 / rate)


def silent_speed_max_deg_s(
    m: Machine, delay_ms: float, *, brake: bool = False, dec_deg_s2: float = 0.0
) -> float:
    """Highest speed at which that way is within the permitted stopping angle; 0 where there is none."""
    square, linear, constant = _silent_way(m, delay_ms, brake, dec_deg_s2)
    if not math.isfinite(constant):
        return 0.0
    if not brake and m.brake.owner != "drive":
        # As from any speed whose ramp lasts half a swing of the load: a slower one swings less.
        constant += unbraked_way_deg(m, math.inf, dec_deg_s2)
    return _positive_root(square, linear, constant - m.required.stopping_angle_deg)


def ramp_angle_deg(m: Machine, delay_ms: float, dec_deg_s2: float) -> float:
    """Way of a quick stop from the highest setting on a ramp of the drive's own: its brake closes while it stands."""
    return 0.5 / dec_deg_s2 * m.speed.setting_max_deg_s**2 + delay_ms / 1000.0 * m.speed.setting_max_deg_s


def ramp_speed_max_deg_s(m: Machine, delay_ms: float, dec_deg_s2: float) -> float:
    """Highest speed at which that way is within the permitted stopping angle."""
    return _positive_root(0.5 / dec_deg_s2, delay_ms / 1000.0, -m.required.stopping_angle_deg)


def permitted_speed_deg_s(speed_deg_s: float) -> float:
    """A highest speed as people read it: never more, in tenths, or in two digits where it is slower than 1 deg/s."""
    scale = 10.0 ** max(1, 1 - math.floor(math.log10(speed_deg_s))) if speed_deg_s > 0.0 else 1.0
    return math.floor(scale * speed_deg_s) / scale


def _silent_way(m: Machine, delay_ms: float, brake: bool, dec_deg_s2: float) -> tuple[float, float, float]:
    """The way as square, linear and constant part of the speed."""
    delay_s = delay_ms / 1000.0
    if not brake:
        return 0.5 / (dec_deg_s2 or m.virtual_axis.quick_dec_deg_s2), delay_s, 0.0
    # v d + v t + s t^2 / 2 + (v + s t)^2 / 2n: the load drives while the brake closes, then it slows.
    sinking, time_s = sinking_acc_deg_s2(m), m.brake.close_time_ms / 1000.0
    net = braking_dec_deg_s2(m) - sinking
    if net <= 0.0:
        return 0.0, 0.0, math.inf
    sunk = sinking * time_s
    return 0.5 / net, delay_s + time_s + sunk / net, 0.5 * sunk * time_s + sunk**2 / (2.0 * net)


# --- from standstill ----------------------------------------------------------------------------------------
@rule("monitors.standstill_time_ms", SCAN, "brake.close_time_ms", *ROOM, *DRIVEN_AWAY, "brake.torque_nm")
def standstill_time_within_reaction(m: Machine) -> Broken:
    """An axis that its drive drives away from standstill is caught by the brake within the reaction room."""
    speed = _caught_speed_deg_s(m, driven_acc_deg_s2(m))
    if speed is None:
        return None
    most = 1000.0 * speed / driven_acc_deg_s2(m) - m.control.scan_period_ms
    return at_most(m.monitors.standstill_time_ms, most, _CAUGHT)


@rule(
    "monitors.standstill_window_deg", "monitors.standstill_time_ms", SCAN, "brake.close_time_ms",
    *ROOM, *DRIVEN_AWAY, "brake.torque_nm",
)  # fmt: skip
def standstill_window_within_reaction(m: Machine) -> Broken:
    """Driven away from standstill the axis leaves the window so early that the brake catches it within the room."""
    acc, speed = driven_acc_deg_s2(m), _caught_speed_deg_s(m, driven_acc_deg_s2(m))
    if speed is None:
        return None
    left = speed - acc * (m.monitors.standstill_time_ms + m.control.scan_period_ms) / 1000.0
    limit = left**2 / (2.0 * acc)
    return at_most(m.monitors.standstill_window_deg, limit, _CAUGHT) if left >= 0.0 else None


@rule("brake.sag_max_deg", "brake.close_time_ms", *ROOM, *BRAKING)
def sag_within_reaction(m: Machine) -> Broken:
    """A load that sinks after the release of the brake is caught by it within the reaction room."""
    sinking = sinking_acc_deg_s2(m)
    speed = _caught_speed_deg_s(m, sinking)
    if speed is None or sinking == 0.0:
        return None
    return at_most(m.brake.sag_max_deg, speed**2 / (2.0 * sinking), _CAUGHT)


_CAUGHT: Final = (
    "or the brake catches the axis beyond the room that a quick stop leaves of the permitted angle"
)


# --- brake --------------------------------------------------------------------------------------------------
@rule("brake.close_time_ms", "speed.setting_max_deg_s", "required.stopping_angle_deg", *BRAKING)
def brake_stop_within_stopping_angle(m: Machine) -> Broken:
    """Torque off and brake from the highest setting, with 60 ms of reaction, fit the permitted stopping angle."""
    v, permitted, sinking = m.speed.setting_max_deg_s, m.required.stopping_angle_deg, sinking_acc_deg_s2(m)
    net = braking_dec_deg_s2(m) - sinking
    if net <= 0.0:
        return None
    # 0.06 v + v t + s t^2 / 2 + (v + s t)^2 / 2n = A: the load drives while the brake closes, then it slows.
    square = 0.5 * sinking * (1.0 + sinking / net)
    linear = v * (1.0 + sinking / net)
    constant = v * REACTION_S + v**2 / (2.0 * net) - permitted
    most = _positive_root(square, linear, constant)
    why = (
        "or torque off and brake leave the permitted stopping angle; a faster or stronger brake, or go slower"
    )
    return at_most(m.brake.close_time_ms, 1000.0 * most, why)


def driven_acc_deg_s2(m: Machine) -> float:
    """Acceleration of the rigid machine by the torque limit and the eccentric moment of the check together."""
    return _acc_deg_s2(m, motors(m) * m.motor.torque_max_nm) + sinking_acc_deg_s2(m)


def sinking_acc_deg_s2(m: Machine) -> float:
    """Acceleration of the rigid machine by the eccentric moment of the check alone."""
    return _acc_deg_s2(m, m.plant.load.eccentric_check_moment_nm / m.axis.ratio)


def braking_dec_deg_s2(m: Machine) -> float:
    """Deceleration of the rigid machine by the closed brake alone."""
    return _acc_deg_s2(m, m.brake.torque_nm)


def _acc_deg_s2(m: Machine, torque_nm: float) -> float:
    return deg(torque_nm / (rigid_inertia_kg_m2(m) * m.axis.ratio))


def _caught_speed_deg_s(m: Machine, acc_deg_s2: float) -> float | None:
    """Highest speed, reached from standstill, that the brake stops within the room; None for too weak a brake.

    u^2 / 2 acc + u t + s t^2 / 2 + (u + s t)^2 / 2n = room, with t the closing time, s the acceleration by the
    eccentric moment and n what the brake has above it.
    """
    sinking, time_s = sinking_acc_deg_s2(m), m.brake.close_time_ms / 1000.0
    net = braking_dec_deg_s2(m) - sinking
    if net <= 0.0:
        return None
    square = (0.5 / acc_deg_s2 if acc_deg_s2 > 0.0 else 0.0) + 0.5 / net
    linear = time_s * (1.0 + sinking / net)
    constant = 0.5 * sinking * time_s**2 * (1.0 + sinking / net) - reaction_room_deg(m)
    return _positive_root(square, linear, constant)


def _positive_root(square: float, linear: float, constant: float) -> float:
    """Root of `square x^2 + linear x + constant` at or above 0; 0 where there is none. `linear` is above 0."""
    if constant >= 0.0:
        return 0.0
    # This form stays exact when `square` is small or 0.
    return -2.0 * constant / (linear + math.sqrt(linear**2 - 4.0 * square * constant))
