"""Closed forms of move times, rest to rest. Any consistent units (deg or rad)."""

from __future__ import annotations

import math

from gantryctl.errors import UsageError


def trapezoid_time_s(distance: float, vel_max: float, acc: float) -> float:
    """Duration of a trapezoid: d/V + V/a, or 2 sqrt(d/a) when the speed limit is not reached."""
    distance = abs(distance)
    if distance < vel_max**2 / acc:
        return 2.0 * math.sqrt(distance / acc)
    return distance / vel_max + vel_max / acc


def trapezoid_peak_speed(distance: float, vel_max: float, acc: float) -> float:
    """Highest speed of a trapezoid of this length."""
    return min(vel_max, math.sqrt(abs(distance) * acc))


def shortest_trapezoid_reaching(vel_max: float, acc: float) -> float:
    """The shortest move that reaches the speed limit: V^2/a."""
    return vel_max**2 / acc


def double_s_time_s(distance: float, vel_max: float, acc: float, jerk: float) -> float:
    """Duration of a jerk-limited move that reaches both limits: d/V + V/a + a/j.

    Raises:
        UsageError: the move is too short to reach the speed limit, or the limits too close to reach the
            acceleration.
    """
    distance = abs(distance)
    ramp = vel_max / acc + acc / jerk
    if acc**2 > vel_max * jerk or distance < vel_max * ramp:
        raise UsageError(
            f"double-S closed form: a move of {distance:g} does not reach both {vel_max:g}/s and {acc:g}/s2; "
            f"it needs at least {vel_max * ramp:g} and a jerk of at least {acc**2 / vel_max:g}/s3"
        )
    return distance / vel_max + ramp
