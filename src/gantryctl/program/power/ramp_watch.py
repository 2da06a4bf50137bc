"""The quick stop that a drive makes by itself, against its ramp."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg

# The ramp is judged with the permitted deviation of the speed to spare for 50 ms, after the 60 ms in which a drive
# reacts. A fixed 0.5 deg/s hid a drive of 0.48 deg/s that did not stop at all.
_ENVELOPE_REACTION_S: Final = 0.060
_ENVELOPE_S: Final = 0.050
# A brake stop from the highest speed of the reference machine takes 0.9 s on the motor side.
STOP_TIME_S: Final = 3.0
# Beyond the time of the ramp where the speed is not known: reaction of the drive, and the load that swings on.
_BLIND_RAMP_S: Final = 0.25


class RampWatch:
    """Raise DRV-07 for a drive that is slower than its ramp: it does not obey."""

    __slots__ = (
        "_alarms",
        "_envelope",
        "_feedback",
        "_over_envelope",
        "_period_s",
        "_quick_dec",
        "_vel_start",
    )

    def __init__(self, settings: AxisSettings, feedback: Feedback, alarms: AlarmLog) -> None:
        self._feedback, self._alarms = feedback, alarms
        self._period_s, self._quick_dec = settings.period_s, settings.ramps.quick_dec_rad_s2
        self._envelope = settings.monitors.velocity_deviation_rad_s
        self._over_envelope = 0
        self._vel_start = 0.0

    def begin(self) -> None:
        """A phase begins."""
        self._over_envelope = 0
        self._vel_start = abs(self._feedback.vel_rad_s)

    def obeyed(self, elapsed_s: float) -> bool:
        """Judge one scan, with a speed that is known; False with the alarm.

        Args:
            elapsed_s: since the phase began.
        """
        speed = abs(self._feedback.vel_rad_s)
        ramp = max(0.0, self._vel_start - self._quick_dec * max(0.0, elapsed_s - _ENVELOPE_REACTION_S))
        allowed = ramp + self._envelope
        self._over_envelope = 0 if speed <= allowed else self._feedback.lasting(self._over_envelope)
        overdue = elapsed_s > self._vel_start / self._quick_dec + STOP_TIME_S
        if self._over_envelope * self._period_s >= _ENVELOPE_S or overdue:
            self._alarms.raise_(Code.DRV_07, measured=deg(speed), limit=deg(allowed))
            return False
        return True

    def wait_blind(self, elapsed_s: float) -> None:
        """Without a speed give the drive the time of its ramp; then the torque goes off."""
        first = self._alarms.first_out
        if first is not None and elapsed_s > self._vel_start / self._quick_dec + _BLIND_RAMP_S:
            self._alarms.raise_(first.code, Reaction.TORQUE_OFF)
