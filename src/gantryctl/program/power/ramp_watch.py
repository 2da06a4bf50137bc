"""The quick stop that a drive makes by itself, against its ramp."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg

# The ramp is judged with the permitted deviation of the speed to spare for 50 ms, after the 60 ms in which a drive
# reacts. A fixed 0.5 deg/s hid a drive of 0.48 deg/s that did not stop at all.
_ENVELOPE_REACTION_S: Final = 0.060
_ENVELOPE_S: Final = 0.050
# At the end of its ramp a sound drive holds the motor at zero speed: then a tenth of that deviation is to spare, as for
# every sound drive that follows a command (`monitors.torque`), and no less than what counts as rest. With all of it a
# drive that goes on with 0.24 deg/s went on for 3 s.
_RESTS_SHARE: Final = 0.1
# A brake stop from the highest speed of the reference machine takes 0.9 s on the motor side.
STOP_TIME_S: Final = 3.0
# Beyond the time of the ramp until the drive stands: its reaction, and the load that swings on. 180 sound stops (16 and
# 50 kN m, plants within 20 %, 0.1 to 6 deg/s, 1, 4 and 10 ms) were at rest 0.11 s after their ramp at the latest.
_SETTLED_S: Final = 0.25


class RampWatch:
    """Raise DRV-07 for a drive that is slower than its ramp: it does not obey."""

    __slots__ = (
        "_envelope",
        "_feedback",
        "_over_envelope",
        "_period_s",
        "_quick_dec",
        "_rests",
        "_seen_s",
        "_stands_early",
        "_vel_start",
    )

    def __init__(self, settings: AxisSettings, feedback: Feedback) -> None:
        self._feedback = feedback
        self._period_s, self._quick_dec = settings.period_s, settings.ramps.quick_dec_rad_s2
        self._envelope = settings.monitors.velocity_deviation_rad_s
        self._rests = max(_RESTS_SHARE * self._envelope, settings.speed.rest_rad_s)
        self.begin()

    def begin(self) -> None:
        """A phase begins."""
        self._over_envelope = 0
        self._vel_start = abs(self._feedback.vel_rad_s)
        self._stands_early, self._seen_s = False, -self._feedback.speed_age_s

    def obeyed(self, elapsed_s: float) -> bool:
        """Judge one scan, with a speed that is known; False with the alarm.

        Args:
            elapsed_s: since the phase began.
        """
        speed = abs(self._feedback.vel_rad_s)
        # Slower than its ramp can be nothing is but a reading that stands: such an axis is not seen from then on.
        least = self._vel_start - self._quick_dec * elapsed_s - self._rests
        self._stands_early = self._stands_early or speed < least
        if not self._stands_early:
            self._seen_s = elapsed_s - self._feedback.speed_age_s
        ramp = max(0.0, self._vel_start - self._quick_dec * max(0.0, elapsed_s - _ENVELOPE_REACTION_S))
        rests = elapsed_s > self._vel_start / self._quick_dec + _SETTLED_S
        allowed = self._rests if rests else ramp + self._envelope
        self._over_envelope = 0 if speed <= allowed else self._feedback.lasting(self._over_envelope)
        overdue = elapsed_s > self._vel_start / self._quick_dec + STOP_TIME_S
        if self._over_envelope * self._period_s >= _ENVELOPE_S or overdue:
            self._feedback.disobeyed(Code.DRV_07, measured=deg(speed), limit=deg(allowed))
            return False
        return True

    @property
    def began_rad_s(self) -> float:
        """Speed with which the phase began, whatever its direction."""
        return self._vel_start

    def unseen_s(self, elapsed_s: float) -> float:
        """How long ago the last speed was read that may be one of the ramp."""
        return elapsed_s - self._seen_s

    @property
    def left(self) -> bool:
        """The speed of the last scan was above the ramp."""
        return self._over_envelope > 0

    @property
    def ends_s(self) -> float:
        """When the ramp of a drive that obeys has ended, s since the phase began; also of one that stops by itself."""
        return self._vel_start / self._quick_dec + _ENVELOPE_REACTION_S
