"""The journal: what it keeps, what it notices, what it does with a disk that fails.

INV-8: order, hash chain, declared gaps.
"""

from __future__ import annotations

import json
import os
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.errors import UsageError
from gantryctl.service.memory.events import TEXT_MAX, EventLog, printable
from gantryctl.service.memory.memory import JournalState, SharedMemory, Word
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.journal.chain import Anchor, of_journal
from gantryctl.service.recorder.journal.file import FIELDS, connect, lock_after, own_row, row_of
from gantryctl.service.recorder.journal.places import FILE, places_of
from gantryctl.service.recorder.journal.proof import kept_anchors, verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.journal.writer import Journal, JournalFault
from gantryctl.service.recorder.process import EventWriter
from gantryctl.service.recorder.retention import MB, RetentionPolicy

pytestmark = pytest.mark.usefixtures("keys")
PLENTY = 10**12


def record(text: str) -> bytes:
    values = {"utc": "2026-01-01T00:00:00.000+00:00", "monotonic_ns": 1, "kind": "command", "text": text}
    return json.dumps(values).encode()


def filled(directory: Path, count: int = 6) -> Path:
    journal = Journal(directory)
    for first in range(1, count + 1, 2):
        journal.append(1, 0, first, [record(f"event {first}"), record(f"event {first + 1}")])
    journal.close()
    return directory / FILE


def test_what_was_appended_is_read_in_order_and_the_chain_holds(tmp_path: Path) -> None:
    filled(tmp_path)
    assert [row.values["text"] for row in read_journal(tmp_path)] == [f"event {n}" for n in range(1, 7)]
    assert [row.seq for row in read_journal(tmp_path, after=4)] == [5, 6]
    assert [row.seq for row in read_journal(tmp_path, limit=2, newest=True)] == [5, 6]
    assert verify(tmp_path)[:2] == (6, "")


def test_an_event_given_twice_is_kept_once(tmp_path: Path) -> None:
    """As after a kill between the commit and the ring's head."""
    journal = Journal(tmp_path)
    journal.append(1, 0, 1, [record("a"), record("b")])
    journal.append(1, 0, 2, [record("b"), record("c")])
    journal.append(2, 0, 1, [record("of the next start")])
    journal.close()
    assert [row.values["text"] for row in read_journal(tmp_path)] == ["a", "b", "c", "of the next start"]


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("row", [1, 3, 6])
def test_any_changed_field_of_any_row_is_found(tmp_path: Path, field: str, row: int) -> None:
    path = filled(tmp_path)
    value = 77 if field in ("boot", "source", "number", "monotonic_ns") else "changed"
    with sqlite3.connect(path) as db:
        db.execute(f"UPDATE events SET {field} = ? WHERE seq = ?", (value, row))
    db.close()
    assert verify(tmp_path).wrong == f"row {row} was changed, or one before it was taken out or put in"


@pytest.mark.parametrize(
    ("edit", "wrong"),
    [
        ("DELETE FROM events WHERE seq = 6", "the end is missing: 5 rows, 6 were written"),
        ("DELETE FROM events WHERE seq = 2", "row 2 is missing"),
        ("DELETE FROM events", "the end is missing: 0 rows, 6 were written"),
        ("UPDATE head SET seq = 5", "the end is missing: 6 rows, 5 were written"),
    ],
)
def test_rows_taken_out_are_found_and_the_journal_is_begun_anew(
    tmp_path: Path, edit: str, wrong: str
) -> None:
    path = filled(tmp_path)
    with sqlite3.connect(path) as db:
        db.execute(edit)
    db.close()
    assert verify(tmp_path).wrong == wrong
    journal = Journal(tmp_path)
    journal.close()
    assert journal.moved_aside is not None
    assert journal.moved_aside.exists()
    assert journal.locked
    assert verify(tmp_path)[:2] == (1, "")  # the event that says it


def test_another_kind_of_file_is_moved_aside_and_an_unusable_directory_is_a_fault(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"no database at all, but long enough to look at" * 100)
    journal = Journal(tmp_path)
    journal.close()
    assert journal.moved_aside is not None
    (tmp_path / "file").touch()
    with pytest.raises(JournalFault):
        Journal(tmp_path / "file")
    with pytest.raises(UsageError, match="no journal yet"):
        verify(tmp_path / "elsewhere")


def writer(directory: Path, free: int = PLENTY) -> tuple[SharedMemory, EventWriter, EventLog]:
    memory = SharedMemory.create()
    memory.words[Word.BOOT] = 5
    return memory, EventWriter(memory, directory, lambda: free), EventLog(memory.events[2])


def test_an_event_leaves_the_ring_only_when_it_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory, made, log = writer(tmp_path)
    made.drain()
    log.put("command", "first")

    def fails(*_: object) -> None:
        raise JournalFault("the disk does not take it")

    with monkeypatch.context() as broken:
        broken.setattr(Journal, "append_all", fails)
        with pytest.raises(JournalFault):
            made.drain()
    assert len(memory.events[2]) == 1
    assert made.drain()
    assert len(memory.events[2]) == 0
    assert [row.values["text"] for row in read_journal(tmp_path)] == ["first"]
    made.close()


def test_the_state_says_what_keeps_the_journal_from_working(tmp_path: Path) -> None:
    _, made, _ = writer(tmp_path, free=int(RetentionPolicy().event_reserve_mb * MB) - 1)
    assert made.state == JournalState.FULL
    made.failed = True
    assert made.state == JournalState.FAILED
    _, fine, _ = writer(tmp_path)
    assert fine.state == JournalState.OK


def test_a_damaged_journal_locks_until_service_has_acknowledged_it(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"damaged" * 1000)
    _, made, log = writer(tmp_path)
    made.drain()
    assert made.state == JournalState.LOCKED
    assert read_journal(tmp_path)[0].values["text"].startswith("JRN-05 the journal was damaged and moved to")
    log.put("command", "something else")
    made.drain()
    assert made.state == JournalState.LOCKED
    made.close()
    memory, again, log = writer(tmp_path)  # a new start acknowledges nothing
    memory.words[Word.BOOT] = 6
    again.drain()
    assert again.state == JournalState.LOCKED
    log.put("journal", "the damaged journal was acknowledged by service")
    again.drain()
    assert again.state == JournalState.OK
    again.close()
    _, after, _ = writer(tmp_path)
    after.drain()
    assert after.state == JournalState.OK
    after.close()


@given(
    st.text(max_size=2000),
    st.dictionaries(st.text(max_size=10), st.floats() | st.text(max_size=900), max_size=3),
)
def test_any_text_becomes_one_printable_line_that_fits(text: str, values: dict[str, float | str]) -> None:
    ring = Ring(memoryview(bytearray(192 + 4 * 1024)), 1024)
    assert (
        EventLog(ring).put("command", text, Identity("c", text, Role.VIEWER, "remote"), **{"x": 1} | values)
        == 1
    )
    taken = ring.take()
    assert taken is not None
    kept = json.loads(taken)
    assert kept["text"].isprintable()
    assert kept["user"].isprintable()
    assert len(kept["text"].encode()) <= TEXT_MAX


def test_control_characters_do_not_reach_a_log() -> None:
    assert printable("a\r\nb\x1b[31mc\u202ed") == "a\ufffd\ufffdb\ufffd[31mc\ufffdd"


@pytest.mark.parametrize("there", [False, True])
def test_nobody_but_owner_and_group_sees_the_journal(tmp_path: Path, there: bool) -> None:
    file = tmp_path / "journal.sqlite"
    if there:
        file.touch()
        file.chmod(0o644)
    before = os.umask(0o022)
    try:
        journal = Journal(tmp_path)
        journal.note("service", "one")
        rights = {each.name: each.stat().st_mode & 0o777 for each in tmp_path.iterdir()}
        journal.close()
    finally:
        os.umask(before)
    events = dict.fromkeys(("journal.sqlite", "journal.sqlite-wal", "journal.sqlite-shm"), 0o640)
    assert rights == {**events, "journal.mirror": 0o600}


def test_events_of_all_sources_are_kept_by_one_commit(tmp_path: Path) -> None:
    commits: list[str] = []

    def watched(path: Path) -> sqlite3.Connection:
        made = connect(path)
        made.set_trace_callback(lambda said: commits.append(said) if said == "COMMIT" else None)
        return made

    memory, _, _ = writer(tmp_path)
    made = EventWriter(memory, tmp_path, lambda: PLENTY, connect=watched)
    made.drain()
    commits.clear()
    for ring in memory.events:
        assert EventLog(ring).put("command", "one")
        assert EventLog(ring).put("command", "two")
    assert made.drain()
    assert commits == ["COMMIT"]
    rows = [row.values for row in read_journal(tmp_path)]
    assert [(row["source"], row["number"]) for row in rows] == [
        (n, m) for n in range(len(memory.events)) for m in (1, 2)
    ]
    made.close()


def test_only_the_anchors_of_a_journal_are_compared_with_it() -> None:
    mine, other = Anchor(1, "00", "", "mine"), Anchor(1, "11", "", "other")
    assert of_journal([mine, other, mine], "mine") == {1: [mine, mine]}


@pytest.mark.parametrize(
    ("row", "lock"),
    [
        (own_row("service", "a note"), 5),
        (own_row("alarm", "something is missing", lock=True), 9),
        (row_of(1, 2, 3, b'{"kind": "command", "text": "x"}'), 5),
        (row_of(1, 2, 3, b'{"kind": "journal", "text": "acknowledged"}'), 0),
    ],
)
def test_a_lock_is_set_by_the_writer_and_freed_by_somebody_else(row: tuple[Any, ...], lock: int) -> None:
    """It was set by event 5; this is event 9."""
    assert lock_after(5, 9, row) == lock


def test_an_anchor_behind_a_torn_one_counts(tmp_path: Path) -> None:
    made = Journal(tmp_path)
    places_of(tmp_path).anchors.write_text("7 0123456789")
    made.append(1, 0, 1, [b'{"kind": "command", "text": "one", "utc": "2026-01-01T00:00:00Z"}'])
    newest = made.anchor()
    made.close()
    assert kept_anchors(places_of(tmp_path).anchors) == [newest]
