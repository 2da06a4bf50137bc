"""Units on the bus: increments, velocity units, per mille of torque; the master converts nowhere else."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.drives.canopen.settings import CanopenSettings

_TWO_PI: Final = 2.0 * math.pi
_I32: Final = (1 << 31) - 1
_I16: Final = (1 << 15) - 1


class BusUnits:
    """Conversions of one drive.

    Args:
        settings: increments, velocity unit, torque reference.
        torque_rated_nm: of 6076 where the drive has it.
    """

    def __init__(self, settings: CanopenSettings, torque_rated_nm: float) -> None:
        per_rad_s = settings.speed_per_rad_s
        sign = -1.0 if settings.inverted else 1.0
        self.sign = -1 if settings.inverted else 1
        self._ramp_size = settings.ramp_per_rad_s2
        # CiA 402: per mille of the rated torque. Some drives mean 0.1 % of standstill torque or of rated current
        # instead.
        self.torque_unit_nm = torque_rated_nm * settings.torque_reference / 1000.0
        self.rad_s_per_unit = sign / per_rad_s
        self.nm_per_unit = sign * self.torque_unit_nm
        self.rad_per_increment = _TWO_PI / settings.increments_per_turn

    def velocity(self, rad_s: float) -> int:
        """60FF; 0 for a value that is not finite, limited to 32 bits."""
        return _whole(rad_s / self.rad_s_per_unit, _I32)

    def torque(self, nm: float) -> int:
        """60B2."""
        return _whole(nm / self.nm_per_unit, _I16)

    def ramp(self, rad_s2: float) -> int:
        """6085: at least 1."""
        return max(1, _whole(abs(rad_s2) * self._ramp_size, (1 << 32) - 1))


def _whole(value: float, limit: int) -> int:
    if not math.isfinite(value):
        return 0
    return max(-limit, min(limit, round(value)))
