"""The record of a stop by an alarm."""

from __future__ import annotations

from gantryctl.program.alarms.codes import Reaction
from gantryctl.program.alarms.log import Alarm
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.feedback import ENABLED, Feedback
from gantryctl.program.power.sequence import REST_RAD_S
from gantryctl.units import deg


class StopRecord:
    """Follows one stop from its alarm to rest and writes `alarm.steps`."""

    __slots__ = (
        "_angle_known", "_brake_scan", "_period_s", "_rest_pos_rad", "_rest_scan", "_slow_scan", "_torque_scan",
        "_was_open", "_was_torque", "alarm", "finished",
    )  # fmt: skip

    def __init__(self, alarm: Alarm, period_s: float, feedback: Feedback) -> None:
        self.alarm = alarm
        self._period_s = period_s
        self._was_open = feedback.brake_open
        self._was_torque = feedback.state in ENABLED
        self._brake_scan = self._torque_scan = self._slow_scan = self._rest_scan = -1
        self._rest_pos_rad = alarm.pos_rad
        self._angle_known = True
        self.finished = False

    def scan(self, scan: int, pos_rad: float, feedback: Feedback, falling: bool) -> None:
        """Record one scan; `falling`: the stop is still under way."""
        if self._brake_scan < 0 and not feedback.brake_open:
            self._brake_scan = scan
        if self._torque_scan < 0 and feedback.state not in ENABLED:
            self._torque_scan = scan
        if not -REST_RAD_S < feedback.vel_rad_s < REST_RAD_S:
            self._slow_scan = -1
        elif self._slow_scan < 0:
            self._slow_scan = scan
        if not falling:
            self._rest_pos_rad = pos_rad
            # Speed and angle of a wrong or frozen encoder say nothing.
            self._angle_known = feedback.position_valid
            self.finished = True
            self.alarm.steps = self._steps()

    def _steps(self) -> tuple[Words | Said, ...]:
        alarm = self.alarm
        hold = alarm.reaction is Reaction.HOLD
        steps = (
            (self._slow_scan, Words.AT_REST_AFTER, self._slow_scan > alarm.scan and self._angle_known),
            (self._torque_scan, Words.TORQUE_OFF_AFTER, self._was_torque and not hold),
            (self._brake_scan, Words.BRAKE_CLOSED_AFTER, self._was_open and not hold),
        )
        parts: list[Words | Said] = [Words.TORQUE_KEPT] if hold else []
        if alarm.reaction is Reaction.QUICK_STOP and self._was_torque:
            parts.append(Words.QUICK_STOP)
        for at, words, happened in sorted(steps, key=lambda step: step[0]):
            if happened and at >= 0:
                parts.append(words(time_ms=(at - alarm.scan) * self._period_s * 1e3))
        if not parts:
            return (Words.NOTHING_ON,)
        moved = deg(self._rest_pos_rad - alarm.pos_rad)
        parts.append(
            Words.MOVED_TO(way=abs(moved), position=deg(self._rest_pos_rad))
            if self._angle_known
            else Words.ANGLE_UNKNOWN
        )
        return tuple(parts)
