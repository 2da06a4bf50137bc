"""The wind of [plant.wind] as waves of its moment: von Karman's spectrum through the admittance of the surface.

The longitudinal gusts v of a mean wind U have the one-sided spectrum S_v(f) = 4 s^2 (L/U) / (1 + 70.8 (f L/U)^2)^(5/6)
(von Karman; EN 61400-1, annex C), s = turbulence x U. A surface of width w does not feel gusts smaller than itself:
chi^2(f) = 1 / (1 + (2 f w / U)^(4/3))^2 (Vickery 1965). The moment goes with the square of the speed, so that small
gusts change it by twice their part: S_M = (2 M / U)^2 chi^2 S_v.
"""

from __future__ import annotations

import functools
import math
import random
from itertools import pairwise
from typing import Final, NamedTuple

from gantryctl.machine.tables.plant import WindTable

WAVES: Final = 24
# Below, the wind is its mean over ten minutes; above, 5e-4 of the gusts of a surface of 10 m are left.
_LOWEST_HZ, _HIGHEST_HZ = 1.0 / 600.0, 3.0
# Of each wave, for the sum over the spectrum.
_PARTS: Final = 20


class WindWaves(NamedTuple):
    """Gusts of the moment: amplitudes in N m, rates in rad/s, phases in rad, `WAVES` of each."""

    amplitude_nm: tuple[float, ...]
    rate_rad_s: tuple[float, ...]
    phase_rad: tuple[float, ...]


def moment_spectrum(wind: WindTable, frequency_hz: float) -> float:
    """One-sided spectrum of the moment, (N m)^2/Hz."""
    length_s = wind.length_m / wind.speed_m_s
    gusts = (
        4.0 * wind.turbulence**2 * length_s / math.pow(1.0 + 70.8 * (frequency_hz * length_s) ** 2, 5.0 / 6.0)
    )
    felt = 1.0 / (1.0 + math.pow(2.0 * frequency_hz * wind.width_m / wind.speed_m_s, 4.0 / 3.0)) ** 2
    return 4.0 * wind.moment_nm**2 * felt * gusts


@functools.lru_cache(maxsize=64)
def wind_waves(wind: WindTable) -> WindWaves:
    """The gusts: bands of equal ratios, each a wave with the energy of its band; phases by the seed."""
    ratio = math.pow(_HIGHEST_HZ / _LOWEST_HZ, 1.0 / WAVES)
    drawn = random.Random(wind.seed)  # noqa: S311 - gusts that can be repeated, no secret
    amplitudes, rates, phases = [], [], []
    for band in range(WAVES):
        low = _LOWEST_HZ * ratio**band
        edges = [low * math.pow(ratio, k / _PARTS) for k in range(_PARTS + 1)]
        energy = sum(
            0.5 * (moment_spectrum(wind, a) + moment_spectrum(wind, b)) * (b - a) for a, b in pairwise(edges)
        )
        amplitudes.append(math.sqrt(2.0 * energy))
        # Anywhere in its band: waves of one ratio would beat.
        rates.append(2.0 * math.pi * low * math.pow(ratio, drawn.random()))
        phases.append(2.0 * math.pi * drawn.random())
    return WindWaves(tuple(amplitudes), tuple(rates), tuple(phases))
