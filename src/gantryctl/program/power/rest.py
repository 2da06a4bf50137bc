"""Rest of the axis, judged on the motor side: after a stop the load goes on swinging for some seconds."""

from __future__ import annotations

from typing import Final

from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings

REST_S: Final = 0.050
# A brake may catch the shaft for some 60 ms while the load swings on at 2 deg/s and then pulls it through the brake:
# 0.14 deg from 3 deg/s. So a stop by the brake is over after more than half a period of the first mode, near 2 Hz.
_BRAKE_REST_S: Final = 0.300


class RestWatch:
    """How long the axis has been slow in a phase."""

    __slots__ = ("_brake_rest_scans", "_feedback", "_rest_scans", "_scans")

    def __init__(self, settings: AxisSettings, feedback: Feedback) -> None:
        self._feedback = feedback
        self._rest_scans = settings.scans(REST_S)
        self._brake_rest_scans = settings.scans(_BRAKE_REST_S)
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
