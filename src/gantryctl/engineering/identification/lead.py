"""The lead of the motor over the load in the slow turns: maps, single waves and backlash.

    y/i - x = a0 + sum a_n sin n y/i + b_n cos n y/i        mean map, n = 1..N
            + z sum ...                                     reversal map, z direction of motion
            + single waves of many cycles
            + b/2 s(Tg / T_w)                               backlash b: on which flank the mesh torque Tg lies

N is the order that predicts best what was not in the fit (cross-validation over stretches of the motion), single
waves are those that stand out of the spectrum of what is left. Where what both leave comes again in the other turn, as
pitch errors of single teeth do, the mean map has all the waves that the law carries (`waves.py`). Backlash is told from
friction by where it jumps: not where the motion turns round but where the torque in the mesh does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.identification.least_squares import BETTER, StretchSums, estimate_of, solved
from gantryctl.engineering.identification.samples import Floats, Samples
from gantryctl.engineering.identification.waves import (
    Band,
    ToothWaves,
    find_waves,
    tooth_waves,
    waves_of,
)
from gantryctl.machine.calibration import MAP_HARMONICS, REVERSAL_HARMONICS

# Gears err by less than this: a wave that a short travel cannot tell from others stays as small.
_WAVE_SPREAD_RAD: Final = 3e-4
# What is left of one sample, as the prior weighs it.
_SAMPLE_RAD: Final = 1e-5
# Orders of the smooth maps that are tried.
_ORDERS: Final = (4, 8, 12, 16, 20, 24, 28, 32)
_REVERSAL_ORDERS: Final = (0, 2, 4, 8, REVERSAL_HARMONICS)

# Up to so many times the waves that are read; beyond, the load stands still.
_SHAKEN: Final = 4.0

FastWaves = list[tuple[float, float, float]]


class Lead(NamedTuple):
    """What the slow turns show.

    Attributes:
        mean_rad, reversal_rad: maps, mean, sine 1, cosine 1, ...
        waves: (cycles per turn, sine, cosine) as they are seen while passing, strongest first.
        shaken: the same of waves that pass so near to the first mode, or above it, that the load swings instead of
            following: their size is not that of the gear.
        backlash_rad: both flanks together; None where the lead does not jump. backlash_half_width_rad: of its 95 %
            interval.
        left_rad: what is left, shape (samples,).
        teeth: what waves beyond the smooth map say about the other turn; None where slow turns or law have no place.
    """

    mean_rad: Floats
    reversal_rad: Floats
    waves: FastWaves
    shaken: FastWaves
    backlash_rad: float | None
    backlash_half_width_rad: float
    left_rad: Floats
    teeth: ToothWaves | None

    @property
    def order(self) -> int:
        """Waves of the mean map."""
        return len(self.mean_rad) // 2

    def at(self, samples: Samples, mesh_nm: Floats, flank_nm: float) -> Floats:
        """Lead without single waves."""
        mean = harmonics_of(samples.act_rad, self.order) @ self.mean_rad
        turned = harmonics_of(samples.act_rad, len(self.reversal_rad) // 2) @ self.reversal_rad
        flank = 0.5 * (self.backlash_rad or 0.0) * flank_of(mesh_nm, flank_nm)
        return np.asarray(mean + samples.direction * turned + flank)


def harmonics_of(angle_rad: Floats, count: int) -> Floats:
    """Columns 1, sin x, cos x, sin 2x ...: shape (samples, 2 count + 1)."""
    return np.column_stack([np.ones_like(angle_rad), waves_of(angle_rad, range(1, count + 1))])


def flank_of(mesh_nm: Floats, flank_nm: float) -> Floats:
    """-1 to 1: the flank that a mesh torque lies on, as the law of the controller has it (`compensation.hpp`)."""
    u = np.clip(mesh_nm / flank_nm, -1.0, 1.0)
    return np.asarray(0.5 * u * (3.0 - u * u))


def wave_solution(columns: Floats, wanted: Floats, free: int = 0) -> Floats:
    """Least squares, waves of the gear kept as small as gears are; the first `free` columns are no waves."""
    return solved(columns, wanted, _prior(columns.shape[1], free))


def _prior(count: int, free: int) -> Floats:
    prior = np.full(count, _SAMPLE_RAD / _WAVE_SPREAD_RAD)
    prior[:free] = 0.0
    return prior


def fit_lead(turns: Samples, mesh_nm: Floats, flank_nm: float, band: Band, expected: Sequence[float]) -> Lead:
    """Fit the lead of the slow turns.

    Args:
        mesh_nm: torque in the mesh, shape (samples,). flank_nm: where the mesh changes its flank.
        band: single waves that pass slowly enough. expected: those that ratios or people suggest.
    """
    flank = flank_of(mesh_nm, flank_nm)
    found = _fitted(turns, flank, band, expected, (True, False))
    # A gap whose interval reaches 0 counts as 0: the reversal map holds what there is of it.
    if found.backlash_rad is not None and found.backlash_rad <= found.backlash_half_width_rad:
        found = _fitted(turns, flank, band, expected, (False,))
    return found


def _fitted(
    turns: Samples, flank: Floats, band: Band, expected: Sequence[float], gaps: Sequence[bool]
) -> Lead:
    orders = [order for order in _ORDERS if order <= band.high]
    problem = _Problem(turns, flank, orders[-1])
    model = _best(problem, orders, _REVERSAL_ORDERS, gaps)
    smooth = _fit_smooth(turns, problem, model, model[0], band, expected)
    most = min(MAP_HARMONICS, int(band.high))
    if most <= smooth.order:
        return smooth
    cycles = range(smooth.order + 1, most + 1)
    teeth = tooth_waves(turns, smooth.left_rad, cycles)
    if not teeth.come_again:
        return smooth._replace(teeth=teeth)
    # What were single waves below belongs to the map now.
    smooth = _fit_smooth(turns, problem, model, most, band, expected)
    teeth = tooth_waves(turns, smooth.left_rad, cycles)
    return smooth._replace(
        mean_rad=np.append(smooth.mean_rad, teeth.sines_rad),
        left_rad=smooth.left_rad - waves_of(turns.act_rad, cycles) @ teeth.sines_rad,
        teeth=teeth,
    )


def _fit_smooth(
    turns: Samples,
    problem: _Problem,
    model: tuple[int, int, bool],
    beyond: int,
    band: Band,
    expected: Sequence[float],
) -> Lead:
    """Maps of the orders of `model`, backlash, and single waves of more cycles than `beyond`."""
    order, reversal, gap = model
    base = problem.chosen(order, reversal, gap)

    def left_of(cycles: Sequence[float]) -> Floats:
        columns = np.column_stack([base, waves_of(turns.act_rad, cycles)])
        return np.asarray(problem.wanted - columns @ _normal_solution(columns, problem.wanted))

    shaken = Band(beyond + 0.5, _SHAKEN * band.high)
    cycles = find_waves(turns.act_rad, left_of, shaken, [c for c in expected if c <= band.high])
    columns = np.column_stack([base, waves_of(turns.act_rad, cycles)])
    x = wave_solution(columns, problem.wanted, free=1)
    left = problem.wanted - columns @ x
    first = 2 * order + 1
    second = first + 2 * reversal + 1
    pairs = x[second + gap :].reshape(-1, 2).tolist()
    waves = [(c, sine, cosine) for c, (sine, cosine) in zip(cycles, pairs, strict=True)]
    backlash, half_width = None, np.inf
    if gap:
        estimate = estimate_of(x, columns, left, turns.stretch, np.full(len(x), _WAVE_SPREAD_RAD))
        gradient = np.zeros(len(x))
        gradient[second] = 1.0
        backlash, half_width = float(x[second]), estimate.half_width_of(gradient)
    return Lead(
        mean_rad=x[:first],
        reversal_rad=x[first:second],
        waves=[wave for wave in waves if wave[0] <= band.high],
        shaken=[wave for wave in waves if wave[0] > band.high],
        backlash_rad=backlash,
        backlash_half_width_rad=half_width,
        left_rad=left,
        teeth=None,
    )


def _normal_solution(columns: Floats, wanted: Floats) -> Floats:
    """As `wave_solution`, by the normal equations: good enough to see what is left, and ten times as fast."""
    square = columns.T @ columns + np.diag(_prior(columns.shape[1], 1) ** 2)
    return np.asarray(np.linalg.solve(square, columns.T @ wanted))


class _Problem:
    """The lead of the slow turns and all columns of the largest model."""

    def __init__(self, turns: Samples, flank: Floats, order: int) -> None:
        self.wanted = turns.act_rad - turns.load_rad
        self._order = order
        mean = harmonics_of(turns.act_rad, order)
        turned = harmonics_of(turns.act_rad, REVERSAL_HARMONICS) * turns.direction[:, np.newaxis]
        self._columns = np.column_stack([mean, turned, 0.5 * flank])
        self._sums = StretchSums(self._columns, self.wanted, turns.stretch)

    def _places(self, order: int, reversal: int, gap: bool) -> list[int]:
        first = 2 * self._order + 1
        flank = [first + 2 * REVERSAL_HARMONICS + 1] if gap else []
        return [*range(2 * order + 1), *range(first, first + 2 * reversal + 1), *flank]

    def chosen(self, order: int, reversal: int, gap: bool) -> Floats:
        """Columns of a model: mean map, reversal map, flank."""
        return np.asarray(self._columns[:, self._places(order, reversal, gap)])

    def predicts(self, order: int, reversal: int, gap: bool) -> float:
        """R.m.s. of what a model leaves of stretches that were not in its fit."""
        places = self._places(order, reversal, gap)
        return self._sums.left_out(places, _prior(len(places), 1))

    def gap_of(self, order: int, reversal: int) -> float:
        """Backlash of a model."""
        places = self._places(order, reversal, True)
        return float(self._sums.solution(places, _prior(len(places), 1))[-1])


def _best(
    problem: _Problem, orders: Sequence[int], turned: Sequence[int], gaps: Sequence[bool]
) -> tuple[int, int, bool]:
    """Order of the mean map, of the reversal map, and whether there is backlash."""
    best, least = (orders[0], turned[0], False), np.inf
    # A gap is simpler than a reversal map that looks like one.
    for model in ((o, r, gap) for o in orders for r in turned for gap in gaps):
        if model[2] and problem.gap_of(model[0], model[1]) <= 0.0:
            continue
        error = problem.predicts(*model)
        if error < BETTER * least:
            best, least = model, error
    return best
