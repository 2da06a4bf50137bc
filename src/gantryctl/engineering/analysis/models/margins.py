"""Margins of a frequency response that is known at every frequency: crossovers refined, peaks refined."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from gantryctl.engineering.analysis.models.linear import MINUS_3_DB, ComplexArray, FloatArray

Response: TypeAlias = Callable[[FloatArray], ComplexArray]

# 24 halvings of a grid step of 0.9 % leave 6e-10.
_BISECTIONS: Final = 24
_GRID_PER_DECADE: Final = 250
# Half-widths on either side of a mode, with eight points in each: a peak of 1.6 % damping is not missed.
_HALF_WIDTHS: Final = 12.0
_AROUND_MODE: Final = 193
# A loop that bears a thousandfold gain has no limit within reach of any drive.
_LARGEST_GAIN: Final = 1e3


class PhaseFigures(NamedTuple):
    """Phase margin, its gain crossover, and the dead time that would use it up."""

    margin_deg: float
    crossover_rad_s: float
    delay_s: float


class Peak(NamedTuple):
    """Largest magnitude and where."""

    value: float
    w_rad_s: float


def frequency_grid(
    low_rad_s: float, high_rad_s: float, poles: ComplexArray, per_decade: int = _GRID_PER_DECADE
) -> FloatArray:
    """Logarithmic grid, made dense around lightly damped poles so that no narrow peak lies between points."""
    around = np.linspace(-_HALF_WIDTHS, _HALF_WIDTHS, _AROUND_MODE)
    count = max(2, math.ceil(per_decade * math.log10(high_rad_s / low_rad_s)))
    parts = [np.geomspace(low_rad_s, high_rad_s, count)]
    for pole in poles[poles.imag > 0.0]:
        parts.append(pole.imag + max(abs(pole.real), 1e-5 * pole.imag) * around)
    grid = np.unique(np.concatenate(parts))
    return np.asarray(grid[(grid >= low_rad_s) & (grid <= high_rad_s)])


def phase_margins(loop: Response, grid: FloatArray) -> list[PhaseFigures]:
    """One entry per gain crossover, ascending; the phase margin is in (-180, 180] deg."""
    at = _crossings(lambda w: np.log(np.abs(loop(w))), grid)
    margins = np.degrees(np.angle(-loop(at)))
    found = []
    for w, margin in zip(at.tolist(), margins.tolist(), strict=True):
        found.append(PhaseFigures(margin, w, math.radians(margin % 360.0) / w))
    return found


def crossing_phases_deg(open_loop: ComplexArray) -> FloatArray:
    """Phase margins of a response known on a grid only, interpolated; for many plants."""
    level = np.log(np.abs(open_loop))
    where = np.nonzero(level[1:] * level[:-1] < 0.0)[0]
    part = level[where] / (level[where] - level[where + 1])
    turn = np.angle(open_loop[where + 1] / open_loop[where])
    return np.asarray(np.degrees(np.angle(-open_loop[where] * np.exp(1j * part * turn))))


def smallest_phase_margin(loop: Response, grid: FloatArray) -> PhaseFigures | None:
    """The crossover nearest to instability; None when |L| never passes 1."""
    return min(phase_margins(loop, grid), key=lambda figures: abs(figures.margin_deg), default=None)


def gain_limits(stable: Callable[[float], bool]) -> tuple[float | None, float | None]:
    """The factors on the gain, below and above 1, at which a loop loses stability; None: not within
    1e-3..1e3.

    Exact: asks whether the loop is stable, not where a frequency response crosses the axis.
    """
    # Steps of 15 % before the bisection: the loop is conditionally stable, so both directions are searched
    # from 1.
    return _limit(stable, 1.0 / 1.15), _limit(stable, 1.15)


def peak(magnitude: Callable[[FloatArray], FloatArray], grid: FloatArray) -> Peak:
    """Largest value over a grid, refined between its points."""
    values = magnitude(grid)
    best = int(np.argmax(values))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    for _ in range(6):
        fine = np.linspace(low, high, 15)
        values = magnitude(fine)
        best = int(np.argmax(values))
        low, high = fine[max(best - 1, 0)], fine[min(best + 1, 14)]
    return Peak(float(values[best]), float(fine[best]))


def sensitivity_peak(loop: Response, grid: FloatArray) -> Peak:
    """Largest |1/(1 + L)|: 1 / the distance of the Nyquist curve from -1."""
    # A peak of 2 means at least 6 dB of gain margin and 29 deg of phase margin.
    return peak(lambda w: 1.0 / np.abs(1.0 + loop(w)), grid)


def bandwidth_rad_s(transfer: Response, grid: FloatArray) -> float | None:
    """Lowest frequency where |G| falls 3 dB below 1, its value at rest; None when it does not."""
    at = _crossings(lambda w: np.log(np.abs(transfer(w)) / MINUS_3_DB), grid)
    return float(at[0]) if len(at) else None


def last_bandwidth_rad_s(transfer: Response, grid: FloatArray) -> float | None:
    """Highest frequency where |G| passes the same level: beyond it the loop no longer follows."""
    at = _crossings(lambda w: np.log(np.abs(transfer(w)) / MINUS_3_DB), grid)
    return float(at[-1]) if len(at) else None


def _crossings(value: Callable[[FloatArray], FloatArray], grid: FloatArray) -> FloatArray:
    """Where a function of the frequency passes 0, by bisection of all brackets at once."""
    signs = np.sign(value(grid))
    where = np.nonzero(signs[1:] * signs[:-1] < 0.0)[0]
    if len(where) == 0:
        return np.zeros(0)
    low, high, sign = grid[where], grid[where + 1], signs[where]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        before = np.sign(value(middle)) == sign
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return np.asarray(0.5 * (low + high))


def _limit(stable: Callable[[float], bool], step: float) -> float | None:
    """The first factor at which the answer changes, going from 1 in steps, then by bisection."""
    if not stable(1.0):
        return None
    inside, outside = 1.0, step
    while stable(outside):
        inside, outside = outside, outside * step
        if not 1.0 / _LARGEST_GAIN <= outside <= _LARGEST_GAIN:
            return None
    for _ in range(_BISECTIONS):
        middle = math.sqrt(inside * outside)
        inside, outside = (middle, outside) if stable(middle) else (inside, middle)
    return inside
