"""Effect of the instrument's noise on A: many draws over the same readings, and the floor of the noise alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gantryctl.engineering.accuracy.procedure.procedures import (
    Procedure,
    errors_from_points,
    evaluate,
    target_points,
)
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.accuracy.table import ErrorTable, FloatArray

# One draw of the noise says little about A; median and 5..95 % of this many do.
DRAWS = 500


@dataclass(frozen=True)
class Distribution:
    """Median and 5..95 % of a figure over repeated draws, deg."""

    median_deg: float
    low_deg: float
    high_deg: float
    draws: int

    @classmethod
    def of(cls, values_deg: ArrayLike) -> Distribution:
        """The distribution of these values."""
        values = np.asarray(values_deg, dtype=np.float64)
        low, median, high = np.percentile(values, [5.0, 50.0, 95.0])
        return cls(float(median), float(low), float(high), values.size)


@dataclass(frozen=True)
class ChordResult:
    """One chord test with noise off and on, kept apart.

    Attributes:
        true: the table of the true angles.
        measured: the table of one draw of the noise.
        a_measured: A over `DRAWS` draws; its median is "A as measured".
        a_floor: A of an axis without any error, from the noise alone.
    """

    true: ErrorTable
    measured: ErrorTable
    a_measured: Distribution
    a_floor: Distribution


def a_draws(
    procedure: Procedure,
    readings_rad: ArrayLike,
    radius_m: float,
    sigma_m: float,
    draws: int = DRAWS,
    seed: int = 0,
) -> FloatArray:
    """A by eq. (6) for `draws` draws of the noise over the same readings, deg, shape (draws,)."""
    points = target_points(np.asarray(readings_rad, dtype=np.float64), radius_m)
    noise = np.random.default_rng(seed).normal(0.0, sigma_m, (draws, *points.shape))
    return accuracy_a(errors_from_points(procedure, points + noise, radius_m))


def noise_floor(
    procedure: Procedure, radius_m: float, sigma_m: float, draws: int = DRAWS, seed: int = 0
) -> Distribution:
    """A of a perfect axis, seen through the noise."""
    # Noise never averages out of A, which is made of standard deviations: an axis without any error has one.
    # It is proportional to noise over radius.
    return Distribution.of(a_draws(procedure, procedure.targets_rad, radius_m, sigma_m, draws, seed))


def chord_result(
    procedure: Procedure, readings_rad: ArrayLike, radius_m: float, sigma_m: float, seed: int = 0
) -> ChordResult:
    """Tables and distributions of one chord test; `readings_rad` are the true mean angles of the dwells."""
    return ChordResult(
        true=evaluate(procedure, readings_rad, radius_m),
        measured=evaluate(procedure, readings_rad, radius_m, sigma_m, seed),
        a_measured=Distribution.of(a_draws(procedure, readings_rad, radius_m, sigma_m, seed=seed)),
        a_floor=noise_floor(procedure, radius_m, sigma_m, seed=seed),
    )
