"""A quick stop with the position loop open, watched scan by scan: its way, its deceleration, and who ended it."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from gantryctl.commissioning.open_loop_axis import OpenLoopAxis, state_name
from gantryctl.image import DriveRequest, DriveState
from gantryctl.machine import Machine
from gantryctl.machine.derived import rigid_stop
from gantryctl.machine.places import reach_deg
from gantryctl.machine.rules.reaction import REACTION_S, permitted_speed_deg_s

# A command acts at the next SYNC and shows at the one after; two scans more are granted (decision 0012).
_SHOWN_SCANS: Final = 4
_END_S: Final = 1.0
# While it turns faster than this part of its speed, or than this, a drive must still be in its quick stop.
_TURNING_PART: Final = 0.25
_TURNING_DEG_S: Final = 0.1
# Part of the speed between which the deceleration is fitted: begin and end of the ramp are rounded.
_FITTED: Final = (0.9, 0.2)
_LEAST_SAMPLES: Final = 3
# Of a trial stop: acceleration to its speed, time at it, and what it takes of the travel with both ramps.
_ACC_DEG_S2: Final = 1.0
CRUISE_S: Final = 0.5
_WAY_DEG: Final = 10.0
# Of half of the travel: begun in its middle, a trial stop stays within it.
_TRAVEL_PART: Final = 0.8


class QuickStop(NamedTuple):
    """One measured quick stop.

    Attributes:
        way_deg: from the command to rest, motor side, without a sign.
        dec_deg_s2: deceleration of the ramp; NaN where it is too short for the scans to show it.
        uncertainty_deg_s2: of the deceleration, by one scan in the time of the ramp.
    """

    way_deg: float
    dec_deg_s2: float
    uncertainty_deg_s2: float


def trial_acc_deg_s2(machine: Machine) -> float:
    """Acceleration to the speed of a trial stop: no harder than the ramp of a jog key that is let go."""
    return min(_ACC_DEG_S2, machine.virtual_axis.jog_release_dec_deg_s2)


def trial_speed_deg_s(machine: Machine) -> float:
    """Highest speed of a trial stop: that of the axis, or the one that is reached, held and stopped within 10 deg.

    Of a short travel within 0.8 of its half.
    """
    low, high = reach_deg(machine)
    way_deg = min(_WAY_DEG, 0.5 * _TRAVEL_PART * (high - low))
    ramps = 0.5 / trial_acc_deg_s2(machine) + 0.5 / machine.virtual_axis.quick_dec_deg_s2
    held_s = CRUISE_S + REACTION_S
    fits = (math.sqrt(held_s * held_s + 4.0 * ramps * way_deg) - held_s) / (2.0 * ramps)
    return min(machine.speed.setting_max_deg_s, permitted_speed_deg_s(fits))


def permitted_way_deg(speed_deg_s: float, dec_deg_s2: float, delay_s: float = 0.0) -> float:
    """Way of a stop that the proofs permit: delay and ramp, and the reaction that every computed stop allows for."""
    return computed_way_deg(speed_deg_s, dec_deg_s2, delay_s) + abs(speed_deg_s) * REACTION_S


def computed_way_deg(speed_deg_s: float, dec_deg_s2: float, delay_s: float = 0.0) -> float:
    """Way of a stop: full speed for the delay, then the ramp of a rigid body."""
    speed = abs(speed_deg_s)
    return speed * delay_s + rigid_stop(speed, dec_deg_s2, float("inf"))[0]


def measure_quick_stop(axis: OpenLoopAxis, speed_deg_s: float, dec_deg_s2: float) -> QuickStop:
    """Stop from a speed that the axis has, by the drive's own ramp.

    Args:
        dec_deg_s2: deceleration that permits the way.

    Raises:
        AlarmStop: too long, not obeyed, or left with the axis still turning; torque off and brake were commanded then.
    """
    speed, begun = abs(speed_deg_s), axis.angle_deg
    most = permitted_way_deg(speed, dec_deg_s2)
    turning = max(_TURNING_DEG_S, _TURNING_PART * speed)
    speeds: list[float] = []
    for k in range(round((speed / dec_deg_s2 + _END_S) / axis.period_s)):
        state = axis.scan(DriveRequest.QUICK_STOP).state
        now = abs(axis.speed_deg_s)
        way = abs(axis.angle_deg - begun)
        if not way <= most:
            axis.stop_for(
                f"quick stop from {speed:g} deg/s is too long: {way:.3f} deg and still at {now:.2f} deg/s, {most:.3f} "
                "deg are permitted"
            )
        if k > _SHOWN_SCANS and state is DriveState.OPERATION_ENABLED:
            axis.stop_for(f"quick stop from {speed:g} deg/s is not obeyed: still operation enabled")
        if state not in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE) and now > turning:
            axis.stop_for(
                f"the drive left its quick stop for {state_name(state)} at {now:.2f} deg/s: 605A and its ramp are not "
                "obeyed"
            )
        speeds.append(now)
    dec = _deceleration(speeds, speed, axis.period_s)
    ramp_s = (_FITTED[0] - _FITTED[1]) * speed / dec
    return QuickStop(abs(axis.angle_deg - begun), dec, dec * axis.period_s / ramp_s)


def _deceleration(speeds: list[float], speed: float, period_s: float) -> float:
    high, low = (part * speed for part in _FITTED)
    shown = np.array(speeds)
    below = np.flatnonzero(shown < high)
    ended = np.flatnonzero(shown < low)
    if not len(below) or not len(ended) or ended[0] - below[0] < _LEAST_SAMPLES:
        return float("nan")
    ramp = slice(int(below[0]), int(ended[0]))
    times = period_s * np.arange(len(shown))[ramp]
    return float(-np.polyfit(times, shown[ramp], 1)[0])
