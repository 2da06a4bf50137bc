"""A laser tracker that sees a target on the gantry."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gantryctl.errors import UsageError


class Tracker:
    """Measures the point of a target on a circle, with Gaussian noise on both coordinates.

    Args:
        radius_m: distance of the target from the axis of rotation.
        sigma_m: noise of each coordinate, 1 sigma; 0 = exact.
        rng: source of the noise; the same seed gives the same readings.
    """

    name = "tracker"
    measures_load = True

    def __init__(self, radius_m: float, sigma_m: float, rng: np.random.Generator) -> None:
        if not (math.isfinite(radius_m) and radius_m > 0.0):
            raise UsageError(f"tracker: radius = {radius_m} m: must be above 0")
        if not (math.isfinite(sigma_m) and sigma_m >= 0.0):
            raise UsageError(f"tracker: noise = {sigma_m} m: must be 0 or above")
        self.radius_m = radius_m
        self.sigma_m = sigma_m
        self._rng = rng

    def point_m(self, samples_rad: Sequence[float]) -> tuple[float, float]:
        """One measured point (x, y), m, of a dwell; takes the mean angle of the load."""
        angle = samples_rad[0]
        dx, dy = self._rng.normal(0.0, self.sigma_m, 2) if self.sigma_m > 0.0 else (0.0, 0.0)
        return self.radius_m * math.cos(angle) + float(dx), self.radius_m * math.sin(angle) + float(dy)

    def reading_rad(self, samples_rad: Sequence[float]) -> float:
        """The angle of the measured point, rad, on the turn where the load is."""
        angle = samples_rad[0]
        x, y = self.point_m(samples_rad)
        # seen from the true direction the point lies ahead by `along` and aside by `across`
        along = x * math.cos(angle) + y * math.sin(angle)
        across = y * math.cos(angle) - x * math.sin(angle)
        return angle + math.atan2(across, along)
