"""Laws of a factor: a number between 0 and 1 to a value, by the inverse of the distribution function."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.campaign.tables import (
    DiscreteTable,
    GearGradeTable,
    LognormalTable,
    NormalTable,
    UniformTable,
)

Floats = NDArray[np.float64]
Law = UniformTable | NormalTable | LognormalTable | DiscreteTable | GearGradeTable

# Grade whose tolerances the amplitudes of [plant.gear_error] have with scale 1.
GRADE_OF_SCALE_1: Final = 8.0


def grade_scale(grade: float) -> float:
    """Amplitudes of a gear of this grade against grade 8: tolerances grow by sqrt(2) a grade (ISO 1328-1)."""
    return float(2.0 ** (0.5 * (grade - GRADE_OF_SCALE_1)))


def quantile(law: Law, unit: Floats) -> Floats:
    """Values of a law at these places of its distribution function, 0 to 1; any shape.

    A place of exactly 0 or 1 gives an infinite value of laws without ends: the checks of the machine refuse it.
    """
    from scipy.special import ndtri

    if isinstance(law, UniformTable):
        return np.asarray(law.low + (law.high - law.low) * unit)
    if isinstance(law, NormalTable):
        return np.asarray(law.mean + law.deviation * ndtri(unit))
    if isinstance(law, LognormalTable):
        return np.asarray(law.median * np.exp(math.log(law.spread) * ndtri(unit)))
    values, weights = _values(law)
    upper = np.cumsum(weights / weights.sum())
    # The last sum may end just below 1 by rounding.
    return np.asarray(values[np.minimum(np.searchsorted(upper, unit, side="right"), len(values) - 1)])


def range_of(law: Law) -> tuple[float, float]:
    """Smallest and largest value; infinite where a law has no end."""
    if isinstance(law, NormalTable):
        return -math.inf, math.inf
    if isinstance(law, LognormalTable):
        return 0.0, math.inf
    ends = np.array([law.low, law.high]) if isinstance(law, UniformTable) else _values(law)[0]
    return float(np.min(ends)), float(np.max(ends))


def _values(law: DiscreteTable | GearGradeTable) -> tuple[Floats, Floats]:
    """Values that occur, and their weights."""
    values = [grade_scale(grade) for grade in law.grades] if isinstance(law, GearGradeTable) else law.values
    weights = np.array(law.weights or (1.0,) * len(values))
    return np.array(values)[weights > 0.0], weights[weights > 0.0]
