"""Units on the bus: increments, velocity units, per mille of torque; the virtual drive converts nowhere else."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.drives.virtual.axis.hardware import Hardware
from gantryctl.drives.virtual.personality import Personality, VelocityUnit
from gantryctl.units import r_min_from_rad_s, rad_s_from_r_min

_TWO_PI: Final = 2.0 * math.pi
_R_MIN: Final = r_min_from_rad_s(1.0)
_I32: Final = 1 << 31

# 60A9: prefix, numerator (increment, revolution), denominator (second, minute). The master has a table of its own
# (decision 0008).
SI_UNIT: Final[dict[VelocityUnit, int]] = {
    "inc/s": 0x00B5_0300,
    "r/min": 0x00B4_4700,
    "0.1 r/min": 0xFFB4_4700,
    "0.001 r/min": 0xFDB4_4700,
}


def wrap_i32(value: int) -> int:
    """Value of a 32-bit counter that wraps."""
    return (value + _I32) % (2 * _I32) - _I32


def clamp_int(value: float, low: int, high: int) -> int:
    """Value rounded and limited to a range; 0 if not finite."""
    if not math.isfinite(value):
        return 0
    return max(low, min(high, round(value)))


class Scaling:
    """Conversions of one drive.

    Args:
        hardware: name plates.
        kind: units of the drive model.
    """

    def __init__(self, hardware: Hardware, kind: Personality) -> None:
        self.counts_per_turn = kind.counts_per_turn
        self.velocity_unit = kind.velocity_unit
        self._fine = hardware.fine_counts_per_turn
        self.per_rad_s = {
            "inc/s": kind.counts_per_turn / _TWO_PI,
            "r/min": _R_MIN,
            "0.1 r/min": 10.0 * _R_MIN,
            "0.001 r/min": 1000.0 * _R_MIN,
        }[kind.velocity_unit]
        self.torque_unit_nm = hardware.torque_rated_nm * kind.torque_reference / 1000.0

    def increments(self, fine_counts: float) -> int:
        """Whole increments of 6064, unwrapped."""
        # An encoder counts completed increments: the fraction is cut towards minus infinity on both sides of zero.
        return math.floor(fine_counts * self.counts_per_turn / self._fine)

    def velocity(self, rad_s: float) -> int:
        """Velocity in units of 606C."""
        return clamp_int(rad_s * self.per_rad_s, -_I32, _I32 - 1)

    def rad_s(self, units: int) -> float:
        """Velocity from units of 60FF; accelerations too."""
        return units / self.per_rad_s

    def unsigned(self, rad_s: float) -> int:
        """607F, 6083 to 6085: at least 1."""
        return clamp_int(rad_s * self.per_rad_s, 1, 2 * _I32 - 1)

    def torque(self, nm: float) -> int:
        """6077, 1/1000 of the reference."""
        return clamp_int(nm / self.torque_unit_nm, -32768, 32767)

    def nm(self, units: int) -> float:
        """6072 and 60B2."""
        return units * self.torque_unit_nm


def r_min(rad_s: float) -> int:
    """Units of 6080, r/min in every drive."""
    return clamp_int(r_min_from_rad_s(rad_s), 1, 2 * _I32 - 1)


def rad_s_of_r_min(speed: int) -> float:
    """6080 to rad/s."""
    return rad_s_from_r_min(float(speed))
