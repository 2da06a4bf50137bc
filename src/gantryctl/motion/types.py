"""Start and limits of a plan."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from gantryctl.errors import CommandRefused


class SetPoint(NamedTuple):
    """The set-point at one instant, at the gantry."""

    pos_rad: float
    vel_rad_s: float = 0.0
    acc_rad_s2: float = 0.0

    def checked(self) -> SetPoint:
        """Return itself, or raise CommandRefused for a value that is not finite."""
        for name, value in zip(self._fields, self, strict=True):
            if not math.isfinite(value):
                raise CommandRefused(f"set-point {name} must be a finite number, got {value}")
        return self


_MAY_BE_INFINITE: Final = ("jerk_rad_s3", "end_dec_rad_s2", "end_jerk_rad_s3")


class MotionLimits(NamedTuple):
    """Largest speed and its changes, all positive, at the gantry.

    Attributes:
        acc_rad_s2, dec_rad_s2: what speeds the axis up and slows it down, whichever way it travels.
        jerk_rad_s3: inf gives trapezoids.
        end_dec_rad_s2, end_jerk_rad_s3: a move to an angle ends with this deceleration, released by this jerk; inf ends
            it as its ramp is.
    """

    vel_rad_s: float
    acc_rad_s2: float
    dec_rad_s2: float
    jerk_rad_s3: float = math.inf
    end_dec_rad_s2: float = math.inf
    end_jerk_rad_s3: float = math.inf

    def checked(self) -> MotionLimits:
        """Return itself, or raise CommandRefused unless every limit is above 0 and, but for jerk and end, finite."""
        for name, value in zip(self._fields, self, strict=True):
            if not value > 0.0 or (math.isinf(value) and name not in _MAY_BE_INFINITE):
                raise CommandRefused(f"motion limit {name} must be a finite number above 0, got {value}")
        return self
