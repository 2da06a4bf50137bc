"""Driver of a chord test on the compiled loop: one reading per stop, many plants at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gantryctl.engineering.accuracy.procedure.plan import check_travel
from gantryctl.engineering.accuracy.procedure.procedures import Procedure
from gantryctl.engineering.accuracy.table import FloatArray
from gantryctl.engineering.batch import ClosedLoop, Leg, LegStatistics, run_legs
from gantryctl.machine import Machine, with_values
from gantryctl.motion import MotionLimits, SetPoint, hold, plan_move
from gantryctl.units import rad
from gantryctl.wiring.compensation import compensation
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim

# Rest before the first stop of a run.
REST_S: Final = 2.0
# Phases of the gear-error map: twelve ring harmonics, five of reducer and pinion, one unused.
PHASES: Final = 18

# Leg statistics in the order of the fields of `Readings`.
_MEASURED: Final = (
    "mean_pos_load_rad", "mean_pos_ring_rad", "mean_pos_act_rad", "max_vel_err_motor_rad_s", "max_vel_err_load_rad_s",
)  # fmt: skip


@dataclass(frozen=True)
class Readings:
    """True angles of a run, before any instrument. Arrays have shape (plants, stops), rad or deg/s.

    Attributes:
        load_rad: mean inertial angle of the load over the last part of each dwell: what a tracker sees.
        ring_rad: the same of the ring against its base: what an encoder on the ring sees.
        motor_rad: the same of the motor encoder, at the gantry.
        vel_err_motor_rad_s, vel_err_load_rad_s: largest speed error of the move to each stop.
        axis_time_s: length of the run.
    """

    load_rad: FloatArray
    ring_rad: FloatArray
    motor_rad: FloatArray
    vel_err_motor_rad_s: FloatArray
    vel_err_load_rad_s: FloatArray
    axis_time_s: float


def random_gear(machine: Machine, seed: int) -> Machine:
    """The same machine with another gear of the same grade: phases of the error map drawn at random."""
    return with_values(machine, random_gear_values(seed))


def random_gear_values(seed: int) -> dict[str, object]:
    """Values of `random_gear` by path."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, PHASES)
    return {"plant.gear_error.phases_rad": [float(p) for p in phases]}


def legs_of(machine: Machine, procedure: Procedure, limits: MotionLimits | None = None) -> list[Leg]:
    """The run as plans: rest, then a move and a dwell per stop.

    Raises:
        UsageError: a stop lies outside the travel of the axis.
    """
    check_travel(machine, procedure)
    limits = limits or motion_limits(machine)
    dwell_s, average_s = machine.accuracy.dwell_s, machine.accuracy.average_s
    period_s = machine.control.scan_period_ms * 1e-3
    pos = rad(procedure.start_deg)
    # The load goes on swinging after the motor has stopped (2.00 Hz, 1.6 % damping): hence the dwell, of
    # which only the end is averaged.
    legs = [Leg(hold(pos), REST_S, period_s)]
    for target in procedure.targets_rad:
        plan = hold(pos) if target == pos else plan_move(SetPoint(pos, 0.0, 0.0), float(target), limits)
        # the profile is sampled once more than it lasts, then the dwell begins
        legs.append(Leg(plan, plan.duration + period_s + dwell_s, average_s))
        pos = float(target)
    return legs


def warm_up_legs(machine: Machine, procedure: Procedure, start_rad: float) -> list[Leg]:
    """To both ends of a procedure and back, with a stop at its middle base each way: ISO 230-2 asks for a warm-up.

    A law that learns has learned then, and friction and gears are as moving has left them. A large moment keeps the
    gears on one flank away from its zero, and a gap that no ramp crosses is in no signal: hence the stops between.
    """
    period_s, limits = machine.control.scan_period_ms * 1e-3, motion_limits(machine)
    pos, legs = start_rad, [Leg(hold(start_rad), REST_S, period_s)]
    low, high = map(rad, procedure.travel_deg)
    middle = rad(sorted(procedure.bases_deg)[len(procedure.bases_deg) // 2])
    # The start is come to in the direction of positive angles, in which the short and the long move go on.
    for to in (high, middle, low, middle, start_rad):
        if to != pos:
            plan = plan_move(SetPoint(pos, 0.0, 0.0), to, limits)
            legs.append(Leg(plan, plan.duration + period_s + REST_S, period_s))
            pos = to
    return legs


def run_time_s(machine: Machine, procedure: Procedure, first: int = 0) -> float:
    """Time of the axis from stop `first` to the end: moves and dwells."""
    # The first leg is the rest before the run.
    return sum(leg.duration_s for leg in legs_of(machine, procedure)[1 + first :])


def run_procedure(
    machines: Sequence[Machine],
    procedure: Procedure,
    *,
    threads: int | None = None,
    warm_up: bool = False,
    between: Callable[[int, ClosedLoop], None] | None = None,
) -> Readings:
    """Take every machine through the procedure, in one continuous run each, from standing still at its start.

    Args:
        machines: any, each with its own profile and control.
        threads: 1 to the number of processors (default: all); no effect on the result.
        warm_up: every axis first moves as `warm_up_legs` say.
        between: called as `between(stop index, loop)` before the move to each stop: for what happens to a
            real machine in mid-test, such as a power-off.
    """
    start = rad(procedure.start_deg)
    legs = _legs_of_each(machines, procedure)
    loops = [ClosedLoop.standing_at(gantry_sim(m), position_law(m), start, compensation(m)) for m in machines]
    workers = min(threads or os.cpu_count() or 1, len(loops))
    found = np.empty((len(_MEASURED), len(machines), len(procedure.stops)))
    # A batch has compensations in all of its loops or in none.
    for compensated in (False, True):
        places = [k for k, loop in enumerate(loops) if (loop.compensation is not None) is compensated]
        if places:
            own = [loops[k] for k in places]
            if warm_up:
                run_legs(own, [warm_up_legs(machines[k], procedure, start) for k in places], workers)
            statistics = _statistics(own, [legs[k] for k in places], workers, between)
            # The first leg is the rest before the run, not a stop.
            found[:, places] = np.array(
                [[getattr(stop, name) for stop in statistics[1:]] for name in _MEASURED]
            ).transpose(0, 2, 1)
    load, ring, motor, vel_motor, vel_load = found
    return Readings(load, ring, motor, vel_motor, vel_load, sum(leg.duration_s for leg in legs[0]))


def _legs_of_each(machines: Sequence[Machine], procedure: Procedure) -> list[list[Leg]]:
    """Legs by machine; plans of equal profiles are made once."""
    made: dict[tuple[object, ...], list[Leg]] = {}
    found = []
    for machine in machines:
        axis, times = machine.axis, machine.accuracy
        profile = (
            motion_limits(machine), times.dwell_s, times.average_s, machine.control.scan_period_ms,
            axis.pos_min_deg, axis.pos_max_deg,
        )  # fmt: skip
        if profile not in made:
            made[profile] = legs_of(machine, procedure)
        found.append(made[profile])
    return found


def _statistics(
    loops: Sequence[ClosedLoop],
    legs: Sequence[Sequence[Leg]],
    workers: int,
    between: Callable[[int, ClosedLoop], None] | None,
) -> list[LegStatistics]:
    if between is None:
        return run_legs(loops, legs, workers)
    statistics = run_legs(loops, [own[:1] for own in legs], workers)
    for index in range(len(legs[0]) - 1):
        for loop in loops:
            between(index, loop)
        statistics += run_legs(loops, [[own[1 + index]] for own in legs], workers)
    return statistics


def lose_turns(loop: ClosedLoop, turns: int) -> None:
    """Falsify the multiturn part of the encoder, as a turn with the power off would (for tests that must fail)."""
    # It shifts all stops alike and changes no chord: only the largest angle error of a report shows it.
    loop.sim.count_offset += turns * round(2.0 * np.pi / loop.law.rad_per_count)
