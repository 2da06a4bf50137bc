"""The figures of one machine: chord procedures A and B, a short and a long move."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.accuracy.noise import DRAWS, Distribution, a_draws
from gantryctl.engineering.accuracy.procedure.on_batch import run_procedure, warm_up_legs
from gantryctl.engineering.accuracy.procedure.plan import chord_test
from gantryctl.engineering.accuracy.procedure.procedures import evaluate
from gantryctl.engineering.accuracy.statistics import statistics
from gantryctl.engineering.accuracy.verdict import ChordFigures
from gantryctl.engineering.batch import (
    ClosedLoop,
    Leg,
    Log,
    Runner,
    base_motion_rad,
    expected,
    in_lockstep,
    scans,
    settling_s,
)
from gantryctl.engineering.scheduler.job import Rows
from gantryctl.machine import Machine
from gantryctl.machine.places import fitted_stretch_deg
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.units import rad
from gantryctl.wiring.compensation import compensation
from gantryctl.wiring.plant_effects import larger_share_nm
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim

REST_S: Final = 1.0
SETTLE_S: Final = 6.0
SETTLED_DEG: Final = 0.001
_RESIDUAL_S: Final = (0.2, 2.2)
_COLUMNS: Final = (
    "pos_load_rad", "vel_ref_rad_s", "pos_base_rad", "vel_load_rad_s", "vel_motor_rad_s", "torque_mesh_nm",
    "torque_act_nm",
)  # fmt: skip


class MoveFigures(NamedTuple):
    """One move from standing still.

    Attributes:
        time_s: of the profile. load_error_deg_s, motor_error_deg_s: largest speed error against the set-point.
        base_um: base motion, peak to peak, gravity taken out. residual_um: the same, 0.2 to 2.2 s after the profile.
        settling_s: after the profile, until the load stays within 0.001 deg, by the envelope of its swing
            (`engineering.batch.settling_s`); 6 s where it has not by then. reducer_knm: at the reducer's output.
        motor_nm: torque of the motor, of two that of the one that has more.
    """

    time_s: float
    load_error_deg_s: float
    motor_error_deg_s: float
    base_um: float
    residual_um: float
    settling_s: float
    reducer_knm: float
    motor_nm: float


class KeyFigures(NamedTuple):
    """Figures in one row of the comparison; angles in deg."""

    a_true_a: float
    a_true_b: float
    a_measured_a: float
    a_measured_b: float
    load_error_deg_s: float
    motor_error_deg_s: float
    time_short_s: float
    time_long_s: float
    base_um: float
    residual_um: float
    settling_s: float
    reducer_knm: float
    load_error_long_deg_s: float
    base_long_um: float
    a_measured_high_a: float
    largest_chord_a: float
    largest_angle_a: float

    @property
    def judged_by(self) -> ChordFigures:
        """What procedure A is judged by."""
        return ChordFigures(
            a_deg=self.a_measured_a,
            largest_chord_deg=self.largest_chord_a,
            a_expanded_deg=self.a_measured_high_a - self.a_measured_a,
            largest_angle_deg=self.largest_angle_a,
        )


class KeyFigure(NamedTuple):
    """How a figure is shown.

    Attributes:
        head: above its column in the table of the rows; "" for a figure of the ensemble alone.
    """

    meaning: str
    unit: str
    head: str
    digits: int = 4


KEY_FIGURES: Final = {
    "a_true_a": KeyFigure("A true, procedure A", "deg", "A true\nproc. A"),
    "a_true_b": KeyFigure("A true, procedure B", "deg", "A true\nproc. B"),
    "a_measured_a": KeyFigure(f"A as measured, procedure A, median of {DRAWS}", "deg", "A seen\nproc. A"),
    "a_measured_b": KeyFigure(f"A as measured, procedure B, median of {DRAWS}", "deg", "A seen\nproc. B"),
    "load_error_deg_s": KeyFigure("speed error, load side, short move", "deg/s", "load\ndeg/s"),
    "motor_error_deg_s": KeyFigure("speed error, motor side, short move", "deg/s", "motor\ndeg/s"),
    "time_short_s": KeyFigure("time of the short move", "s", "short\ns", 2),
    "time_long_s": KeyFigure("time of the long move", "s", "long\ns", 2),
    "base_um": KeyFigure("base motion p-p, short move", "um", "base\num p-p", 0),
    "residual_um": KeyFigure("residual base motion, short move", "um", "after\num", 1),
    "settling_s": KeyFigure("settled to 0.001 deg, short move", "s", "settled\ns", 2),
    "reducer_knm": KeyFigure("reducer torque, short move", "kN m", "reducer\nkN m", 2),
    "load_error_long_deg_s": KeyFigure("speed error, load side, long move", "deg/s", ""),
    "base_long_um": KeyFigure("base motion p-p, long move", "um", "", 0),
    "a_measured_high_a": KeyFigure(f"A as measured, procedure A, 95 % of {DRAWS}", "deg", ""),
    "largest_chord_a": KeyFigure("largest chord error, procedure A", "deg", ""),
    "largest_angle_a": KeyFigure("largest angle error at a stop, procedure A", "deg", ""),
}


# Moves that are compared, where travel has them.
SHORT_DEG: Final = (0.0, 90.0)
LONG_DEG: Final = (-90.0, 90.0)


def measure_key_figures(
    machines: Sequence[Machine], seeds: Sequence[int], *, warm_up: bool = False
) -> list[KeyFigures]:
    """Run everything on every machine; its seed draws the tracker's noise.

    Args:
        warm_up: every axis first moves as `warm_up_legs` say.
    """
    chords = (chord_tests(machines, name, seeds, warm_up=warm_up) for name in "AB")
    moves = (
        expected(moves_figures([Move(each, *fitted_stretch_deg(each, *ends), warm_up) for each in machines]))
        for ends in (SHORT_DEG, LONG_DEG)
    )
    return [_key_figures(*found) for found in zip(*chords, *moves, strict=True)]


def _key_figures(
    chord_a: ChordTest, chord_b: ChordTest, quarter: MoveFigures, half: MoveFigures
) -> KeyFigures:
    return KeyFigures(
        a_true_a=chord_a.a_true_deg,
        a_true_b=chord_b.a_true_deg,
        a_measured_a=chord_a.a_seen.median_deg,
        a_measured_b=chord_b.a_seen.median_deg,
        load_error_deg_s=quarter.load_error_deg_s,
        motor_error_deg_s=quarter.motor_error_deg_s,
        time_short_s=quarter.time_s,
        time_long_s=half.time_s,
        base_um=quarter.base_um,
        residual_um=quarter.residual_um,
        settling_s=quarter.settling_s,
        reducer_knm=quarter.reducer_knm,
        load_error_long_deg_s=half.load_error_deg_s,
        base_long_um=half.base_um,
        a_measured_high_a=chord_a.a_seen.high_deg,
        largest_chord_a=chord_a.largest_chord_deg,
        largest_angle_a=chord_a.largest_angle_deg,
    )


# Between the name of a control and that of a figure; no name of a machine holds it.
_OF: Final = ": "


def key_columns(figures: Mapping[str, Sequence[KeyFigures]]) -> Rows:
    """Figures of several plants by control, as columns of a job."""
    return {
        f"{control}{_OF}{name}": np.array([getattr(row, name) for row in rows])
        for control, rows in figures.items()
        for name in KEY_FIGURES
    }


def figures_of(columns: Rows) -> dict[str, tuple[KeyFigures, ...]]:
    """Figures of several plants by control, from the columns of a job."""
    controls = dict.fromkeys(name.rpartition(_OF)[0] for name in columns)
    return {
        control: tuple(
            KeyFigures._make(row)
            for row in zip(*(columns[f"{control}{_OF}{name}"].tolist() for name in KEY_FIGURES), strict=True)
        )
        for control in controls
    }


class ChordTest(NamedTuple):
    """One chord test of a machine, deg.

    Attributes:
        a_true_deg: A of the true angles. a_seen: A as the tracker sees it, over draws of its noise.
        largest_chord_deg: of the true angles and of one draw. largest_angle_deg: of the true angles at the stops.
    """

    a_true_deg: float
    a_seen: Distribution
    largest_chord_deg: float
    largest_angle_deg: float


def chord_tests(
    machines: Sequence[Machine], name: str, seeds: Sequence[int], *, warm_up: bool = False
) -> list[ChordTest]:
    """A chord procedure of every machine; its seed draws the tracker's noise."""
    # Ways of control on one axis, and plants of one kind: the plan is the same for all.
    procedure = chord_test(machines[0], name)
    found = []
    angles_of = run_procedure(machines, procedure, threads=1, warm_up=warm_up).load_rad
    for machine, seed, angles in zip(machines, seeds, angles_of, strict=True):
        radius_m, sigma_m = machine.accuracy.chord_radius_m, machine.accuracy.tracker_noise_um * 1e-6
        true = evaluate(procedure, angles, radius_m)
        seen = evaluate(procedure, angles, radius_m, sigma_m, seed)
        found.append(
            ChordTest(
                a_true_deg=statistics(true).a_deg,
                a_seen=Distribution.of(a_draws(procedure, angles, radius_m, sigma_m, seed=seed)),
                largest_chord_deg=max(statistics(table).largest_deg for table in (true, seen)),
                largest_angle_deg=float(np.max(np.abs(np.degrees(angles - procedure.targets_rad)))),
            )
        )
    return found


def move_figures(machine: Machine, from_deg: float, to_deg: float) -> MoveFigures:
    """One move with the highest speed setting: the way back, rest, the move, 6 s rest.

    An axis in use comes from somewhere: it stands wound up by the friction of the move before, and turns round.
    """
    return expected(moves_figures([Move(machine, from_deg, to_deg)]))[0]


class Move(NamedTuple):
    """A machine, from where to where it moves, and whether it moves through the chord test before."""

    machine: Machine
    from_deg: float
    to_deg: float
    warm_up: bool = False


def moves_figures(moves: Sequence[Move]) -> list[MoveFigures | Exception]:
    """The same of several machines; an exception where one cannot be computed."""
    return in_lockstep([partial(_run_move, move) for move in moves])


def _run_move(move: Move, run: Runner) -> MoveFigures:
    machine, from_deg, to_deg, warm_up = move
    start, end = rad(from_deg), rad(to_deg)
    loop = ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), end, compensation(machine))
    if warm_up:
        run(loop, warm_up_legs(machine, chord_test(machine), end), _COLUMNS[:1])
    there, plan = (
        plan_move(SetPoint(a, 0.0, 0.0), b, motion_limits(machine)) for a, b in ((end, start), (start, end))
    )
    run(loop, (Leg(there, there.duration + SETTLE_S),), _COLUMNS[:1])
    legs = (Leg(hold(start), REST_S), Leg(plan, plan.duration + loop.sim.scan_period_s + SETTLE_S))
    return _evaluate(machine, run(loop, legs, _COLUMNS), plan.duration)


def _evaluate(machine: Machine, log: Log, duration_s: float) -> MoveFigures:
    period_s = log.period_s
    end = scans(REST_S, period_s) + math.ceil(duration_s / period_s) + 1
    load, ref = log["pos_load_rad"], log["vel_ref_rad_s"]
    base = base_motion_rad(machine, log["pos_base_rad"], load) * machine.plant.gear_error.ring_radius_m * 1e6
    # The first mode is at 2 Hz: two seconds hold four of its periods.
    first, last = (end + round(t / period_s) for t in _RESIDUAL_S)
    # Lost motion leaves the load beside the set-point: it settles to its own mean.
    final = float(np.mean(load[-round(1.0 / period_s) :]))
    motor = log["vel_motor_rad_s"] / machine.axis.ratio
    return MoveFigures(
        time_s=duration_s,
        load_error_deg_s=math.degrees(float(np.max(np.abs(log["vel_load_rad_s"] - ref)))),
        motor_error_deg_s=math.degrees(float(np.max(np.abs(motor - ref)))),
        base_um=float(np.ptp(base)),
        residual_um=float(np.ptp(base[first:last])),
        settling_s=min(settling_s(load[end:] - final, period_s, rad(SETTLED_DEG)), SETTLE_S),
        reducer_knm=float(np.max(np.abs(log["torque_mesh_nm"]))) / machine.axis.ring_ratio / 1e3,
        motor_nm=larger_share_nm(machine, float(np.max(np.abs(log["torque_act_nm"])))),
    )
