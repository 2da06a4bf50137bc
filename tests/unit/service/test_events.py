"""Events on their way to the journal: what finds no place is declared."""

from __future__ import annotations

import gc
import json
import sys
from collections.abc import Callable

import pytest

from gantryctl.operation.store import now_text
from gantryctl.service.memory.events import EventLog, now_ms_text
from gantryctl.service.memory.held_up import HELD_UP_S, HeldUp
from support.service_bench import ring

# A name that a call leaves behind has one of 512 places in the cache: 2,000 calls take some 480 of them.
_CALLS = 2000
_BLOCKS_MAX = 50
"""What else this process keeps meanwhile: a memory that does not grow shows some three blocks."""


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


@pytest.mark.parametrize("text", [now_text, now_ms_text])
def test_dates_of_records_leave_nothing_behind(text: Callable[[], str]) -> None:
    """CPython keeps names that C code makes anew in its cache of methods, and text of an aware datetime makes one."""
    text()
    # Other strings of that size come and go, as in a controller: else every name has the address of the one before.
    others = [""] * 500
    gc.collect()
    sys._clear_type_cache()
    before = sys.getallocatedblocks()
    for number in range(_CALLS):
        text()
        others[number * 7 % 500] = f"{number:09d}"
    others.clear()
    gc.collect()
    assert sys.getallocatedblocks() - before < _BLOCKS_MAX
