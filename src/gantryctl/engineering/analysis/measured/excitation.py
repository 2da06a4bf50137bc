"""Periodic test signals: sums of sines that fit a whole number of times into their period."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gantryctl.engineering.analysis.models.linear import FloatArray
from gantryctl.engineering.analysis.models.sampled import Input
from gantryctl.errors import UsageError

# Above this the torque accelerates the rotor alone, and grows with frequency at constant speed amplitude.
ROLL_OFF_HZ = 5.0


@dataclass(frozen=True)
class Excitation:
    """Signal added to speed command or torque: amplitude x sum of weight_k sin(2 pi line_k t/period + phase_k).

    Attributes:
        where: speed command (rad/s at the motor) or torque feed-forward (N m).
        period_s: of the whole signal.
        lines: whole numbers of cycles in the period, ascending. weights, phases_rad: of each line.
        amplitude: factor on the whole signal.
    """

    where: Input
    period_s: float
    lines: tuple[int, ...]
    weights: tuple[float, ...]
    phases_rad: tuple[float, ...]
    amplitude: float

    @property
    def hz(self) -> FloatArray:
        """Frequencies of the lines."""
        return np.array(self.lines) / self.period_s

    def period(self, scan_s: float) -> FloatArray:
        """One period, one value per scan."""
        total = _sum_of_sines(round(self.period_s / scan_s), self.lines, self.weights, self.phases_rad)
        return np.asarray(self.amplitude * total)


# Of one signal at several amplitudes.
@lru_cache(maxsize=16)
def _sum_of_sines(
    n: int, lines: tuple[int, ...], weights: tuple[float, ...], phases_rad: tuple[float, ...]
) -> FloatArray:
    angle = 2.0 * math.pi / n * np.arange(n, dtype=np.float64)
    total = np.zeros(n)
    for line, weight, phase in zip(lines, weights, phases_rad, strict=True):
        total += weight * np.sin(line * angle + phase)
    return total


def multisine(
    where: Input,
    low_hz: float,
    high_hz: float,
    count: int,
    scan_s: float,
    period_s: float = 16.0,
    roll_off_hz: float = ROLL_OFF_HZ,
) -> Excitation:
    """All frequencies at once: `count` lines from low to high in about equal ratios, small crest factor (Schroeder).

    Above `roll_off_hz` the speed amplitude falls as 1/f, so that the torque to accelerate the rotor stays about
    constant; an amplitude of 1 is then 1 rad/s (or 1 N m) in each of the low lines.

    Raises:
        UsageError: frequencies that the scan cannot carry or that do not fit into the period.
    """
    nyquist = 0.5 / scan_s
    if not 1.0 / period_s <= low_hz < high_hz < nyquist:
        raise UsageError(
            f"frequencies {low_hz:g}..{high_hz:g} Hz: must rise and lie within {1.0 / period_s:g} Hz (one cycle in "
            f"{period_s:g} s) and {nyquist:g} Hz (half the scan rate)"
        )
    wanted = np.geomspace(low_hz, high_hz, count) * period_s
    # Whole cycles in the period: no line leaks into another.
    lines = np.unique(np.round(wanted).astype(int))
    roll_off = roll_off_hz if where is Input.SPEED else math.inf
    weights = 1.0 / np.maximum(1.0, lines / period_s / roll_off)
    power = weights**2 / np.sum(weights**2)
    # Schroeder's phases (IEEE Trans. Inf. Theory, 1970) keep the crest factor of the sum small.
    phases = -2.0 * math.pi * np.cumsum(np.cumsum(power) - power) * lines.size / 2.0
    return Excitation(
        where, period_s, tuple(lines.tolist()), tuple(weights.tolist()), tuple(phases.tolist()), 1.0
    )
