"""Waves of the gear that the recordings show beyond a smooth map: single ones, and those of single teeth.

Single waves come from a spectrum over the angle of what the fit leaves. A wave is found where the spectrum stands out
of the noise around it, and the test counts how many waves were tried: of M independent ones the largest of pure noise
exceeds z times the mean noise with probability M exp(-z) (Scargle, Astrophysical Journal 263, 1982). The noise is that
of the neighbourhood, because what a fit leaves of gears is not white. Waves that the ratios and the machine file
suggest are tried alone, so they need to stand out less.

Pitch errors of single teeth are a little of every wave, and none stands out. A tooth says nothing about its neighbour
either, so stretches left out of a fit, which choose the order of a smooth map, cannot tell them. Another pass over the
same teeth can: waves fitted to the turn one way must predict the turn the other way, and are used as far as they do.
Waves that are fitted to a part of a turn run away where nothing was read, as in the last degrees of a travel. There the
teeth are taken for perfect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.identification.least_squares import BETTER
from gantryctl.engineering.identification.samples import Floats, Samples

# Chance that noise is taken for a wave.
_FALSE_ALARM: Final = 1e-4
# Tried waves per resolution (one cycle over the whole way); half of it on either side of a found one is the same wave.
_OVERSAMPLING: Final = 4
_STEPS_PER_RADIAN: Final = 5.0
# The noise of a neighbourhood: its median, so that single waves count little, so many resolutions to either side.
_NEIGHBOURS: Final = 20
_FEWEST: Final = 8
# Power that a whole or expected number of waves may lack against the best fractional one: noise moves the top by less.
_SAME_TOP: Final = 6.0
# More are no single waves.
_MOST: Final = 24
# Correlation of strangers, in standard deviations: the chance to be above is that of a false wave.
_CHANCE: Final = 3.7


class Band(NamedTuple):
    """Waves per turn among which to search, both ends included."""

    low: float
    high: float

    def holds(self, cycles: float) -> bool:
        """Whether a wave lies in it."""
        return self.low <= cycles <= self.high


class Spectrum(NamedTuple):
    """Power of waves over the angle; noise of variance s2 has the mean power s2.

    Attributes:
        cycles: per turn. power: of each. noise: mean power around each. resolution: cycles per turn.
    """

    cycles: Floats
    power: Floats
    noise: Floats
    resolution: float

    @property
    def tried(self) -> float:
        """Independent waves among those tried."""
        return max(1.0, float(self.cycles[-1] - self.cycles[0]) / self.resolution)


def spectrum(angle_rad: Floats, left_rad: Floats, band: Band) -> Spectrum:
    """Spectrum of what a fit leaves.

    Args:
        angle_rad, left_rad: shape (samples,).
    """
    way = float(np.ptp(angle_rad))
    resolution = 2.0 * math.pi / way
    # Angles in steps of a tenth of a radian of the fastest wave: one transform instead of a sum per wave.
    count = 2 ** math.ceil(math.log2(_STEPS_PER_RADIAN * band.high * way))
    place = np.minimum((angle_rad - angle_rad.min()) * (count / way), count - 1).astype(np.int64)
    folded = np.bincount(place, weights=left_rad, minlength=count)
    power: Floats = np.abs(np.fft.rfft(folded, _OVERSAMPLING * count)) ** 2 / float(len(angle_rad))
    cycles = resolution / _OVERSAMPLING * np.arange(len(power))
    inside = (cycles >= band.low) & (cycles <= band.high)
    power = np.asarray(power[inside], dtype=np.float64)
    return Spectrum(np.asarray(cycles[inside], dtype=np.float64), power, _noise(power), resolution)


def _noise(power: Floats) -> Floats:
    """Mean power of the noise around each wave, by the median: of exponentially distributed power mean x ln 2.

    The larger of both sides: noise that falls with the number of waves would look like a wave from above.
    """
    width = min(len(power), _NEIGHBOURS * _OVERSAMPLING)
    around = np.pad(power, width, mode="reflect" if width < len(power) else "edge")
    medians = np.median(np.lib.stride_tricks.sliding_window_view(around, width), axis=1)
    below, above = medians[: len(power)], medians[width + 1 : width + 1 + len(power)]
    return np.asarray(np.maximum(below, above) / math.log(2.0))


def find_waves(
    angle_rad: Floats,
    left_of: Callable[[Sequence[float]], Floats],
    band: Band,
    expected: Sequence[float],
) -> list[float]:
    """Waves per turn that stand out of what a fit leaves, strongest first, those expected first of all.

    Args:
        left_of: what the fit with these waves leaves, shape (samples,).
        expected: waves that ratios or people suggest.
    """
    # Fewer resolutions than these have no neighbourhood to stand out of.
    if (band.high - band.low) * float(np.ptp(angle_rad)) < 2.0 * math.pi * _FEWEST:
        return []
    suggested = [c for c in dict.fromkeys(expected) if band.holds(c)]
    found: list[float] = []
    left = left_of(found)
    first = spectrum(angle_rad, left, band)
    for c in suggested:
        # Nearer than the resolution two waves are one: of several that are suggested the first is taken.
        if any(abs(c - other) < first.resolution for other in found):
            continue
        nearest = int(np.argmin(np.abs(first.cycles - c)))
        if _power(angle_rad, left, c) > _threshold(len(suggested)) * first.noise[nearest]:
            found.append(c)
    for _ in range(_MOST - len(found)):
        left = left_of(found)
        now = spectrum(angle_rad, left, band)
        # A found wave is fitted: what stands beside it within the resolution is its own foot.
        near = np.zeros(len(now.cycles), dtype=bool)
        for c in found:
            near |= np.abs(now.cycles - c) < now.resolution
        excess = np.where(near, 0.0, now.power / now.noise)
        top = int(np.argmax(excess))
        if excess[top] <= _threshold(now.tried):
            break
        found.append(_refined(angle_rad, left, now, top, expected))
    return found


def _threshold(tried: float) -> float:
    return math.log(tried / _FALSE_ALARM)


def _power(angle_rad: Floats, left_rad: Floats, cycles: float) -> float:
    return float(abs(np.sum(left_rad * np.exp(-1j * cycles * angle_rad))) ** 2 / len(angle_rad))


def _refined(
    angle_rad: Floats, left_rad: Floats, seen: Spectrum, top: int, expected: Sequence[float]
) -> float:
    """The wave at a top of the spectrum: one that is expected or whole where noise hides the difference."""
    step = seen.resolution / _OVERSAMPLING
    inner = min(max(top, 1), len(seen.cycles) - 2)
    before, at, after = seen.power[inner - 1 : inner + 2]
    bend = before - 2.0 * at + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    best = float(seen.cycles[inner] + step * min(max(shift, -1.0), 1.0))
    least = max(at, _power(angle_rad, left_rad, best)) - _SAME_TOP * seen.noise[top]
    for c in (*sorted(expected, key=lambda c: abs(c - best)), float(round(best))):
        if abs(c - best) < 0.5 * seen.resolution and _power(angle_rad, left_rad, c) >= least:
            return c
    return best


class ToothWaves(NamedTuple):
    """What waves of one turn say about the other.

    Attributes:
        cycles: per turn. sines_rad: sine and cosine of each, by both turns, as far as they come again.
        left_part: waves of one turn leave this part of what the smooth map leaves of the other turn (r.m.s.).
        half_width: of its 95 % interval.
        alike: correlation of the waves of both turns, in standard deviations of that of strangers.
    """

    cycles: range
    sines_rad: Floats
    left_part: float
    half_width: float
    alike: float

    @property
    def come_again(self) -> bool:
        """They belong to the gears, or to what else stays at its angle."""
        return self.left_part < BETTER and self.alike > _CHANCE


def tooth_waves(turns: Samples, left_rad: Floats, cycles: range) -> ToothWaves:
    """Predict each turn by the other.

    Args:
        left_rad: what the smooth map leaves. cycles: waves per turn beyond it.
    """
    columns = waves_of(turns.act_rad, cycles)
    ways = [turns.direction == sign for sign in (1.0, -1.0)]
    unread = [_unread(turns.act_rad[way], cycles) for way in ways]
    squares = [columns[way].T @ columns[way] for way in ways]
    sums = [columns[way].T @ left_rad[way] for way in ways]
    one, other = (np.linalg.solve(a + b, c) for a, b, c in zip(squares, unread, sums, strict=True))
    products = one * other
    common = max(0.0, float(products.sum()))
    rest = left_rad.copy()
    for found, way in ((one, ways[1]), (other, ways[0])):
        rest[way] -= common / float(found @ found) * (columns[way] @ found)
    both = np.linalg.solve(squares[0] + squares[1] + _unread(turns.act_rad, cycles), sums[0] + sums[1])
    # Of strangers each product has either sign, however large their slow waves are: a few waves prove nothing. Waves
    # that a short travel cannot tell apart count once.
    turn = min(1.0, float(np.ptp(turns.act_rad)) / (2.0 * math.pi))
    alike = math.sqrt(turn) * float(products.sum() / np.linalg.norm(products))
    share = min(1.0, common / float(both @ both))
    return ToothWaves(cycles, share * both, *_part_of(rest, left_rad, turns.stretch), alike)


def _unread(angle_rad: Floats, cycles: range) -> Floats:
    """Squares of the columns over the rest of the turn, as densely as samples lie on the way that was read."""
    low, way = float(angle_rad.min()), float(np.ptp(angle_rad))
    count = max(0, round(len(angle_rad) * (2.0 * math.pi / way - 1.0)))
    columns = waves_of(np.linspace(low + way, low + 2.0 * math.pi, count), cycles)
    return np.asarray(columns.T @ columns)


def _part_of(rest: Floats, whole: Floats, stretch: Floats) -> tuple[float, float]:
    """Ratio of two r.m.s. with half of its 95 % interval, by what each stretch has of both (ratio estimator)."""
    from scipy.stats import t

    piece = np.unique(stretch, return_inverse=True)[1]
    above, below = (np.bincount(piece, weights=values**2) for values in (rest, whole))
    part, count = float(above.sum() / below.sum()), len(above)
    off = above - part * below
    deviation = math.sqrt(count / (count - 1) * float(off @ off)) / float(below.sum())
    return math.sqrt(part), float(t.ppf(0.975, count - 1)) * deviation / (2.0 * math.sqrt(part))


def waves_of(angle_rad: Floats, cycles: Sequence[float]) -> Floats:
    """Columns sin(c x), cos(c x) for each c: shape (samples, 2 x cycles)."""
    columns = [f(c * angle_rad) for c in cycles for f in (np.sin, np.cos)]
    return np.stack(columns, axis=1) if columns else np.empty((len(angle_rad), 0))
