"""Permitted way from a fault to rest, true motor-side angle, by class and speed."""

from __future__ import annotations

import functools
import math
from typing import Final

import numpy as np

from gantryctl.engineering.faults.case import ReactionClass
from gantryctl.engineering.stops import StopClass, worst_stop
from gantryctl.machine import Machine
from gantryctl.machine.reference import is_reference_machine
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.units import deg
from gantryctl.wiring.simulator import eccentric_moment_nm, plant_params

_MARGIN: Final = 1.02
_DRIVE_TICK_S: Final = 1e-3
# The load swings on by up to so much of the highest speed after a stop: 0.53 of 6 deg/s (power/sequence.py).
_SWING_SHARE: Final = 0.09
# A refused command leaves the set-point alone: what the load sways at rest, in parts of the required angle.
_REFUSED_SHARE: Final = 0.2
# From the fault to torque off: the slowest of these monitors at scans of 10 ms, and the way of the command.
_OFF_S: Final = 0.17
# A drive whose encoder or sign is spoilt accelerates by all its torque until it is seen.
_SPOILT_S: Final = 0.085
# What is seen by a following error has come so many times as far as trips at rest.
_SEEN: Final = 3.0
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


def limit_deg(machine: Machine, reaction: ReactionClass, speed_deg_s: float) -> float:
    """Permitted way, deg at the gantry; infinite for classes that do not stop the axis in a hurry."""
    speed = abs(speed_deg_s)
    if reaction in _SPECIFIED and is_reference_machine(machine):
        speeds, ways = zip(*_SPECIFIED[reaction], strict=True)
        return float(np.interp(speed, speeds, ways))
    return computed_deg(machine, reaction, speed)


def computed_deg(machine: Machine, reaction: ReactionClass, speed: float) -> float:
    """The same from the axis alone, whatever is specified; `speed` is at least 0 deg/s."""
    match reaction:
        case ReactionClass.QUICK_STOP:
            return _quick_stop_deg(machine, speed) if speed > 0.0 else standstill_deg(machine)
        case ReactionClass.DRIVE_DEADLINE:
            # The last command, the deadline, the drive's own period; at 50 ms and scans of 10 ms a little above the
            # 60 ms of every other quick stop.
            seen_s = 1e-3 * (machine.can.rpdo_deadline_ms + machine.control.scan_period_ms) + _DRIVE_TICK_S
            late_s = max(0.0, seen_s - REACTION_S)
            # A brake that nobody works any more by 60FE closes after the drive has taken its torque off: meanwhile
            # the motor goes with the swing of the load.
            free_s = machine.brake.close_time_ms * 1e-3 if machine.brake.owner == "object_60FE" else 0.0
            return _quick_stop_deg(machine, speed) + _MARGIN * (
                late_s * speed + free_s * _SWING_SHARE * machine.speed.setting_max_deg_s
            )
        case ReactionClass.TORQUE_OFF:
            return max(_torque_off_deg(machine, speed), standstill_deg(machine))
        case ReactionClass.FEEDBACK:
            return _torque_off_deg(machine, speed + _runaway_deg_s(machine))
        case ReactionClass.STANDSTILL:
            return standstill_deg(machine)
        case ReactionClass.BRAKE_SLIP:
            return brake_slip_deg(machine)
        case ReactionClass.REFUSED:
            return _REFUSED_SHARE * machine.required.angle_deg
        case ReactionClass.HALT | ReactionClass.WARNING | ReactionClass.NONE:
            return math.inf


def standstill_deg(machine: Machine) -> float:
    """Way of an axis that stands when its drive runs away: 0.36 deg on the reference gantry."""
    return _torque_off_deg(machine, _runaway_deg_s(machine))


def brake_slip_deg(machine: Machine) -> float:
    """Way of a load that its brake lets go, until torque holds it: 0.16 deg on the reference gantry."""
    sag = machine.brake.sag_max_deg
    acc = deg(abs(eccentric_moment_nm(machine)) / _inertia_kg_m2(machine))
    fall_s = math.sqrt(2.0 * sag / acc) + _HOLD_S if acc > 0.0 else 0.0
    return 2.0 * sag + 0.5 * acc * fall_s**2


def _inertia_kg_m2(machine: Machine) -> float:
    plant = plant_params(machine)
    return plant.inertia_load_kg_m2 + plant.ratio**2 * plant.inertia_motor_kg_m2


def _runaway_deg_s(machine: Machine) -> float:
    """Speed that a drive adds by all its torque, with the moment of the check, before it is seen."""
    torque_nm = (
        machine.motor.torque_max_nm * machine.axis.ratio + machine.plant.load.eccentric_check_moment_nm
    )
    return _SPOILT_S * deg(torque_nm / _inertia_kg_m2(machine))


@functools.lru_cache(maxsize=256)
def _torque_off_deg(machine: Machine, speed_deg_s: float) -> float:
    stop = worst_stop(machine, StopClass.BRAKE, speed_deg_s)
    seen_deg = _SEEN * machine.monitors.following_error_base_deg
    return (_OFF_S * speed_deg_s + stop.angle_deg) * _MARGIN + seen_deg


# Each answer takes four simulated stops.
@functools.lru_cache(maxsize=64)
def _quick_stop_deg(machine: Machine, speed_deg_s: float) -> float:
    stop = worst_stop(machine, StopClass.QUICK, speed_deg_s)
    return (REACTION_S * speed_deg_s + stop.angle_deg) * _MARGIN
