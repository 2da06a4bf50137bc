"""Rest of the axis, judged on the motor side: after a stop the load goes on swinging for some seconds."""

from __future__ import annotations

from typing import Final

from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings

REST_S: Final = 0.050
# A brake may catch the shaft for some 60 ms while the load swings on at 2 deg/s and then pulls it through the brake:
# 0.14 deg from 3 deg/s. So a stop by the brake is over after more than half a period of the first mode, near 2 Hz.
BRAKE_REST_S: Final = 0.300


class RestWatch:
    """How long the axis has been slow in a phase."""

    __slots__ = ("_brake_rest_scans", "_feedback", "_rest_scans", "_scans")

    def __init__(self, settings: AxisSettings, feedback: Feedback) -> None:
        self._feedback = feedback
        self._rest_scans = settings.scans(REST_S)
        self._brake_rest_scans = settings.scans(BRAKE_REST_S)
        self._scans = 0

    def begin(self) -> None:
        """A phase begins."""
        self._scans = 0

    def scan(self) -> bool:
        """Take one scan, with a speed that is known; whether the axis has been slow for long enough to be at rest."""
        self._scans = self._feedback.lasting(self._scans) if self._feedback.slow else 0
        return self._scans >= self._rest_scans

    @property
    def after_brake_stop(self) -> bool:
        """Slow for so long that the load will not pull the shaft through the brake any more."""
        return self._scans >= self._brake_rest_scans


class BrakeStop:
    """Times of the slowest stop by the brake that keeps the permitted stopping angle."""

    __slots__ = ("_close_s", "_dec", "_rest_s", "_trip")

    def __init__(self, settings: AxisSettings) -> None:
        power = settings.power
        self._close_s, self._dec = power.brake_close_time_s, power.brake_dec_least_rad_s2
        # The load swings on and pulls the shaft through the brake, a period at most; then rest is waited for.
        self._rest_s = settings.monitors.swing_s + BRAKE_REST_S
        self._trip = settings.speed.overspeed_trip_rad_s

    @property
    def ends_s(self) -> float:
        """When the shaft stands, whatever its speed was: s since the torque went, at the latest."""
        return self._close_s + self._trip / self._dec

    def shown_s(self, start_rad_s: float, now_rad_s: float) -> float:
        """When a sound brake has brought the speed down from `start_rad_s` to `now_rad_s`, and a rest has shown."""
        # No sound axis is faster than the trip; NaN is nothing that is known.
        start = abs(start_rad_s)
        lost = (start if start <= self._trip else self._trip) - abs(now_rad_s)
        return self._close_s + self._rest_s + max(0.0, lost) / self._dec
