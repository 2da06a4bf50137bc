"""What the acceptance tests measure, and the two criteria that decide between green and red.

All of it goes through the product's own accuracy job; only the base motion is evaluated here. Every figure a test
compares with is one of the independent reference computation of the same plant, rounded as it was printed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from gantryctl.engineering.accuracy.procedure.on_batch import Readings, run_procedure
from gantryctl.engineering.accuracy.procedure.procedures import Procedure, chord_procedure, evaluate
from gantryctl.engineering.accuracy.report.report import SpeedRun
from gantryctl.engineering.accuracy.statistics import TableStatistics, statistics
from gantryctl.engineering.accuracy.table import ErrorTable, FloatArray
from gantryctl.engineering.batch import ClosedLoop
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim, plant_params

REFERENCE_A_DEG: Final = 0.0110
"""A of the reference gear without instrument noise, procedure A."""
PLANT_TOLERANCE: Final = 0.15
"""How far two implementations of the same equations and parameters may differ in a figure of the full plant: friction
at standstill decides figures of some 1e-4 deg, and integration scheme, profile generator and averaging all move them a
little. Much narrower than what any of the faults in `test_faults.py` does."""

SHORT: Final = chord_procedure("A", bases_deg=[0.0], displacements_deg=[5.0])
"""Six stops in place of 36, where a test is not about A."""


def chord_is_green(a_deg: float) -> bool:
    """The chord criterion: A within 15 % of the reference. Too small is red too: a plant without its gear errors
    proves nothing.
    """
    return within(a_deg, REFERENCE_A_DEG)


def speed_is_green(runs: Iterable[SpeedRun]) -> bool:
    """The speed criterion: every run within 0.01 deg/s on the motor side, over its whole length."""
    return all(run.motor_error_deg_s <= run.required.limit for run in runs)


def within(measured: float, reference: float, tolerance: float = PLANT_TOLERANCE) -> bool:
    """Whether a figure lies within a part `tolerance` of its reference."""
    return abs(measured - reference) <= tolerance * abs(reference)


def gantry(**changes: object) -> Machine:
    """The reference machine with other values: `gantry(control__kvf=0.0)` changes [control] kvf."""
    return with_values(default_machine(), {path.replace("__", "."): value for path, value in changes.items()})


@dataclass(frozen=True, eq=False)
class ChordRun:
    """One plant through one chord procedure, without instrument noise."""

    machine: Machine
    procedure: Procedure
    load_rad: FloatArray

    @cached_property
    def table(self) -> ErrorTable:
        return evaluate(self.procedure, self.load_rad, self.machine.accuracy.chord_radius_m)

    @cached_property
    def statistics(self) -> TableStatistics:
        return statistics(self.table)

    @property
    def a_deg(self) -> float:
        return self.statistics.a_deg

    @property
    def rms_deg(self) -> dict[float, float]:
        """Per base, over both directions, without the zero column."""
        return self.statistics.rms_deg

    @property
    def rms_at_90_deg(self) -> float:
        """Of the bases +90 and -90 together."""
        return float(np.sqrt(np.mean(self.table.select([90.0, -90.0])[:, 1:] ** 2)))

    @property
    def largest_angle_error_deg(self) -> float:
        """Between reading and target, over all stops: what the chords cannot see is in here."""
        return float(np.max(np.abs(np.degrees(self.load_rad - self.procedure.targets_rad))))


class Bench:
    """Chord runs, each made once and kept: one costs about a second."""

    def __init__(self) -> None:
        self._done: dict[tuple[Machine, str], ChordRun] = {}

    def chord(self, machine: Machine, procedure: str = "A") -> ChordRun:
        """One machine through a procedure with the paper's bases and displacements."""
        return self.chords([machine], procedure)[0]

    def chords(self, machines: Sequence[Machine], procedure: str = "A") -> list[ChordRun]:
        """Machines that differ in [plant] only, at once on all processors."""
        assert all(without_plant(m) == without_plant(machines[0]) for m in machines)
        todo = [m for m in dict.fromkeys(machines) if (m, procedure) not in self._done]
        if todo:
            stops = chord_procedure(procedure)
            self._done |= {
                (run.machine, procedure): run for run in chord_runs(todo, stops, run_procedure(todo, stops))
            }
        return [self._done[machine, procedure] for machine in machines]


def chord_runs(machines: Sequence[Machine], procedure: Procedure, readings: Readings) -> list[ChordRun]:
    """The readings of a run, one `ChordRun` per plant."""
    return [ChordRun(m, procedure, row) for m, row in zip(machines, readings.load_rad, strict=True)]


def without_plant(machine: Machine) -> dict[str, object]:
    """Everything of a machine that a controller may know."""
    return {name: table for name, table in machine if name != "plant"}


@dataclass(frozen=True)
class BaseMotion:
    """One move from standing still, watched until 6 s after its profile.

    Attributes:
        duration_s: of the profile.
        base_um: motion of the base at the ring, peak to peak over the whole log, the static gravity part taken off.
        residual_um: the same from 0.2 to 2.2 s after the last profile sample.
        settling_s: last time after the last profile sample with the load more than 0.001 deg from where it ends.
    """

    duration_s: float
    base_um: float
    residual_um: float
    settling_s: float


def base_motion(machine: Machine, from_deg: float, to_deg: float) -> BaseMotion:
    """1 s of rest, the move at the highest speed setting, 6 s of rest."""
    loop = ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), rad(from_deg))
    plan = plan_move(SetPoint(rad(from_deg), 0.0, 0.0), rad(to_deg), motion_limits(machine))
    before = loop.run(hold(rad(from_deg)), 1.0)
    period_s = before.period_s
    log = loop.run(plan, plan.duration + period_s + 6.0)
    base, load = (np.concatenate([before[name], log[name]]) for name in ("pos_base_rad", "pos_load_rad"))
    end = len(before) + int(np.ceil(plan.duration / period_s - 1e-6))  # the last profile sample

    plant = plant_params(machine)
    swing = base - plant.eccentric_moment_nm * np.sin(load) / plant.base_stiffness_nm_per_rad
    moved_um = swing * machine.plant.gear_error.ring_radius_m * 1e6
    watched = slice(end + round(0.2 / period_s), end + round(2.2 / period_s) + 1)
    away_deg = np.abs(np.degrees(load[end:] - np.mean(load[-round(1.0 / period_s) :])))
    outside = np.flatnonzero(away_deg > 0.001)
    return BaseMotion(
        duration_s=plan.duration,
        base_um=float(np.ptp(moved_um)),
        residual_um=float(np.ptp(moved_um[watched])),
        settling_s=float(outside[-1]) * period_s if outside.size else 0.0,
    )
