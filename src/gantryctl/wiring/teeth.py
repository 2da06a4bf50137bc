"""Pitch deviations of the single teeth of [plant.tooth_pitch], drawn within the limits of ISO 1328-1.

ISO 1328-1:1995 gives, in um for grade 5 and times sqrt(2) a grade, with the module m and the pitch diameter d in mm:
total cumulative pitch deviation F_p = 0.3 m + 1.25 sqrt(d) + 7, single pitch deviation
f_pt = 0.3 (m + 0.4 sqrt(d)) + 4.
"""

from __future__ import annotations

import functools
import math
import random
from typing import Final

from gantryctl.machine.tables.plant import RING_HARMONICS

# Numbers of 0..1 in a sum: its twelfth moment is near that of a normal one, and adding is exact everywhere.
_SUMMANDS: Final = 12


def pitch_deviation_um(module_mm: float, diameter_mm: float, grade: float) -> float:
    """F_p: total cumulative pitch deviation, peak to peak over the turn."""
    return (0.3 * module_mm + 1.25 * math.sqrt(diameter_mm) + 7.0) * _grade(grade)


def single_pitch_um(module_mm: float, diameter_mm: float, grade: float) -> float:
    """f_pt: single pitch deviation, plus or minus."""
    return (0.3 * (module_mm + 0.4 * math.sqrt(diameter_mm)) + 4.0) * _grade(grade)


def _grade(grade: float) -> float:
    return math.pow(2.0, 0.5 * (grade - 5.0))


def ring_deviations_um(teeth: int, module_mm: float, grade: float, seed: int) -> tuple[float, ...]:
    """Cumulative pitch deviation of each tooth of the ring, um, without the waves of `ring_um`."""
    return _drawn(teeth, module_mm, grade, seed, RING_HARMONICS)


def pinion_deviations_um(teeth: int, module_mm: float, grade: float, seed: int) -> tuple[float, ...]:
    """The same of the pinion, without its run-out."""
    return _drawn(teeth, module_mm, grade, seed, 1)


@functools.lru_cache(maxsize=64)
def _drawn(teeth: int, module_mm: float, grade: float, seed: int, long_waves: int) -> tuple[float, ...]:
    """The worst gear that still passes its grade.

    Independent deviations of nearly normal distribution, without mean and the first waves of a turn, which other keys
    give, scaled until the largest single pitch deviation is f_pt or the range of all F_p, whichever comes first.
    """
    drawn = random.Random(f"{seed}, {teeth} teeth")  # noqa: S311 - teeth that can be repeated, no secret
    raw = [sum(drawn.random() for _ in range(_SUMMANDS)) for _ in range(teeth)]
    left = _without_long_waves(raw, long_waves)
    diameter_mm = module_mm * teeth
    largest = max(abs(left[k] - left[k - 1]) for k in range(teeth))
    span = max(left) - min(left)
    factor = min(
        single_pitch_um(module_mm, diameter_mm, grade) / largest,
        pitch_deviation_um(module_mm, diameter_mm, grade) / span,
    )
    return tuple(factor * each for each in left)


def _without_long_waves(values: list[float], waves: int) -> list[float]:
    count = len(values)
    mean = sum(values) / count
    left = [each - mean for each in values]
    for wave in range(1, waves + 1):
        angles = [2.0 * math.pi * wave * k / count for k in range(count)]
        sine = 2.0 / count * sum(v * math.sin(a) for v, a in zip(left, angles, strict=True))
        cosine = 2.0 / count * sum(v * math.cos(a) for v, a in zip(left, angles, strict=True))
        left = [v - sine * math.sin(a) - cosine * math.cos(a) for v, a in zip(left, angles, strict=True)]
    return left
