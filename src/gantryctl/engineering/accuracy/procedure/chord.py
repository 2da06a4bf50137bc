"""Geometry of a target on a circle: points, chords, angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gantryctl.engineering.accuracy.table import FloatArray


def target_points(angles_rad: ArrayLike, radius_m: float) -> FloatArray:
    """Coordinates of a target on the gantry, m: shape (...) of angles -> (..., 2)."""
    return np.asarray(radius_m * np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=-1))


def chord_m(angle_rad: ArrayLike, radius_m: float) -> FloatArray:
    """The theoretical chord of an angle, m: c = 2 R |sin(angle / 2)|."""
    return np.asarray(2.0 * radius_m * np.abs(np.sin(np.asarray(angle_rad) / 2.0)))


def chord_between(points_m: FloatArray, others_m: FloatArray) -> FloatArray:
    """Distance of two points, m: (..., 2) and (..., 2) -> (...)."""
    difference = points_m - others_m
    return np.asarray(np.hypot(difference[..., 0], difference[..., 1]))


def chord_angle_rad(chord: ArrayLike, radius_m: float) -> FloatArray:
    """The angle of a chord, rad: 2 asin(c / 2R). A chord beyond the diameter counts as the diameter."""
    return np.asarray(2.0 * np.arcsin(np.minimum(np.asarray(chord) / (2.0 * radius_m), 1.0)))


def chord_sensitivity_m_per_rad(angle_rad: float, radius_m: float) -> float:
    """How much a chord grows per angle, m/rad: dc/d(angle) = R cos(angle / 2)."""
    return float(radius_m * np.cos(angle_rad / 2.0))
