"""Alarm rows for people: from the program's log to what the tags `alarms` and `alarm_history` show."""

from __future__ import annotations

from collections import deque
from itertools import takewhile
from typing import Any, Final

from gantryctl.program import Alarm, AlarmLog, Code
from gantryctl.program.alarms.log import messages_to_wire, to_wire
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import TravelSettings
from gantryctl.service.memory.events import EventLog, now_ms_text
from gantryctl.service.memory.snapshot import rounded
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.units import deg

KEPT: Final = 50


class _Row:
    """One alarm with what the service knows about it."""

    __slots__ = ("acknowledged_by", "alarm", "at", "number", "pos_deg")

    def __init__(self, number: int, alarm: Alarm, pos_deg: float | None) -> None:
        self.number, self.alarm, self.pos_deg = number, alarm, pos_deg
        self.at = now_ms_text()
        self.acknowledged_by = ""


class AlarmView:
    """Watches the alarms of an axis: new ones become events, and rows to be shown.

    Attributes:
        changed: something is to be shown anew.
    """

    def __init__(self, log: AlarmLog, feedback: Feedback, events: EventLog, travel: TravelSettings) -> None:
        self._log, self._feedback, self._events, self._travel = log, feedback, events, travel
        self._rows: deque[_Row] = deque(maxlen=KEPT)
        self._last: Alarm | None = None
        self._done: dict[Code, tuple[Words | Said, ...]] = {}
        self._active = 0
        self._number = 0
        self.changed = True

    def scan(self) -> None:
        """Once a scan: cheap when nothing happened."""
        log = self._log
        if len(log.active) != self._active:
            self._active, self.changed = len(log.active), True
        self._account()
        if not log.history or log.history[-1] is self._last:
            return
        fresh = list(takewhile(lambda alarm: alarm is not self._last, reversed(log.history)))
        for alarm in reversed(fresh):
            self._number += 1
            # Looked at after every scan: what the feedback says now is what it said when the alarm came.
            known, shown_rad = self._feedback.position_valid, self._travel.shown_rad(alarm.pos_rad)
            pos_deg = rounded(deg(shown_rad)) if known else None
            self._rows.append(_Row(self._number, alarm, pos_deg))
            at = {"time_s": alarm.time_s, "pos_deg": pos_deg}
            self._events.put("alarm", alarm.text, None, code=str(alarm.code), **at)
        self._last, self.changed = log.history[-1], True

    def _account(self) -> None:
        """What was done about an alarm is complete when the axis has come to rest: then it is shown anew, and kept."""
        active = self._log.active
        if not active:
            self._done.clear()
        for code, alarm in active.items():
            known = self._done.get(code)
            if known is not alarm.steps:
                self._done[code], self.changed = alarm.steps, True
                if known is not None:
                    self._events.put("alarm", f"{code} · {alarm.done}", None, code=str(code))

    def acknowledge(self, number: int, who: Identity) -> None:
        """Somebody has seen it.

        Raises:
            MessageRefused: there is no such row any more.
        """
        for row in self._rows:
            if row.number == number:
                row.acknowledged_by = row.acknowledged_by or who.user
                self.changed = True
                return
        raise MessageRefused(Code.SEC_05, reason=Words.NO_SUCH_ALARM(number=number))

    def rows(self) -> dict[str, Any]:
        """Both tags."""
        active = {id(alarm) for alarm in self._log.active.values()}
        first = self._log.first_out
        history = [self._row(row, active, first) for row in reversed(self._rows)]
        shown = sorted(
            (row for row in history if row["active"]), key=lambda row: (not row["first_out"], -row["id"])
        )
        return {"alarms": shown, "alarm_history": history}

    @staticmethod
    def _row(row: _Row, active: set[int], first: Alarm | None) -> dict[str, Any]:
        alarm, definition = row.alarm, row.alarm.definition
        follows = first is not None and any(alarm is each for each in first.consequences)
        return {
            "id": row.number,
            "code": str(alarm.code),
            "severity": alarm.severity.value,
            "title": definition.english.title,
            "measured": alarm.measured,
            "values": to_wire(alarm.values),
            "done": alarm.done,
            "steps": messages_to_wire(*alarm.steps),
            "to_do": definition.english.to_do,
            "cause": definition.english.cause,
            "text": alarm.text,
            "at": row.at,
            "time_s": round(alarm.time_s, 6),
            "pos_act_deg": row.pos_deg,
            "active": id(alarm) in active,
            "first_out": alarm is first,
            "follows": str(first.code) if follows and first is not None else "",
            "lock": definition.lock,
            "acknowledged_by": row.acknowledged_by,
        }
