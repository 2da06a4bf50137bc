"""Uncertainty of a chord test from the uncertainties of its readings: GUM (JCGM 100:2008), eq. 10, k = 2.

Readings are taken as independent. Of what two readings share (the centre of the circle, a scale, a drift) a chord of
some ten degrees sees the difference only, less than two independent errors of the same size would leave: the figures
are on the safe side. What a reading does not say of itself (a target that slips) is in no uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from gantryctl.engineering.accuracy.noise import Distribution
from gantryctl.engineering.accuracy.procedure.procedures import Procedure, errors_from_points, target_points
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.accuracy.table import FloatArray

# Coverage factor: about 95 % (GUM, 6.3.3 and G.6.6).
COVERAGE_K: Final = 2.0
# Step of the derivatives: far above rounding, far below what turns the maximum of eq. (6) to another column.
_STEP_DEG: Final = 1e-7
_DRAWS: Final = 500


@dataclass(frozen=True, eq=False)
class ChordUncertainty:
    """Standard uncertainties of a chord test, deg.

    Attributes:
        chord_deg: of every chord error, shape (rows, columns), the zero column 0.
        a_deg: of A by eq. (6).
        floor: A of a perfect axis through readings of these uncertainties; it is part of A as measured.
    """

    chord_deg: FloatArray
    a_deg: float
    floor: Distribution

    @property
    def largest_chord_deg(self) -> float:
        """Of the least certain chord."""
        return float(self.chord_deg.max())


def chord_uncertainty(
    procedure: Procedure, angles_deg: FloatArray, uncertainties_deg: FloatArray, seed: int = 0
) -> ChordUncertainty:
    """Uncertainties of the table and of A.

    Args:
        angles_deg: of every stop, shape (stops,).
        uncertainties_deg: standard uncertainty of each, 0 where nothing is read.
        seed: of the draws of the floor.
    """
    variance = np.zeros_like(_errors(procedure, angles_deg))
    a_variance = 0.0
    for index in np.flatnonzero(uncertainties_deg):
        step = np.zeros_like(angles_deg)
        step[index] = _STEP_DEG
        up, down = _errors(procedure, angles_deg + step), _errors(procedure, angles_deg - step)
        squared = float(uncertainties_deg[index]) ** 2
        variance += ((up - down) / (2.0 * _STEP_DEG)) ** 2 * squared
        slope = float(accuracy_a(up) - accuracy_a(down)) / (2.0 * _STEP_DEG)
        a_variance += slope**2 * squared
    drawn = np.random.default_rng(seed).normal(0.0, 1.0, (_DRAWS, len(angles_deg))) * uncertainties_deg
    floor = accuracy_a(_errors(procedure, np.degrees(procedure.targets_rad) + drawn))
    return ChordUncertainty(np.sqrt(variance), float(np.sqrt(a_variance)), Distribution.of(floor))


def _errors(procedure: Procedure, angles_deg: FloatArray) -> FloatArray:
    """Chord errors of angles, deg: (..., stops) -> (..., rows, columns); the radius of the circle cancels."""
    return errors_from_points(procedure, target_points(np.radians(angles_deg), 1.0), 1.0)
