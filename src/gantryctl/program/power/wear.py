"""Stops of a turning axis by its brake: how many, and the energy that the brake took (fault catalogue C9)."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings

# Of the highest setting. Slower, the brake takes some joules: on the reference machine 4 J at 0.1 deg/s, 13.6 kJ at
# 6 deg/s.
_STOP_SHARE: Final = 1.0 / 60.0


class BrakeWear:
    """Counts the stops of one run; what earlier runs have counted is given by `restore`.

    Attributes:
        stops: of this run.
        energy_j: what the closed brake took in them: its torque times the angle of the motor.
    """

    __slots__ = (
        "_alarms",
        "_before",
        "_energy_per_speed",
        "_feedback",
        "_most",
        "_slowest_rad_s",
        "energy_j",
        "stops",
    )

    def __init__(self, settings: AxisSettings, feedback: Feedback, alarms: AlarmLog) -> None:
        power = settings.power
        self._feedback, self._alarms = feedback, alarms
        self._most = power.brake_stops_max
        self._slowest_rad_s = _STOP_SHARE * settings.speed.setting_max_rad_s
        self._energy_per_speed = power.brake_torque_nm * settings.law.ratio * settings.period_s
        self._before = self.stops = 0
        self.energy_j = 0.0

    def restore(self, stops: int) -> None:
        """Take the count of earlier runs."""
        self._before = stops
        self._judge()

    def begin(self, speed_rad_s: float) -> None:
        """Torque goes off and the brake closes at this speed of the gantry."""
        # NaN is counted: nobody knows how fast it was.
        if not speed_rad_s <= self._slowest_rad_s:
            self.stops += 1
            self._judge()

    def scan(self) -> None:
        """Take a scan of the stop; a reading in doubt adds nothing that is true."""
        feedback = self._feedback
        if not feedback.brake_open and feedback.position_valid:
            self.energy_j += abs(feedback.vel_rad_s) * self._energy_per_speed * feedback.periods

    def _judge(self) -> None:
        stops = self._before + self.stops
        if stops >= self._most:
            self._alarms.raise_(Code.BRK_09, measured=stops, limit=self._most)
