"""Thermal protection of the motor: a model of its winding, its sensor, and the overload account of the drive."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings

# A winding takes minutes: ten looks in a second leave the scans between them a single comparison.
_LOOK_S: Final = 0.1
# No winding is colder or hotter than that; an open sensor reads far above, a shorted one far below.
_SENSOR_MIN_C: Final = -30.0
_SENSOR_MAX_C: Final = 250.0
_SENSOR_TIME_S: Final = 1.0
_LOAD_MAX: Final = 10.0
# The rise of a winding is permitted from this ambient temperature on (IEC 60034-1).
_AMBIENT_C: Final = 40.0
# Without its sensor the model has half of the rise (fault catalogue G13): it knows nothing of ambient and cooling.
_BLIND_SHARE: Final = 0.5


class MotorThermal:
    """Watches how warm the motor is (faults G12, G13).

    The load is the largest of three shares: the model, which follows the square of the torque with one time constant;
    the sensor, as part of the permitted rise over 40 C; and the drive's own I2t account. At 80 % it warns, from 95 %
    on a motion that is under way ends and no other begins, and at 100 % it is a quick stop. Motion is open again
    below 80 %.

    Attributes:
        share: load, 1 = the limit.
    """

    __slots__ = (
        "_alarms", "_bad_s", "_blind", "_due_s", "_feedback", "_hot", "_last_s", "_model", "_refusal",
        "_rise_max_c", "_time_constant_s", "_torque_rated_nm", "_warning", "share",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings, feedback: Feedback, alarms: AlarmLog) -> None:
        thermal = settings.thermal
        self._feedback, self._alarms = feedback, alarms
        self._torque_rated_nm = thermal.torque_rated_nm
        self._time_constant_s = thermal.time_constant_s
        self._rise_max_c = thermal.winding_max_c - _AMBIENT_C
        self._warning, self._refusal = thermal.warning_share, thermal.refusal_share
        # How warm the motor is at the start is not known without its sensor; it starts at ambient.
        self._model = self._due_s = self._last_s = self._bad_s = 0.0
        self._hot = self._blind = False
        self.share = 0.0

    def scan(self, time_s: float) -> None:
        """Look at the motor when it is due."""
        # A motor that is too hot is looked at in every scan: no command slips in behind a reset.
        if time_s >= self._due_s or self._hot:
            self._look(time_s)

    def _look(self, time_s: float) -> None:
        elapsed_s, self._last_s, self._due_s = time_s - self._last_s, time_s, time_s + _LOOK_S
        load = self._feedback.torque_nm / self._torque_rated_nm
        # Ten times rated is no torque of a motor: such a reading is another monitor's matter.
        if -_LOAD_MAX <= load <= _LOAD_MAX:
            part = 1.0 - math.exp(-elapsed_s / self._time_constant_s)
            self._model += (load * load - self._model) * part
        model, sensor = self._model, self._sensor_share(elapsed_s)
        if self._blind:
            model /= _BLIND_SHARE
        overload = self._feedback.overload
        warmest = max(model, sensor)
        # Written so that an overload that is not a number counts as too high, here and below.
        self.share = max(overload, warmest)
        if self._hot or not self.share < self._warning:
            self._warm(Words.READY_WITH_DRIVE if not overload <= warmest else self._ready(warmest))

    def _sensor_share(self, elapsed_s: float) -> float:
        """Share that the sensor shows; 0 without one, or with one that cannot be believed."""
        reading_c = self._feedback.motor_temp_c
        if reading_c is None:
            self._blind = False
            return 0.0
        if _SENSOR_MIN_C <= reading_c <= _SENSOR_MAX_C:
            self._bad_s, self._blind = 0.0, False
            # The sensor knows better than the model how warm the motor was at the start.
            share = (reading_c - _AMBIENT_C) / self._rise_max_c
            self._model = max(self._model, share)
            return share
        self._bad_s += elapsed_s
        if self._bad_s >= _SENSOR_TIME_S:
            self._blind = True
            self._alarms.raise_(Code.THM_02, measured=reading_c, low=_SENSOR_MIN_C, high=_SENSOR_MAX_C)
        return 0.0

    def _ready(self, share: float) -> Said:
        """Time until motion is open again, with the motor without torque."""
        minutes = self._time_constant_s / 60.0 * math.log(max(share / self._warning, 1.0))
        return Words.READY_IN(time_min=math.ceil(minutes))

    def _warm(self, ready: Words | Said) -> None:
        """Warn, keep new motion back, or stop, by the present share."""
        share, alarms = self.share, self._alarms
        percent = 100.0 * share
        self._hot = not (share < self._warning) and (self._hot or not share < self._refusal)
        if not share < self._warning:
            alarms.raise_(Code.THM_01, measured=percent, limit=100.0 * self._warning)
        if self._hot:
            alarms.raise_(Code.THM_03, measured=percent, limit=100.0 * self._refusal, ready=ready)
        # An axis that has stopped already needs no other stop, and a load that only the motor holds keeps its torque.
        if not share < 1.0 and alarms.first_out is None:
            alarms.raise_(Code.THM_04, measured=percent, ready=ready)
