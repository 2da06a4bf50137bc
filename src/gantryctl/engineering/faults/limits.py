"""Permitted way from a fault to rest, true motor-side angle, by class and speed."""

from __future__ import annotations

import functools
import math
from bisect import bisect_left
from typing import Final

from gantryctl.engineering.faults.case import ReactionClass
from gantryctl.engineering.stops import StopClass, worst_stop
from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import REACTION_S

_MARGIN: Final = 1.02
_DRIVE_TICK_S: Final = 1e-3
# The load swings on by up to so much after a stop (power/sequence.py).
_SWING_DEG_S: Final = 0.53
STANDSTILL_DEG: Final = 0.35
BRAKE_SLIP_DEG: Final = 0.15
# A refused command and a warning leave the set-point alone: what the load sways at rest.
_REFUSED_DEG: Final = 0.02
# Computed on the plant of the reference gantry (deg/s, deg): torque off and brake, and the same after the time that a
# spoilt encoder takes to be seen, the drive's own loop accelerating meanwhile.
_TORQUE_OFF: Final = ((0.0, STANDSTILL_DEG), (1.0, 0.45), (3.0, 1.4), (6.0, 3.6))
_FEEDBACK: Final = ((0.0, STANDSTILL_DEG), (1.0, 0.8), (3.0, 2.1), (6.0, 4.5))


def limit_deg(machine: Machine, reaction: ReactionClass, speed_deg_s: float) -> float:
    """Permitted way, deg at the gantry; infinite for classes that do not stop the axis in a hurry."""
    speed = abs(speed_deg_s)
    match reaction:
        case ReactionClass.QUICK_STOP:
            return _quick_stop_deg(machine, speed) if speed > 0.0 else STANDSTILL_DEG
        case ReactionClass.DRIVE_DEADLINE:
            # The last command, the deadline, the drive's own period; at 50 ms and scans of 10 ms a little above the
            # 60 ms of every other quick stop.
            seen_s = 1e-3 * (machine.can.rpdo_deadline_ms + machine.control.scan_period_ms) + _DRIVE_TICK_S
            late_s = max(0.0, seen_s - REACTION_S)
            # A brake that nobody works any more by 60FE closes after the drive has taken its torque off: meanwhile
            # the motor goes with the swing of the load.
            free_s = machine.brake.close_time_ms * 1e-3 if machine.brake.owner == "object_60FE" else 0.0
            return _quick_stop_deg(machine, speed) + _MARGIN * (late_s * speed + free_s * _SWING_DEG_S)
        case ReactionClass.TORQUE_OFF:
            return _between(_TORQUE_OFF, speed)
        case ReactionClass.FEEDBACK:
            return _between(_FEEDBACK, speed)
        case ReactionClass.STANDSTILL:
            return STANDSTILL_DEG
        case ReactionClass.BRAKE_SLIP:
            return BRAKE_SLIP_DEG
        case ReactionClass.REFUSED:
            return _REFUSED_DEG
        case ReactionClass.HALT | ReactionClass.WARNING | ReactionClass.NONE:
            return math.inf


# Each answer takes four simulated stops.
@functools.lru_cache(maxsize=64)
def _quick_stop_deg(machine: Machine, speed_deg_s: float) -> float:
    stop = worst_stop(machine, StopClass.QUICK, speed_deg_s)
    return (REACTION_S * speed_deg_s + stop.angle_deg) * _MARGIN


def _between(points: tuple[tuple[float, float], ...], speed: float) -> float:
    """Straight lines between the points, and on beyond the last."""
    at = min(max(bisect_left(points, (speed, 0.0)), 1), len(points) - 1)
    (low, first), (high, second) = points[at - 1], points[at]
    return first + (second - first) * (speed - low) / (high - low)
