"""Alarms as people see them: rows that follow what is done about an alarm, and events for the journal."""

from __future__ import annotations

import json

from gantryctl.program import AlarmLog, Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.controller.alarm_view import AlarmView
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.ring import Ring


def test_the_account_of_a_stop_reaches_rows_and_journal_when_it_is_complete() -> None:
    ring = Ring(memoryview(bytearray(192 + 4 * 1024)), 1024)
    log = AlarmLog()
    view = AlarmView(log, EventLog(ring))
    log.raise_(Code.INT_06, measured=5.0, speed=-6.0)
    view.scan()
    assert view.rows()["alarms"][0]["done"] == "Quick stop"
    view.changed = False
    view.scan()
    assert not view.changed
    assert log.first_out is not None
    log.first_out.steps = (Words.QUICK_STOP, Words.AT_REST_AFTER(time_ms=1100.0))
    view.scan()
    assert view.changed
    assert view.rows()["alarms"][0]["done"] == "Quick stop, at rest after 1100 ms"
    kept = [json.loads(record)["text"] for record in iter(ring.take, None)]
    assert [text for text in kept if "at rest" in text] == ["INT-06 · Quick stop, at rest after 1100 ms"]
