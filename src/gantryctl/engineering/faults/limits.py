"""Permitted way from a fault to rest, true motor-side angle, by class and speed.

Of any axis: the time in which its monitors see the fault, at the speed of the motion, and the brake stop of its own
brake from there, on its full plant (`engineering.stops`), and 2 %. For the reference gantry ways are specified, which
hold there instead. Its brake may close in 200 ms and hold 380 N m, where its machine file has 150 ms and 400 N m.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from gantryctl.engineering.faults.case import FaultCase, ReactionClass, SeenBy
from gantryctl.engineering.faults.injection import Injection
from gantryctl.engineering.faults.physics import friction_nm
from gantryctl.engineering.stops import StopClass, worst_stop
from gantryctl.engineering.stops.run import StopResult
from gantryctl.machine import Machine
from gantryctl.machine.reference import is_reference_machine
from gantryctl.machine.rules.parts import motion_torque_nm
from gantryctl.machine.rules.reaction import REACTION_S, driven_acc_deg_s2, sinking_acc_deg_s2
from gantryctl.units import deg
from gantryctl.wiring.program import axis_settings
from gantryctl.wiring.simulator import eccentric_moment_nm, plant_params

_MARGIN: Final = 1.02
_MS: Final = 1e-3
_DRIVE_TICK_S: Final = 1e-3
# Load that swings at rest already, in parts of the highest speed (0.53 of 6 deg/s, power/sequence.py), with what the
# twist of its gear adds. E9 with a brake worked by 60FE took up to 0.262 deg from 1 deg/s (plants within 20 %), where
# the swing alone permits 0.240 and both 0.274.
_FREE_SHARE: Final = math.sqrt(2.0) * 0.09
# A refused command leaves the set-point alone: what the load sways at rest, in parts of the required angle.
_REFUSED_SHARE: Final = 0.2
# One scan sees it, and one brings the command to the drive.
_SCANS: Final = 2.0
# Specified for the reference gantry, deg/s and deg: torque off and brake, and the same after the time that a spoilt
# encoder takes to be seen, the drive's own loop accelerating meanwhile. They stand above what is computed here.
_TORQUE_OFF: Final = ((0.0, 0.35), (1.0, 0.45), (3.0, 1.4), (6.0, 3.6))
_FEEDBACK: Final = ((0.0, 0.35), (1.0, 0.8), (3.0, 2.1), (6.0, 4.5))
_SPECIFIED: Final = {
    ReactionClass.TORQUE_OFF: _TORQUE_OFF,
    ReactionClass.FEEDBACK: _FEEDBACK,
    ReactionClass.STANDSTILL: ((0.0, 0.35), (6.0, 0.35)),
    ReactionClass.BRAKE_SLIP: ((0.0, 0.15), (6.0, 0.15)),
}
# Torque again after a brake that slips: enable, and the drive's own sequence.
_HOLD_S: Final = 0.5
# How long a winding is too hot before it is believed (`program.monitors.thermal`).
_HOT_S: Final = 0.1
# Friction grows within 0.2 s to this part of the rated torque beyond what any load asks for (B3); what stops the motion
# is a mean over half a second above that part of it for 1 s, looked at each 50 ms (`program.monitors.drag`).
_DRAG_GROWS_S: Final = 0.2
_DRAG_SHARE: Final = 0.52
_DRAG_STOPS_SHARE: Final = 0.30
_DRAG_MEAN_S: Final = 0.5
_DRAG_LASTS_S: Final = 1.05
# How long the ramp of a quick stop must be left (`program.power.ramp_watch`).
_LEFT_RAMP_S: Final = 0.050


def reaction_of(machine: Machine, case: FaultCase, injections: Sequence[Injection]) -> ReactionClass:
    """Class of a case on this machine, injected so.

    A controller that is late by the deadline of its drive finds that it has stopped by itself: F2 at scans of 10 ms.
    A drive in the NMT state STOPPED takes no command of torque off any more, by PDO or SDO, and comes to rest on its
    own ramp, which may be longer than the way of the brake (an azimuth drive, 0.342 of 0.308 deg: E18b, seed 6091 of
    other axes on the bus). What is specified for the reference gantry has that ramp in.
    """
    late_ms = max((1e3 * each.values["late_s"] for each in injections if each.kind == "stall"), default=0.0)
    if stops_its_telegrams(injections) and not is_reference_machine(machine):
        return ReactionClass.DRIVE_DEADLINE if case.reaction is ReactionClass.TORQUE_OFF else case.reaction
    passed = machine.on_bus and late_ms + machine.control.scan_period_ms >= machine.can.rpdo_deadline_ms
    return (
        ReactionClass.DRIVE_DEADLINE
        if passed and case.reaction is ReactionClass.QUICK_STOP
        else case.reaction
    )


def stops_its_telegrams(injections: Sequence[Injection]) -> bool:
    """The drive goes to the NMT state STOPPED; in PRE-OPERATIONAL it still takes its torque off by SDO."""
    return any(
        (each.kind == "nmt" and each.values["state"] == "STOPPED")
        or (each.kind == "foreign_nmt" and each.values["command"] == "stop")
        for each in injections
    )


def unreached(each: Injection) -> bool:
    """No command reaches the drive from now on."""
    return each.kind in ("drive_silent", "rpdo_lost")


def limit_deg(
    machine: Machine, reaction: ReactionClass, speed_deg_s: float, seen_by: SeenBy = SeenBy.CLASS
) -> float:
    """Permitted way, deg at the gantry; infinite for classes that do not stop the axis in a hurry.

    Args:
        seen_by: the monitor that sees the fault, where it takes longer than its class. The ways specified for the
            reference gantry hold for every monitor of torque off.
    """
    speed = abs(speed_deg_s)
    if reaction is ReactionClass.DRIVE_DEADLINE and machine.on_bus and machine.can.output_place("watchdog"):
        # The watchdog relay of a controller that no longer reaches its drive takes the torque out of the drive's ramp,
        # wherever that is, and the brake takes over (E9: of the class torque off).
        own = computed_deg(machine, reaction, speed, seen_by)
        return max(own, limit_deg(machine, ReactionClass.TORQUE_OFF, speed, seen_by))
    if reaction in _SPECIFIED and is_reference_machine(machine):
        speeds, ways = zip(*_SPECIFIED[reaction], strict=True)
        return float(np.interp(speed, speeds, ways))
    return computed_deg(machine, reaction, speed, seen_by)


def computed_deg(
    machine: Machine, reaction: ReactionClass, speed: float, seen_by: SeenBy = SeenBy.CLASS
) -> float:
    """The same from the axis alone, whatever is specified; `speed` is at least 0 deg/s."""
    seen_s = _seen_s(machine, seen_by)
    match reaction:
        # No stop begins at rest: what may move is the drive, until it is seen.
        case ReactionClass.QUICK_STOP | ReactionClass.DRIVE_DEADLINE | ReactionClass.FEEDBACK if speed == 0.0:
            return standstill_deg(machine)
        case ReactionClass.QUICK_STOP:
            return _quick_stop_deg(machine, speed) + speed * max(0.0, seen_s - REACTION_S)
        case ReactionClass.DRIVE_DEADLINE:
            # At 50 ms and scans of 10 ms a little above the 60 ms of every other quick stop.
            late_s = max(0.0, _deadline_missed_s(machine) - REACTION_S)
            # A brake that is not the drive's closes after the drive has taken its torque off: nobody works it by 60FE
            # any more, or the controller closes it when it misses the drive.
            free_deg = _free_deg(machine, speed) if machine.brake.owner != "drive" else 0.0
            return _quick_stop_deg(machine, speed) + _MARGIN * (late_s * speed + free_deg)
        case ReactionClass.TORQUE_OFF:
            # Where the drive has lost its torque the eccentric moment of the check has the axis meanwhile; one whose
            # heartbeat alone is lost goes on as it is told.
            obeys = seen_by is SeenBy.HEARTBEAT and speed > 0.0
            sinks = 0.0 if obeys else sinking_acc_deg_s2(machine)
            way = _driven_deg(machine, speed, sinks, seen_s)
            return max(way, standstill_deg(machine))
        case ReactionClass.FEEDBACK:
            if seen_by is SeenBy.CLASS:
                return _driven_deg(machine, speed, driven_acc_deg_s2(machine), _spoilt_s(machine))
            return _driven_deg(machine, speed, 0.0, seen_s)
        case ReactionClass.STANDSTILL:
            return standstill_deg(machine)
        case ReactionClass.BRAKE_SLIP:
            return brake_slip_deg(machine)
        case ReactionClass.REFUSED:
            return _REFUSED_SHARE * machine.required.angle_deg
        case ReactionClass.HALT:
            return (speed * seen_s + _jog_release_deg(machine, speed)) * _MARGIN
        case ReactionClass.WARNING | ReactionClass.NONE:
            return math.inf


def standstill_deg(machine: Machine) -> float:
    """Way of an axis that stands when its drive runs away: 0.20 deg on the reference gantry."""
    return _driven_deg(machine, 0.0, driven_acc_deg_s2(machine), _spoilt_s(machine))


def _jog_release_deg(machine: Machine, speed: float) -> float:
    """Way of the jerk-limited ramp: half of the speed for its time. A low speed never reaches its deceleration."""
    dec, jerk = machine.virtual_axis.jog_release_dec_deg_s2, machine.virtual_axis.jog_release_jerk_deg_s3
    ramp_s = speed / dec + dec / jerk if speed >= dec**2 / jerk else 2.0 * math.sqrt(speed / jerk)
    return 0.5 * speed * ramp_s


def held_up_deg(machine: Machine, speed_deg_s: float, held_s: float) -> float:
    """Way of an axis whose encoder or sign is spoilt while its controller stands still.

    The drive goes on with its last command, by all of its torque. The monitors count scans, of which there are none
    meanwhile, so their time begins when the controller makes scans again: then alone torque off and the brake can
    come. A drive on a bus does not wait for it: deadline, ramp, and its brake, behind which it takes the torque off.

    Args:
        speed_deg_s: where the controller began to stand still.
        held_s: for how long; infinite for one that does not come back, on a bus.
    """
    speed = abs(speed_deg_s)
    driven_s = held_s + _spoilt_s(machine)
    if machine.on_bus:
        driven_s = min(driven_s, goes_by_itself_s(machine, speed))
    return _driven_deg(machine, speed, driven_acc_deg_s2(machine), driven_s)


def goes_by_itself_s(machine: Machine, speed_deg_s: float) -> float:
    """Time in which a drive that no command reaches takes its torque off: deadline, ramp, and its brake before that."""
    ramp_s = abs(speed_deg_s) / machine.virtual_axis.quick_dec_deg_s2
    return _deadline_missed_s(machine) + ramp_s + machine.brake.close_time_ms * _MS


def runs_out_deg(machine: Machine, speed_deg_s: float, torque_share: float) -> float:
    """Way of a drive that no command reaches and whose own ramp has a part of its torque; friction helps.

    Nobody can end it sooner: the brake of such a drive closes at the end of its ramp. The load pulls as far as it can;
    where it drives the axis on the way is infinite.
    """
    speed = abs(speed_deg_s)
    torque_nm = torque_share * machine.motor.torque_max_nm + friction_nm(machine)
    torque_nm -= abs(eccentric_moment_nm(machine)) / machine.axis.ratio
    if torque_nm <= 0.0:
        return math.inf
    dec_deg_s2 = deg(torque_nm * machine.axis.ratio / _inertia_kg_m2(machine))
    return (speed * _deadline_missed_s(machine) + 0.5 * speed**2 / dec_deg_s2) * _MARGIN


def brake_slip_deg(machine: Machine) -> float:
    """Way of a load that its brake lets go, until torque holds it: 0.16 deg on the reference gantry."""
    sag = machine.brake.sag_max_deg
    acc = deg(abs(eccentric_moment_nm(machine)) / _inertia_kg_m2(machine))
    fall_s = math.sqrt(2.0 * sag / acc) + _HOLD_S if acc > 0.0 else 0.0
    return 2.0 * sag + 0.5 * acc * fall_s**2


def _deadline_missed_s(machine: Machine) -> float:
    """From the last command until the drive stops by itself: a scan, the deadline, the drive's own period."""
    return _MS * (machine.can.rpdo_deadline_ms + machine.control.scan_period_ms) + _DRIVE_TICK_S


def _inertia_kg_m2(machine: Machine) -> float:
    plant = plant_params(machine)
    return plant.inertia_load_kg_m2 + plant.ratio**2 * plant.inertia_motor_kg_m2


def _seen_s(machine: Machine, seen_by: SeenBy) -> float:
    """From the fault until torque off or the ramp is commanded."""
    monitors, scans_s = machine.monitors, _SCANS * machine.control.scan_period_ms * _MS
    match seen_by:
        case SeenBy.CLASS:
            return REACTION_S
        case SeenBy.SATURATION:
            return monitors.torque_saturation_time_ms * _MS + scans_s
        case SeenBy.BRAKE_CONTACT:
            return monitors.brake_feedback_time_ms * _MS + REACTION_S
        case SeenBy.WINDING:
            return REACTION_S + _HOT_S
        case SeenBy.DRAG:
            return REACTION_S + _drags_s(machine)
        case SeenBy.HEARTBEAT:
            return machine.can.heartbeat_timeout_ms * _MS + scans_s
        case SeenBy.RAMP:
            above_s = monitors.velocity_deviation_deg_s / machine.virtual_axis.quick_dec_deg_s2
            return REACTION_S + above_s + _LEFT_RAMP_S + scans_s


def _drags_s(machine: Machine) -> float:
    """Until a drag stops the motion: the mean begins below nothing, by any load and by what helps the motion.

    An azimuth dish whose wind helps it begins at -0.63 of its rated torque: 1.99 s, and 1.9 s in a run.
    """
    plant = machine.plant
    helps_nm = abs(eccentric_moment_nm(machine)) + plant.wind.moment_nm * plant.switches.wind
    before_nm = friction_nm(machine) - helps_nm / machine.axis.ratio - motion_torque_nm(machine)
    begins = min(0.0, before_nm / machine.motor.torque_rated_nm)
    passes_s = _DRAG_MEAN_S * math.log((_DRAG_SHARE - begins) / (_DRAG_SHARE - _DRAG_STOPS_SHARE))
    return 0.5 * _DRAG_GROWS_S + passes_s + _DRAG_LASTS_S


def _free_deg(machine: Machine, speed: float) -> float:
    """Way of a motor without torque, from the end of its ramp until its brake has closed.

    It goes with the load, whose swing of speed u has twisted the gear by u / w at most, w the frequency of the load
    behind a motor that stands; the light rotor is thrown to the other side of that twist, twice as far. Speed and twist
    are a quarter of a swing apart: u t and 2 u / w are largest together as the root of their squares. A gantry of
    1.7 Hz with a ramp of 13.5 deg/s2 swings with 1.1 deg/s behind a ramp from 1.35 deg/s, and goes 0.26 deg (seed 7055
    of other axes on the bus).
    """
    free_s = machine.brake.close_time_ms * _MS
    least_deg = free_s * _FREE_SHARE * machine.speed.setting_max_deg_s
    plant = plant_params(machine)
    if plant.rigid:
        return least_deg
    twists_s = 2.0 * math.sqrt(plant.inertia_load_kg_m2 / plant.stiffness_1_nm_per_rad)
    swing_deg_s = _quick_stop(machine, speed).load_swing_deg_s
    return max(least_deg, swing_deg_s * math.hypot(free_s, twists_s))


def _spoilt_s(machine: Machine) -> float:
    """Until a drive with a spoilt encoder or sign is seen: it drives away by all its torque, or its count stands."""
    monitors = machine.monitors
    deviates_s = monitors.velocity_deviation_deg_s / driven_acc_deg_s2(machine)
    frozen_s = axis_settings(machine).monitors.encoder_frozen_time_s
    seen_s = max(deviates_s + monitors.velocity_deviation_time_ms * _MS, frozen_s)
    return seen_s + _SCANS * machine.control.scan_period_ms * _MS


def _driven_deg(machine: Machine, speed_deg_s: float, acc_deg_s2: float, seen_s: float) -> float:
    """Way of an axis that is driven on by this acceleration until it is seen, and of the brake stop from there."""
    driven_deg = speed_deg_s * seen_s + 0.5 * acc_deg_s2 * seen_s**2
    return (driven_deg + _brake_stop_deg(machine, speed_deg_s + acc_deg_s2 * seen_s)) * _MARGIN


# Each answer takes four simulated stops.
@functools.lru_cache(maxsize=256)
def _brake_stop_deg(machine: Machine, speed_deg_s: float) -> float:
    return worst_stop(machine, StopClass.BRAKE, speed_deg_s).angle_deg


@functools.lru_cache(maxsize=256)
def _quick_stop(machine: Machine, speed_deg_s: float) -> StopResult:
    return worst_stop(machine, StopClass.QUICK, speed_deg_s)


def _quick_stop_deg(machine: Machine, speed_deg_s: float) -> float:
    return (REACTION_S * speed_deg_s + _quick_stop(machine, speed_deg_s).angle_deg) * _MARGIN
