"""Oscillation of the axis about its set-point (fault catalogue B9)."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg

# Beyond this part of the permitted deviation of the speed, both ways in turn: 0.2 deg/s on the reference gantry, which
# is within 0.02 deg/s of its set-point on the motor side, swing of the load after a stop included; 0.2 deg/s at 1 Hz is
# an amplitude of 0.03 deg. A fixed 0.2 deg/s stopped a sound table whose teeth pass at 60 deg/s.
_SWING_SHARE: Final = 0.4
_LASTS_S: Final = 1.0
# Slower than 1 Hz the following error shows it.
_HALF_S: Final = 0.5


class Oscillation:
    """Counts how long the speed has swung from one side of its set-point to the other.

    `scan` is entered only where the swing passes `limit_rad_s`.
    """

    __slots__ = (
        "_alarms",
        "_began",
        "_half_scans",
        "_lasts_scans",
        "_period_s",
        "_scan",
        "_side",
        "_turns",
        "limit_rad_s",
    )

    def __init__(self, settings: AxisSettings, alarms: AlarmLog) -> None:
        self._alarms = alarms
        self.limit_rad_s = _SWING_SHARE * settings.monitors.velocity_deviation_rad_s
        self._period_s = settings.period_s
        self._half_scans = settings.scans(_HALF_S)
        self._lasts_scans = settings.scans(_LASTS_S)
        self._began = self._scan = self._side = self._turns = 0

    def scan(self, swing_rad_s: float) -> None:
        """Take a swing beyond the limit: speed minus set-point speed."""
        now, side = self._alarms.scan, 1 if swing_rad_s > 0.0 else -1
        if now - self._scan > self._half_scans or not self._side:
            self._began, self._turns = now, 0
        elif side != self._side:
            self._turns += 1
            lasted = now - self._began
            # At least one full swing: a single shock there and back is no oscillation.
            if self._turns > 2 and lasted >= self._lasts_scans:
                time_s = lasted * self._period_s
                rate = 0.5 * self._turns / time_s
                self._alarms.raise_(Code.CTL_08, measured=deg(abs(swing_rad_s)), rate=rate, time_s=time_s)
        self._scan, self._side = now, side
