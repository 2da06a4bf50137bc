"""Logs and leg statistics of the compiled closed loop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gantryctl import _core
from gantryctl.motion import hold

Floats = NDArray[np.float64]


class Log:
    """Record of a run, one array per column, of `_core.LOG_COLUMNS`; row k is the state at t = k x period."""

    def __init__(self, values: Floats, period_s: float, columns: Sequence[str] = _core.LOG_COLUMNS) -> None:
        self._values = values
        self.period_s = period_s
        self.columns: tuple[str, ...] = tuple(columns)

    def __getitem__(self, column: str) -> Floats:
        values: Floats = self._values[self.columns.index(column)]
        return values

    def __len__(self) -> int:
        return int(self._values.shape[1])

    @property
    def time_s(self) -> Floats:
        """Time of every row."""
        return np.arange(len(self), dtype=np.float64) * self.period_s


class ClosedLoop:
    """One axis under the position law, enabled, brake open.

    Args:
        sim: drive and plant; moves on with every run.
        law: the position loop.
        zero_counts: encoder counts at gantry angle 0.
        compensation: what goes beyond the position law, with its state; None for nothing.
    """

    def __init__(
        self,
        sim: _core.GantrySim,
        law: _core.PositionLaw,
        zero_counts: float,
        compensation: _core.Compensation | None = None,
    ) -> None:
        self.sim = sim
        self.law = law
        self.zero_counts = zero_counts
        self.compensation = compensation

    @classmethod
    def standing_at(
        cls,
        sim: _core.GantrySim,
        law: _core.PositionLaw,
        angle_rad: float,
        compensation: _core.Compensation | None = None,
    ) -> ClosedLoop:
        """Standing still with the servo on, the encoder zeroed so that the load is where the set-point says."""
        sim.static_start(angle_rad, True)
        counts = sim.feedback(law.rad_per_count)[0]
        # With compensations the motor leads the load, so the zero counts the lead in: following begins
        # without a jump (decision 0010).
        motor_rad = angle_rad if compensation is None else angle_rad + compensation.lead(angle_rad)
        zero_counts = float(round(counts - law.ratio * motor_rad / law.rad_per_count))
        return cls(sim, law, zero_counts, compensation)

    def run(self, plan: _core.Segments, duration_s: float) -> Log:
        """Run `duration_s` (rounded up to whole scans) of a plan and keep every scan."""
        period_s = self.sim.scan_period_s
        values = np.empty((len(_core.LOG_COLUMNS), scans(duration_s, period_s)))
        _core.run_closed_loop(
            self.sim, self.law, plan, self.zero_counts, values, compensation=self.compensation
        )
        return Log(values, period_s)

    def command(self, mode: int, duration_s: float, *, brake_open: bool) -> Log:
        """Give the drive one command (0 off, 2 quick stop) for a time, without the position loop."""
        period_s = self.sim.scan_period_s
        values = np.empty((len(_core.LOG_COLUMNS), scans(duration_s, period_s)))
        _core.run_command(self.sim, mode, 0.0, brake_open, values)
        return Log(values, period_s)

    def rest(self, angle_rad: float, duration_s: float) -> Log:
        """Hold a position."""
        return self.run(hold(angle_rad), duration_s)


class Leg(NamedTuple):
    """A stretch of a run: the plan, how long, and over how much of its end the readings are averaged.

    Attributes:
        average_s: rounded up to whole scans, one at least.
        mode: 1 follows the plan; 0 (off) and 2 (quick stop) are commands to the drive, and nobody follows it.
        passed_scans: scans of the plan before the leg begins.
        added_rad_s: added to the speed command of the law, motor side, one value a scan and over again.
    """

    plan: _core.Segments
    duration_s: float
    average_s: float = 0.0
    mode: int = 1
    brake_open: bool = True
    passed_scans: int = 0
    added_rad_s: Sequence[float] = ()


class LegStatistics(NamedTuple):
    """Figures of one leg, per plant: arrays of shape (plants,). Errors are against the set-point; under a command to
    the drive the speed set-point is 0 and there is no position error. Travel: largest way from where the leg began.
    """

    mean_pos_load_rad: Floats
    mean_pos_ring_rad: Floats
    mean_pos_act_rad: Floats
    max_vel_err_motor_rad_s: Floats
    max_vel_err_load_rad_s: Floats
    max_pos_err_motor_rad: Floats
    max_pos_err_load_rad: Floats
    max_torque_motor_nm: Floats
    max_torque_mesh_nm: Floats
    max_travel_motor_rad: Floats
    max_travel_load_rad: Floats


def run_legs(
    loops: Sequence[ClosedLoop], legs: Sequence[Leg] | Sequence[Sequence[Leg]], threads: int = 1
) -> list[LegStatistics]:
    """Take every plant through its legs, several plants at once; one entry per leg.

    Args:
        loops: what is run; either all have a compensation of their own or none has.
        legs: the same for all plants, or one list for each with the same number of legs.
        threads: has no effect on the result. Each plant has the bits that it has alone.
    """
    result = _core.run_legs(*_native(loops, legs), threads, _compensations(loops))
    return [LegStatistics(*result[:, k, :].T) for k in range(result.shape[1])]


def log_legs(
    loops: Sequence[ClosedLoop],
    legs: Sequence[Leg] | Sequence[Sequence[Leg]],
    columns: Sequence[str],
    threads: int = 1,
) -> list[Log]:
    """The same, but what is kept are rows: one log per plant, its legs one after the other.

    Args:
        columns: of `_core.LOG_COLUMNS`. A scan takes 8 bytes a plant and column. Speed commands are those of the law.
    """
    numbers = [_core.LOG_COLUMNS.index(column) for column in columns]
    kept = _core.log_legs(*_native(loops, legs), numbers, threads, _compensations(loops))
    return [Log(values, loop.sim.scan_period_s, columns) for values, loop in zip(kept, loops, strict=True)]


_NativeLeg: TypeAlias = "tuple[_core.Segments, int, int, int, bool, int, Sequence[float]]"


def _native(
    loops: Sequence[ClosedLoop], legs: Sequence[Leg] | Sequence[Sequence[Leg]]
) -> tuple[list[_core.GantrySim], list[_core.PositionLaw], list[list[_NativeLeg]], list[float]]:
    """Plants, laws, legs and zeros as the compiled functions take them."""
    return (
        [loop.sim for loop in loops],
        [loop.law for loop in loops],
        [
            [_native_leg(leg, loop.sim.scan_period_s) for leg in own]
            for own, loop in zip(_per_plant(legs), loops, strict=False)
        ],
        [loop.zero_counts for loop in loops],
    )


def _compensations(loops: Sequence[ClosedLoop]) -> list[_core.Compensation]:
    return [loop.compensation for loop in loops if loop.compensation is not None]


def _per_plant(legs: Sequence[Leg] | Sequence[Sequence[Leg]]) -> list[list[Leg]]:
    """One list for all or one list per plant."""
    alike = [leg for leg in legs if isinstance(leg, Leg)]
    return [alike] if alike else [list(own) for own in legs if not isinstance(own, Leg)]


def _native_leg(leg: Leg, period_s: float) -> _NativeLeg:
    duration, average = scans(leg.duration_s, period_s), scans(leg.average_s, period_s)
    return leg.plan, duration, average, leg.mode, leg.brake_open, leg.passed_scans, leg.added_rad_s


def scans(duration_s: float, period_s: float) -> int:
    """Whole scans in a time, rounded up; a rounding error of the division makes no scan."""
    # 2.1/0.3 is 7.000000000000001 in doubles: rounding adds no scan.
    return max(1, math.ceil(duration_s / period_s - 1e-6))
