"""Alarms as people see them: rows that follow what is done about an alarm, and events for the journal."""

from __future__ import annotations

import json
import math
from typing import Any

from gantryctl.program import AlarmLog, Code
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import Feedback
from gantryctl.service.controller.alarm_view import AlarmView
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.ring import Ring
from unit.program.rig import settings


class Seen:
    """An alarm log with its feedback, its view, and what went into the journal."""

    def __init__(self) -> None:
        self._ring = Ring(memoryview(bytearray(192 + 4 * 1024)), 1024)
        self.log = AlarmLog()
        chosen = settings()
        self.feedback = Feedback(chosen, self.log)
        self.view = AlarmView(self.log, self.feedback, EventLog(self._ring), chosen.travel)

    def journal(self) -> list[dict[str, Any]]:
        return [json.loads(record) for record in iter(self._ring.take, None)]


def test_the_account_of_a_stop_reaches_rows_and_journal_when_it_is_complete() -> None:
    seen = Seen()
    view, log = seen.view, seen.log
    log.raise_(Code.INT_06, measured=5.0, speed=-6.0)
    view.scan()
    assert view.rows()["alarms"][0]["done"] == "Quick stop commanded"
    view.changed = False
    view.scan()
    assert not view.changed
    assert log.first_out is not None
    log.first_out.steps = (Words.QUICK_STOP, Words.AT_REST_AFTER(time_ms=1100.0))
    view.scan()
    assert view.changed
    assert view.rows()["alarms"][0]["done"] == "Quick stop, at rest after 1100 ms"
    kept = [event["text"] for event in seen.journal()]
    assert [text for text in kept if "at rest" in text] == ["INT-06 · Quick stop, at rest after 1100 ms"]


def test_the_angle_of_an_alarm_is_told_only_where_the_reading_was_believed() -> None:
    seen = Seen()
    seen.log.pos_rad = math.radians(12.5)
    seen.log.raise_(Code.INT_06, measured=12.5, speed=0.0)
    seen.view.scan()
    seen.feedback.doubt(Code.ENC_05)
    seen.view.scan()
    sound, doubted = reversed(seen.view.rows()["alarm_history"])
    assert (sound["code"], sound["pos_act_deg"]) == ("INT-06", 12.5)
    assert (doubted["code"], doubted["pos_act_deg"]) == ("ENC-05", None)
    assert [event["values"]["pos_deg"] for event in seen.journal() if "pos_deg" in event["values"]] == [
        12.5,
        None,
    ]
