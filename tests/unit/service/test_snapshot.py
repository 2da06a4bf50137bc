"""The status snapshot while its writer is held up in the middle of a publication."""

from __future__ import annotations

import math

import pytest

from gantryctl.service.command.frame_clock import FrameClock
from gantryctl.service.memory.snapshot import FAST, Snapshot, publish_fast, publish_json
from gantryctl.service.protocol.frames import mark_of
from support.slow_network import shared_memory


def test_the_last_whole_state_is_shown_with_its_age_while_the_next_one_is_written() -> None:
    clock = FrameClock(0.0)
    clock.tick(1.25)
    with shared_memory() as memory:
        reader, late_reader = Snapshot(memory), Snapshot(memory)
        assert reader.fast() == ({}, math.inf)
        publish_fast(
            memory.fast, {**dict.fromkeys(FAST, 0.0), "issued_ms": float(clock.issued_ms)}, clock.key
        )
        tags, age_ms = reader.fast()
        # The writer gets no processor inside `publish`: its sequence is odd.
        memory.fast._words[0] |= 1
        again, older_ms = reader.fast()
        assert again == tags
        assert older_ms > age_ms
        # The frame that is made of it names one that the controller issued, so a sign of life with it counts.
        assert clock.issued_s(mark_of(again["issued_ms"], reader.key, "anna"), "anna") == 1.25
        assert late_reader.fast() == ({}, math.inf)


def test_a_mark_counts_whole_or_not_at_all() -> None:
    """Whoever guesses may be right in all digits of the seal but one."""
    clock = FrameClock(0.0)
    clock.tick(1.25)
    mark = mark_of(clock.issued_ms, clock.key, "anna")
    assert clock.issued_s(mark, "anna") == 1.25
    assert math.isnan(clock.issued_s(mark, "ben"))
    first = mark.index("-") + 1
    for at in range(first, len(mark)):
        other = "0" if mark[at] != "0" else "1"
        assert math.isnan(clock.issued_s(mark[:at] + other + mark[at + 1 :], "anna")), at
    for cut in ("", mark[first:], mark[first:-1]):
        assert math.isnan(clock.issued_s(f"{mark[:first]}{cut[:-1]}", "anna"))


def test_a_frame_is_as_old_as_it_is_whenever_the_controller_was_started() -> None:
    """1.25 s after a start at 1000 s of the clock, of which a computer that runs for weeks has many."""
    clock = FrameClock(1000.0)
    clock.tick(1001.25)
    assert clock.issued_ms == 1250
    assert clock.issued_s(mark_of(1250, clock.key, "anna"), "anna") == 1001.25


def test_what_is_sent_on_change_has_changed_when_tags_or_alarms_have_whichever_comes_alone() -> None:
    with shared_memory() as memory:
        reader = Snapshot(memory)
        assert reader.slow() == {"alarms": [], "alarm_history": []}
        for lock, told, version in (
            (memory.slow, {"machine": "a"}, 1),
            (memory.alarms, {"alarms": [1], "alarm_history": [1]}, 2),
            (None, {}, 2),
            (memory.slow, {"machine": "b"}, 3),
            (memory.alarms, {"alarms": [], "alarm_history": [1]}, 4),
        ):
            if lock is not None:
                publish_json(lock, told)
            found = reader.slow()
            assert found | told == found
            assert reader.version == version
        assert found == {"machine": "b", "alarms": [], "alarm_history": [1]}


def test_what_changes_rarely_holds_no_number_that_is_none_either() -> None:
    """JSON has no word for it: no client could read the tags any more."""
    with shared_memory() as memory:
        publish_json(memory.slow, {"increment_deg": 1.0})
        with pytest.raises(ValueError, match="not JSON compliant"):
            publish_json(memory.slow, {"increment_deg": math.nan})
        assert Snapshot(memory).slow()["increment_deg"] == 1.0
