"""The speed test of figure 5: moves long enough to reach each speed, both ways, motor side and load side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gantryctl.accuracy.table import FloatArray
from gantryctl.batch import ClosedLoop, Log
from gantryctl.errors import UsageError
from gantryctl.machine import Machine
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.units import DEG_S_PER_R_MIN, rad
from gantryctl.wiring import gantry_sim, motion_limits, position_law, total_ratio

PAPER_SPEEDS_R_MIN: Final = (0.1, 0.5, 1.0)
CRITERION_DEG_S: Final = 0.01
"""The paper: speed error below this over the whole move. Judged on the motor side."""
CRUISE_S: Final = 15.0
"""Shortest time at the set speed."""
REST_S: Final = 1.0
SETTLE_S: Final = 6.0
_STICK_PART: Final = 0.05  # of the set speed: a load slower than this while it should cruise has stuck
_CURVE_POINTS: Final = 2000


@dataclass(frozen=True, eq=False)
class SpeedCurve:
    """Speeds over time for a figure, thinned out. Arrays of one shape, s and deg/s."""

    time_s: FloatArray
    ref_deg_s: FloatArray
    motor_deg_s: FloatArray
    load_deg_s: FloatArray


@dataclass(frozen=True, eq=False)
class SpeedRun:
    """One move of the speed test; speeds and errors at the gantry, deg/s.

    Attributes:
        speed_deg_s: what was set; sign = direction.
        from_deg, to_deg: the move.
        reached_deg_s: mean motor-side speed while the set-point cruises.
        error_motor_deg_s, error_load_deg_s: largest error over rest, move and settling.
        cruise_error_motor_deg_s, cruise_error_load_deg_s: the same while the set-point cruises.
        stick_slip: the load stood still while it should have cruised.
        duration_s: of the move.
        torque_max_nm: largest motor torque.
    """

    speed_deg_s: float
    from_deg: float
    to_deg: float
    reached_deg_s: float
    error_motor_deg_s: float
    error_load_deg_s: float
    cruise_error_motor_deg_s: float
    cruise_error_load_deg_s: float
    stick_slip: bool
    duration_s: float
    torque_max_nm: float
    curve: SpeedCurve

    @property
    def passed(self) -> bool:
        """Motor-side speed error within the criterion over the whole move, and the speed reached."""
        reached = abs(abs(self.reached_deg_s) - abs(self.speed_deg_s)) <= CRITERION_DEG_S
        return reached and self.error_motor_deg_s <= CRITERION_DEG_S


def speed_test(machine: Machine, speeds_r_min: Sequence[float] = PAPER_SPEEDS_R_MIN) -> list[SpeedRun]:
    """Every speed forward, then back, centred in the travel.

    Raises:
        UsageError: a speed outside the setting range, or one that no move within the travel reaches.
    """
    runs = []
    for speed_r_min in speeds_r_min:
        low, high = _move(machine, speed_r_min * DEG_S_PER_R_MIN)
        speed = speed_r_min * DEG_S_PER_R_MIN
        runs += [run_speed(machine, low, high, speed), run_speed(machine, high, low, speed)]
    return runs


def run_speed(machine: Machine, from_deg: float, to_deg: float, speed_deg_s: float) -> SpeedRun:
    """One move between two angles from standing still, with at most `speed_deg_s`."""
    limits = motion_limits(machine, speed_deg_s)
    plan = plan_move(SetPoint(rad(from_deg), 0.0, 0.0), rad(to_deg), limits)
    loop = ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), rad(from_deg))
    before = loop.run(hold(rad(from_deg)), REST_S)
    log = loop.run(plan, plan.duration + machine.control.scan_period_ms * 1e-3 + SETTLE_S)
    return _evaluate(machine, before, log, (from_deg, to_deg, speed_deg_s, plan.duration))


def _move(machine: Machine, speed_deg_s: float) -> tuple[float, float]:
    """Ends of a move that cruises for `CRUISE_S`, or as long as the travel allows."""
    speed, axis, virtual = machine.speed, machine.axis, machine.virtual_axis
    if not speed.setting_min_deg_s <= speed_deg_s <= speed.setting_max_deg_s + 1e-9:
        raise UsageError(
            f"speed {speed_deg_s / DEG_S_PER_R_MIN:g} r/min: the setting goes from "
            f"{speed.setting_min_deg_s / DEG_S_PER_R_MIN:g} to {speed.setting_max_deg_s / DEG_S_PER_R_MIN:g} r/min"
        )
    ramps = 0.5 * speed_deg_s**2 * (1.0 / virtual.acc_deg_s2 + 1.0 / virtual.dec_deg_s2)
    if virtual.profile == "jerk_limited":
        ramps += speed_deg_s * virtual.acc_deg_s2 / virtual.jerk_deg_s3
    travel = axis.pos_max_deg - axis.pos_min_deg
    if ramps >= travel:
        raise UsageError(
            f"speed {speed_deg_s:g} deg/s needs {ramps:.1f} deg to be reached and left again, the travel is "
            f"{travel:g} deg: raise [virtual_axis] acc_deg_s2 and dec_deg_s2"
        )
    way = min(travel, ramps + speed_deg_s * CRUISE_S)
    middle = 0.5 * (axis.pos_min_deg + axis.pos_max_deg)
    return middle - 0.5 * way, middle + 0.5 * way


def _evaluate(
    machine: Machine, before: Log, log: Log, move: tuple[float, float, float, float]
) -> SpeedRun:
    from_deg, to_deg, speed_deg_s, duration_s = move
    ratio = total_ratio(machine)
    sign = 1.0 if to_deg >= from_deg else -1.0

    def whole(column: str) -> FloatArray:
        return np.degrees(np.concatenate((before[column], log[column])))

    ref, load, motor = whole("vel_ref_rad_s"), whole("vel_load_rad_s"), whole("vel_motor_rad_s") / ratio
    cruise = np.abs(ref) >= speed_deg_s * (1.0 - 1e-9)
    at_speed = cruise if np.any(cruise) else np.abs(ref) >= np.max(np.abs(ref)) * (1.0 - 1e-3)
    reached = float(np.mean(motor[at_speed]))
    thin = slice(None, None, max(1, len(ref) // _CURVE_POINTS))
    time_s = np.arange(len(ref)) * log.period_s
    return SpeedRun(
        speed_deg_s=sign * speed_deg_s,
        from_deg=from_deg,
        to_deg=to_deg,
        reached_deg_s=reached,
        error_motor_deg_s=float(np.max(np.abs(motor - ref))),
        error_load_deg_s=float(np.max(np.abs(load - ref))),
        cruise_error_motor_deg_s=float(np.max(np.abs((motor - ref)[at_speed]))),
        cruise_error_load_deg_s=float(np.max(np.abs((load - ref)[at_speed]))),
        stick_slip=bool(np.any(sign * load[cruise] < _STICK_PART * speed_deg_s)),
        duration_s=duration_s,
        torque_max_nm=float(np.max(np.abs(log["torque_act_nm"]))),
        curve=SpeedCurve(time_s[thin], ref[thin], motor[thin], load[thin]),
    )


__all__ = ["CRITERION_DEG_S", "SpeedCurve", "SpeedRun", "run_speed", "speed_test"]
