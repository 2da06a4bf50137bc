"""Events on their way to the journal: what finds no place is declared."""

from __future__ import annotations

import json

from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.held_up import HELD_UP_S, HeldUp
from support.service_bench import ring


def test_lost_events_are_declared_where_they_are_missing_as_soon_as_there_is_room() -> None:
    made = ring(4)
    log = EventLog(made)
    numbers = [log.put("command", f"event {number}") for number in range(7)]
    assert numbers == [1, 2, 3, 4, 0, 0, 0]
    assert log.lost == 3
    made.advance(1)
    assert log.put("command", "event 7") == 0  # no room for both the event and the word about the others
    made.advance(1)
    assert log.put("command", "event 8") == 6
    made.advance(1)
    log.put("command", "event 9")
    found = [json.loads(record)["text"] for record in made.peek(10) if record is not None]
    assert found[0] == "event 3"
    assert found[1].startswith("4 events are missing here")
    assert found[2:] == ["event 8", "event 9"]


def test_a_process_that_did_not_run_for_a_time_says_so_once() -> None:
    said: list[str] = []
    now_s = [50.0]
    watch = HeldUp("gateway", said.append, lambda: now_s[0])
    for step_s in (0.05, 0.9, HELD_UP_S + 1.34, 0.05, 0.05):
        now_s[0] += step_s
        watch.look()
    assert said == ["gateway was held up for 2.3 s"]
