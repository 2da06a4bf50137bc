"""Closed forms of move times, rest to rest. Any consistent units (deg or rad)."""

from __future__ import annotations

import math


def trapezoid_time_s(distance: float, vel_max: float, acc: float) -> float:
    """Duration of a trapezoid: d/V + V/a, or 2 sqrt(d/a) when the speed limit is not reached."""
    distance = abs(distance)
    # Shorter moves turn from acceleration to deceleration below the speed limit: a triangle.
    if distance < vel_max**2 / acc:
        return 2.0 * math.sqrt(distance / acc)
    return distance / vel_max + vel_max / acc


def trapezoid_peak_speed(distance: float, vel_max: float, acc: float) -> float:
    """Highest speed of a trapezoid of this length."""
    return min(vel_max, math.sqrt(abs(distance) * acc))


def shortest_trapezoid_reaching(vel_max: float, acc: float) -> float:
    """The shortest move that reaches the speed limit: V^2/a."""
    return vel_max**2 / acc
