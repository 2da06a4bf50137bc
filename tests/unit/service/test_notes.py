"""The shift log: a line is in the journal under its writer's name, whole, or its writer is told that it is not kept."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gantryctl.service.memory.memory import COMMAND_BYTES, JournalState, Word
from gantryctl.service.protocol.messages import KEPT_FIRST, NOTE, NOTE_MAX, Identity, to_record
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.journal.writer import Batch, Journal
from support.service_bench import Bench

# The longest that there are, by their bytes: four of UTF-8, and two in JSON.
LONGEST = ("x" * NOTE_MAX, "\U0001f527" * NOTE_MAX, "门" * NOTE_MAX, '"\\' * (NOTE_MAX // 2))


@pytest.mark.parametrize("text", LONGEST)
def test_the_longest_line_is_kept_whole_under_the_name_of_its_writer(text: str) -> None:
    bench = Bench()
    who = bench.who(Role.OPERATOR)
    bench.do(who, "note", line=text)
    events = [json.loads(record or b"{}") for record in bench.event_ring.peek(100)]
    (note,) = [each for each in events if each["kind"] == NOTE]
    assert (note["text"], note["user"], note["role"]) == (text, who.user, "operator")
    assert "time_s" in note["values"]


def test_the_longest_line_of_the_longest_names_fits_the_slot_of_a_command() -> None:
    name = "n" * 32  # of a user, and of a person
    who = Identity("0" * 8, name, Role.PHYSICIST, "console", name)
    for text in LONGEST:
        raw = {"type": "note", "seq": 2**53, "frame": f"{2**53}-{'f' * 16}", "line": text}
        assert len(to_record(who, raw)) <= COMMAND_BYTES - 8


@pytest.mark.parametrize("state", [JournalState.FULL, JournalState.FAILED, JournalState.LOCKED])
def test_a_line_that_the_journal_cannot_keep_is_refused(state: JournalState) -> None:
    bench = Bench()
    bench.words[Word.JOURNAL_STATE] = state
    assert bench.refused(bench.who(Role.OPERATOR), "note", line="lost") == "JRN-02"


def test_the_reply_waits_for_the_disk() -> None:
    assert NOTE in KEPT_FIRST


@pytest.mark.usefixtures("keys")
def test_lines_are_found_among_all_events_the_newest_first_kept(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    for number in range(1, 7):
        kind = NOTE if number % 2 else "command"
        event = {
            "utc": "",
            "monotonic_ns": 0,
            "kind": kind,
            "user": "",
            "role": "",
            "client": "",
            "place": "",
        }
        journal.append_all(
            1, [Batch(0, number, [json.dumps({**event, "text": f"{number}", "values": {}}).encode()])]
        )
    journal.close()
    found = [entry.values["text"] for entry in read_journal(tmp_path, limit=2, newest=True, kind=NOTE)]
    assert found == ["3", "5"]
