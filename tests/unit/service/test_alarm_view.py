"""Alarms as people see them: rows that follow what is done about an alarm, and events for the journal."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from gantryctl.program import ALARMS, AlarmLog, Code
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import TravelSettings
from gantryctl.service.controller.alarm_view import AlarmView
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.service.protocol.roles import Role
from unit.program.rig import settings


class Seen:
    """An alarm log with its feedback, its view, and what went into the journal."""

    def __init__(self, travel: TravelSettings | None = None) -> None:
        self._ring = Ring(memoryview(bytearray(192 + 4 * 1024)), 1024)
        self.log = AlarmLog()
        chosen = settings()
        self.feedback = Feedback(chosen, self.log)
        self.view = AlarmView(self.log, self.feedback, EventLog(self._ring), travel or chosen.travel)

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


def test_rows_are_shown_anew_at_the_start_and_when_an_alarm_goes() -> None:
    """At the start those of the controller before are still there."""
    seen = Seen()
    view, log = seen.view, seen.log
    assert view.changed
    log.raise_(Code.BRK_04, measured=0.2, limit=0.1)
    log.raise_(Code.INT_06, measured=5.0, speed=-6.0)
    view.scan()
    view.changed = False
    view.scan()
    assert not view.changed
    del log.active[Code.BRK_04]
    view.scan()
    assert view.changed
    assert [row["code"] for row in view.rows()["alarms"]] == ["INT-06"]


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


def test_an_alarm_that_is_gone_is_shown_as_that() -> None:
    """With its row in the history; the same code again is another alarm, about which nothing was done yet."""
    seen = Seen()
    view, log = seen.view, seen.log
    log.raise_(Code.INT_06, measured=5.0, speed=-6.0)
    view.scan()
    assert log.first_out is not None
    log.first_out.steps = (Words.QUICK_STOP, Words.AT_REST_AFTER(time_ms=1100.0))
    view.scan()
    view.changed = False
    log.clear()
    view.scan()
    assert view.changed
    assert view.rows()["alarms"] == []
    assert [row["active"] for row in view.rows()["alarm_history"]] == [False]
    seen.journal()
    log.raise_(Code.INT_06, measured=7.0, speed=-6.0)
    view.scan()
    assert [row["active"] for row in view.rows()["alarm_history"]] == [True, False]
    assert [event["values"].get("pos_deg", "none") for event in seen.journal()] == [0.0]


def test_a_row_says_cause_and_remedy_who_may_reset_it_and_what_it_follows() -> None:
    seen = Seen()
    seen.log.raise_(Code.BRK_04, measured=0.2, limit=0.1)
    seen.log.raise_(Code.INT_06, measured=5.0, speed=-6.0)
    seen.view.scan()
    first, second = seen.view.rows()["alarms"]
    for row, code in ((first, Code.BRK_04), (second, Code.INT_06)):
        english = ALARMS[code].english
        assert (row["title"], row["cause"], row["to_do"]) == (english.title, english.cause, english.to_do)
    assert (first["code"], first["first_out"], first["follows"], first["lock"]) == ("BRK-04", True, "", True)
    assert (second["first_out"], second["follows"], second["lock"]) == (False, "BRK-04", False)


def test_an_alarm_of_an_axis_without_ends_is_told_within_its_turn() -> None:
    """A turn from -90 deg: 300 deg are -60 deg."""
    endless = TravelSettings(-math.inf, math.inf, -math.inf, math.inf, math.radians(-90.0))
    seen = Seen(endless)
    seen.log.pos_rad = math.radians(300.0)
    seen.log.raise_(Code.INT_06, measured=12.5, speed=0.0)
    seen.view.scan()
    assert seen.view.rows()["alarms"][0]["pos_act_deg"] == pytest.approx(-60.0)


def test_an_acknowledgement_is_of_its_row_and_of_whoever_saw_it_first() -> None:
    seen = Seen()
    view = seen.view
    for measured in (1.0, 2.0, 3.0):
        seen.log.note(Code.CTL_17, reason=str(measured))
    view.scan()
    view.changed = False
    anna, paul = (Identity("c1", name, Role.OPERATOR, "console") for name in ("anna", "paul"))
    view.acknowledge(2, anna)
    assert view.changed
    view.acknowledge(2, paul)
    rows = view.rows()["alarm_history"]
    assert [(row["id"], row["acknowledged_by"]) for row in rows] == [(3, ""), (2, "anna"), (1, "")]
    with pytest.raises(MessageRefused, match="4"):
        view.acknowledge(4, anna)


def test_the_last_fifty_alarms_are_kept() -> None:
    seen = Seen()
    for number in range(60):
        seen.log.note(Code.CTL_17, reason=str(number))
        seen.view.scan()
    assert [row["id"] for row in seen.view.rows()["alarm_history"]] == list(range(60, 10, -1))
    # Nobody has acknowledged another one instead.
    with pytest.raises(MessageRefused, match="5"):
        seen.view.acknowledge(5, Identity("c1", "anna", Role.OPERATOR, "console"))
