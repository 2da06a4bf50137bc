"""A simulated laser tracker with the errors that a real one leaves in an angle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from gantryctl.engineering.instruments.port import Reading, checked
from gantryctl.errors import UsageError
from gantryctl.units import deg, rad

_HOUR_S: Final = 3600.0


@dataclass(frozen=True)
class TrackerErrors:
    """Errors of a tracker that watches a target on a circle; each a standard uncertainty (1 sigma).

    Noise is drawn for every reading. Of the others one value is drawn for a set-up, because that is how they act: the
    same error in every reading of a day.

    Attributes:
        radius_m: of the target's circle.
        noise_um: of one reading, along the circle.
        eccentricity_um: centre of the circle that was fitted, from the axis of rotation, each coordinate.
        scale_ppm: of the radius: a circle that is too large shows angles that are too small.
        drift_um_h: of the tracker's stand along the circle, per hour.
    """

    radius_m: float = 2.5
    noise_um: float = 10.0
    # A circle through some dozen points of 10 um on two thirds of a turn. An estimate.
    eccentricity_um: float = 10.0
    # Steel grows by 11.5 ppm a kelvin, and the gantry is not measured warmer than half a kelvin. An estimate.
    scale_ppm: float = 5.0
    # Stands in air-conditioned rooms creep by some 0.01 mm an hour. An estimate.
    drift_um_h: float = 10.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius_m) and self.radius_m > 0.0):
            raise UsageError(f"tracker: radius {self.radius_m:g} m: must be above 0")
        for name in ("noise_um", "eccentricity_um", "scale_ppm", "drift_um_h"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise UsageError(f"tracker: {name} = {value:g}: must be 0 or above")

    def standard_uncertainty_deg(self, angle_deg: float, time_s: float) -> float:
        """Of one reading at this angle, this long after the set-up; the parts added as squares (GUM, eq. 10)."""
        along_um = math.hypot(self.noise_um, self.eccentricity_um, self.drift_um_h * time_s / _HOUR_S)
        return math.hypot(deg(along_um * 1e-6 / self.radius_m), self.scale_ppm * 1e-6 * angle_deg)


class SimulatedTracker:
    """Reads the true angle of a simulated load, with errors, and states their uncertainty.

    Args:
        truth_deg: true angle of the load in space at a time, deg.
        seed: of the set-up and of the noise.
        errors: how large they are.
    """

    def __init__(self, truth_deg: Callable[[float], float], seed: int, errors: TrackerErrors) -> None:
        self._truth_deg, self.errors = truth_deg, errors
        self._rng = np.random.default_rng(seed)
        drawn = self._rng.normal(0.0, 1.0, 4).tolist()
        self._centre_um = (errors.eccentricity_um * drawn[0], errors.eccentricity_um * drawn[1])
        self._scale, self._drift_um_h = errors.scale_ppm * 1e-6 * drawn[2], errors.drift_um_h * drawn[3]
        self.name = f"simulated tracker, seed {seed}"

    def read(self, time_s: float) -> Reading:
        """One reading at a time of the axis, s.

        Raises:
            InstrumentError: the true angle is not one that can be read.
        """
        true_deg = self._truth_deg(time_s)
        x_um, y_um = self._centre_um
        theta = rad(true_deg)
        # Seen from (x, y), a point at R (cos, sin) lies at theta + (x sin - y cos) / R, to first order in x/R, y/R.
        along_um = x_um * math.sin(theta) - y_um * math.cos(theta) + self._drift_um_h * time_s / _HOUR_S
        along_um += self.errors.noise_um * float(self._rng.normal())
        angle_deg = true_deg * (1.0 + self._scale) + deg(along_um * 1e-6 / self.errors.radius_m)
        return checked(Reading(angle_deg, self.errors.standard_uncertainty_deg(true_deg, time_s)), self.name)
