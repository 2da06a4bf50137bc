"""The speed test: moves long enough to reach each speed, both ways, motor side and load side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.accuracy.procedure.plan import speeds_to_test, stretch_to_test_deg
from gantryctl.engineering.accuracy.report.report import LoadSpeedBy, SpeedCurves, SpeedRun
from gantryctl.engineering.accuracy.table import Direction, FloatArray
from gantryctl.engineering.batch import (
    ClosedLoop,
    Leg,
    Log,
    Runner,
    alone,
    expected,
    in_lockstep,
    outcome,
)
from gantryctl.engineering.report.origin import origin_of
from gantryctl.machine import Machine, required_speed_error
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.operation.run import AxisRun
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.trace.table import Trace
from gantryctl.units import rad
from gantryctl.wiring.compensation import compensation
from gantryctl.wiring.program import motion_limits, position_law, ramps_deg
from gantryctl.wiring.simulator import gantry_sim

# Shortest time at the set speed.
CRUISE_S: Final = 15.0
REST_S: Final = 1.0
SETTLE_S: Final = 6.0
# On either side of a scan.
_DIFFERENCE_S: Final = 0.02
# Of the set speed: a load slower than this while it should cruise has stuck.
_STICK_PART: Final = 0.05
_CURVE_POINTS: Final = 2000
_COLUMNS: Final = ("vel_ref_rad_s", "vel_motor_rad_s", "vel_load_rad_s")


def speed_test(machine: Machine, speeds_deg_s: Sequence[float] = ()) -> list[SpeedRun]:
    """Every speed forward, then back, centred in the travel.

    Args:
        speeds_deg_s: none for those of the machine (`procedure.plan`).

    Raises:
        UsageError: a speed outside the setting range, or one that no move within the travel reaches.
    """
    return expected(speed_tests([machine], speeds_deg_s))[0]


def speed_tests(
    machines: Sequence[Machine], speeds_deg_s: Sequence[float] = ()
) -> list[list[SpeedRun] | Exception]:
    """The same of several machines side by side; an exception where one cannot be tested."""
    moves = [outcome(partial(_moves, machine, speeds_deg_s)) for machine in machines]
    possible = {k: own for k, own in enumerate(moves) if not isinstance(own, Exception)}
    # The first moves of all machines, then the second ones: moves of one length go well together.
    places = sorted((number, k) for k, own in possible.items() for number in range(len(own)))
    runs = in_lockstep([partial(_run_speed, *possible[k][number]) for number, k in places])
    at = dict(zip(places, runs, strict=True))
    return [
        own
        if isinstance(own, Exception)
        else outcome(partial(expected, [at[number, k] for number in range(len(own))]))
        for k, own in enumerate(moves)
    ]


def _moves(machine: Machine, speeds_deg_s: Sequence[float]) -> list[tuple[Machine, float, float, float]]:
    """Machine, both ends and speed of every move."""
    moves = []
    for speed in speeds_to_test(machine, speeds_deg_s):
        low, high = _move(machine, speed)
        moves += [(machine, low, high, speed), (machine, high, low, speed)]
    return moves


def speed_test_on(run: AxisRun, speeds_deg_s: Sequence[float] = ()) -> list[SpeedRun]:
    """The same on a machine under power, from what its drive reports at every scan; the load by an encoder on the ring.

    Args:
        run: under power, with a `MemoryRecorder`.
        speeds_deg_s: none for those of the machine.

    Raises:
        UsageError: as of `speed_test`. CommandRefused: a speed that the machine may not have.
        AlarmStop: an alarm stopped the axis.
    """
    machine, recorder = run.machine, run.engine.recorder
    assert isinstance(recorder, MemoryRecorder)
    # Before anything moves: every speed must fit into the travel.
    ways = [(speed, *_move(machine, speed)) for speed in speeds_to_test(machine, speeds_deg_s)]
    runs = []
    for speed, low, high in ways:
        run.move(low)
        run.follow(SETTLE_S)
        for move in ((low, high), (high, low)):
            recorder.forget()
            run.follow(REST_S)
            run.move(move[1], speed)
            run.follow(SETTLE_S)
            trace = recorder.trace()
            speeds = _Speeds(
                run.engine.period_s,
                np.degrees(trace["vel_ref_rad_s"]),
                np.degrees(trace["vel_act_rad_s"]),
                _by_ring(machine, trace, run.engine.period_s),
            )
            by = LoadSpeedBy.NOTHING if speeds.load_deg_s is None else LoadSpeedBy.RING
            found = _evaluate(machine, speeds, move, speed)
            runs.append(replace(found, origin=origin_of(machine), load_by=by))
    return runs


def speed_test_s(machine: Machine, speeds_deg_s: Sequence[float]) -> float:
    """Axis time that the test on a machine under power takes, about, s: each speed both ways, and the way there."""
    seconds = 0.0
    for speed in speeds_deg_s:
        low, high = _move(machine, speed)
        ramp_s = speed / machine.virtual_axis.acc_deg_s2
        seconds += 2.0 * (REST_S + (high - low) / speed + ramp_s + SETTLE_S)
        seconds += (high - low) / machine.speed.setting_max_deg_s + SETTLE_S
    return seconds


def _by_ring(machine: Machine, trace: Trace, period_s: float) -> FloatArray | None:
    """Speed of the ring against its base, deg/s: by differences over 40 ms; None without an encoder that shows it.

    Steps and noise of 2^26 counts are 5e-6 deg, 3e-4 deg/s; of a swing of 2 Hz the differences show 99 %.
    """
    if machine.can.load_encoder.source == "none":
        return None
    ring = np.degrees(trace["pos_ring_rad"])
    n = max(1, round(_DIFFERENCE_S / period_s))
    rows = np.arange(len(ring))
    later, earlier = np.minimum(rows + n, len(ring) - 1), np.maximum(rows - n, 0)
    speed: FloatArray = (ring[later] - ring[earlier]) / ((later - earlier) * period_s)
    return speed if np.all(np.isfinite(speed)) else None


def run_speed(machine: Machine, from_deg: float, to_deg: float, speed_deg_s: float) -> SpeedRun:
    """One move between two angles from standing still, with at most `speed_deg_s`."""
    return _run_speed(machine, from_deg, to_deg, speed_deg_s, alone)


def _run_speed(machine: Machine, from_deg: float, to_deg: float, speed_deg_s: float, run: Runner) -> SpeedRun:
    limits = motion_limits(machine, speed_deg_s)
    plan = plan_move(SetPoint(rad(from_deg), 0.0, 0.0), rad(to_deg), limits)
    loop = ClosedLoop.standing_at(
        gantry_sim(machine), position_law(machine), rad(from_deg), compensation(machine)
    )
    move_s = plan.duration + machine.control.scan_period_ms * 1e-3 + SETTLE_S
    log = run(loop, [Leg(hold(rad(from_deg)), REST_S), Leg(plan, move_s)], _COLUMNS)
    return _evaluate(machine, _of_log(machine, log), (from_deg, to_deg), speed_deg_s)


def _move(machine: Machine, speed_deg_s: float) -> tuple[float, float]:
    """Ends of a move that cruises for `CRUISE_S`, or as long as the travel allows."""
    least, most = stretch_to_test_deg(machine)
    travel, ramps, middle = most - least, ramps_deg(machine, speed_deg_s), 0.5 * (least + most)
    way = min(travel, ramps + speed_deg_s * CRUISE_S)
    return middle - 0.5 * way, middle + 0.5 * way


class _Speeds(NamedTuple):
    """One move, a row a scan, at the gantry; the load's speed is None where nothing measures it."""

    period_s: float
    ref_deg_s: FloatArray
    motor_deg_s: FloatArray
    load_deg_s: FloatArray | None


def _of_log(machine: Machine, log: Log) -> _Speeds:
    ref, motor, load = (np.degrees(log[column]) for column in _COLUMNS)
    return _Speeds(log.period_s, ref, motor / machine.axis.ratio, load)


def _evaluate(machine: Machine, speeds: _Speeds, move: tuple[float, float], speed_deg_s: float) -> SpeedRun:
    direction = Direction.CCW if move[1] >= move[0] else Direction.CW
    period_s, ref, motor, load = speeds
    cruise = np.abs(ref) >= speed_deg_s * (1.0 - 1e-9)
    # A travel too short for the set speed leaves no cruise: then the top of the profile counts.
    at_speed = cruise if np.any(cruise) else np.abs(ref) >= np.max(np.abs(ref)) * (1.0 - 1e-3)
    # Only the figure is thinned; the largest errors come from every scan.
    thin = slice(None, None, max(1, len(ref) // _CURVE_POINTS))
    time_s = np.arange(len(ref), dtype=np.float64) * period_s
    # Where the load is not measured, a motor that sticks is all that can be seen.
    moving = motor if load is None else load
    return SpeedRun(
        speed_deg_s=speed_deg_s,
        direction=direction,
        travel_deg=move,
        dial=machine.axis.dial,
        reached_deg_s=abs(float(np.mean(motor[at_speed]))),
        motor_error_deg_s=float(np.max(np.abs(motor - ref))),
        load_error_deg_s=None if load is None else float(np.max(np.abs(load - ref))),
        required=required_speed_error(machine),
        stick_slip=bool(np.any(direction.sign * moving[cruise] < _STICK_PART * speed_deg_s)),
        # Compensations move the motor off the set-point on purpose, for the load's sake: from 0.0065 to 0.018
        # deg/s with those of hust_improved.toml (docs/explanation/compensation.md).
        motor_judged=not machine.control.compensation.moves_motor,
        curves=SpeedCurves(time_s[thin], ref[thin], motor[thin], None if load is None else load[thin]),
    )
