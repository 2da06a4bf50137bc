"""Shared memory by hand: who writes where, what a journal keeps, what is told of events, and where the axis was."""

from __future__ import annotations

import json
import math
import struct
from datetime import datetime, tzinfo
from types import SimpleNamespace
from typing import Self

import pytest

from gantryctl.errors import UsageError
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory import events as events_module
from gantryctl.service.memory import memory as module
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.frame_ring import LinkOpened, RingFrames, unpacked
from gantryctl.service.memory.last_seen import LastSeen
from gantryctl.service.memory.memory import JournalHealth, JournalState, SharedMemory, Word
from gantryctl.service.memory.ring import Ring
from gantryctl.service.memory.seqlock import SequenceLock
from gantryctl.service.memory.snapshot import FAST, Snapshot, publish_fast, publish_json, rounded
from gantryctl.service.memory.trace_ring import RingRecorder
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role
from support.service_bench import ring


def test_every_area_is_one_of_its_own_for_all_processes() -> None:
    """What one process writes into each of them another one reads there, and nowhere else."""
    writer = SharedMemory.create()
    reader = SharedMemory(writer.handle)
    locks = ("fast", "slow", "alarms", "columns", "commissioning")
    for name in locks:
        getattr(writer, name).publish(name.encode())
    rings = {
        **{f"commands {n}": (writer.commands[n], reader.commands[n]) for n in range(2)},
        **{f"replies {n}": (writer.replies[n], reader.replies[n]) for n in range(2)},
        **{f"events {n}": (writer.events[n], reader.events[n]) for n in range(4)},
        "rows": (writer.rows, reader.rows),
        "frames": (writer.frames, reader.frames),
    }
    for name, (one, _) in rings.items():
        assert one.put(name.encode())
    for word in Word:
        writer.words[word] = 1000 + word
    assert [getattr(reader, name).read() for name in locks] == [name.encode() for name in locks]
    assert [other.peek(9) for _, other in rings.values()] == [[name.encode()] for name in rings]
    assert [reader.words[word] for word in Word] == [1000 + word for word in Word]
    assert len(Word) == len(Word.__members__)  # no word has two names: each has one writer
    writer.close()


@pytest.mark.parametrize(
    ("silent_s", "state", "keeps"),
    [
        (9.9, JournalState.OK, True), (10.1, JournalState.OK, False), (0.0, JournalState.SLOW, True),
        (0.0, JournalState.FULL, False), (0.0, JournalState.FAILED, False), (0.0, JournalState.LOCKED, False),
    ],
)  # fmt: skip
def test_events_are_kept_by_a_recorder_that_lives_with_a_journal_that_takes_them(
    monkeypatch: pytest.MonkeyPatch, silent_s: float, state: JournalState, keeps: bool
) -> None:
    memory = SharedMemory.create()
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic_ns=lambda: 100_000_000_000))
    memory.words[Word.RECORDER_NS] = round((100.0 - silent_s) * 1e9)
    memory.words[Word.JOURNAL_STATE] = state
    health = JournalHealth(memory.words)
    assert health.keeps is keeps
    assert health.locked is (state is JournalState.LOCKED)
    memory.close()


def test_each_gap_is_told_once_with_its_own_number() -> None:
    made = ring(4)
    log = EventLog(made)
    missing = []
    for lost in (3, 1):
        made.clear()
        for number in range(4 + lost):
            log.put("command", f"event {number}")
        made.clear()
        log.put("command", "behind it")
        missing.append(json.loads(made.take() or b"")["text"].split()[0])
        assert [json.loads(record or b"")["text"] for record in made.peek(9)] == ["behind it"]
    assert missing == ["3", "1"]


def test_an_event_that_is_too_long_keeps_half_of_its_text_and_no_values(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """1,016 bytes find their place. It is one o'clock where the computer stands, and noon in UTC."""

    class Here(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Self:
            return cls(2026, 1, 2, 13 if tz is None else 12, tzinfo=tz)

    monkeypatch.setattr(events_module, "datetime", Here)
    memory = SharedMemory.create()
    log = EventLog(memory.events[0])
    for length, kept, values in ((400, 400, {"n": 1}), (600, 250, {})):
        text = "x" * length
        # Characters of four bytes: 500 bytes of text and as many of values do not fit.
        assert log.put("note", text, **({"n": 1} if values else {"n": "y" * 600}))
        found = json.loads(memory.events[0].take() or b"")
        assert (len(found["text"]), found["values"]) == (kept, values)
        assert found["utc"] == "2026-01-02T12:00:00.000+00:00"
    memory.close()


@pytest.mark.parametrize(
    ("seen", "known"),
    [((1.5, 0.25), True), ((None, 0.25), False), ((1.5, None), False), ((None, None), False)],
)
def test_where_the_axis_was_is_told_with_both_numbers_or_not_at_all(
    seen: tuple[float | None, float | None], known: bool
) -> None:
    line = LastSeen(*seen).told(Words.AT_TIME(utc="2026-01-02")).line
    assert ("it was at an angle that is not known" in line) is not known
    assert ("1.5" in line) is known


def test_a_torn_record_is_passed_over_and_counted() -> None:
    """The second of three was changed behind its check sum."""
    made = ring(4)
    for text in (b"one", b"two", b"six"):
        assert made.put(text)
    made._memory[192 + made._slot + 8] ^= 1
    assert made.peek(9) == [b"one", None, b"six"]
    assert [made.take(), made.take(), made.take()] == [b"one", b"six", None]
    assert made.damaged == 1


def test_a_writer_behind_one_that_was_killed_while_it_wrote_is_read() -> None:
    memory = SharedMemory.create()
    lock = memory.fast
    lock.publish(b"one")
    assert (lock.version, lock.read()) == (1, b"one")
    lock._words[0] |= 1
    assert lock.read() is None
    lock.publish(b"two")
    assert (lock.version, lock.read()) == (2, b"two")
    memory.close()


@pytest.mark.parametrize(("waiting", "room"), [(0, True), (2047, True), (2048, False), (4096, False)])
def test_the_last_places_are_kept_for_stops_and_alarms(waiting: int, room: bool) -> None:
    """2,048 of them, of 4,096."""
    made = ring(4096, 16)
    for _ in range(waiting):
        assert made.put(b"")
    assert EventLog(made).room is room


def test_a_ring_has_a_place_at_least() -> None:
    one = ring(1)
    assert (one.put(b"one"), one.put(b"two"), one.take()) == (True, False, b"one")
    with pytest.raises(UsageError, match="no room for a slot"):
        ring(0)


def test_a_row_has_sixty_four_columns_at_most() -> None:
    memory = SharedMemory.create()
    made = RingRecorder(memory.rows, [f"c{n}" for n in range(64)])
    made.number = 1
    made.record((1.0,) * 64)
    assert (made.lost, len(memory.rows)) == (0, 1)
    with pytest.raises(UsageError, match="65 columns: the ring takes 64"):
        RingRecorder(memory.rows, [f"c{n}" for n in range(65)])
    memory.close()


def test_a_recording_ends_with_its_recorder_and_each_by_its_number() -> None:
    memory = SharedMemory.create()
    made = RingRecorder(memory.rows, ["time_s"])
    made.number = 41
    made.record((1.0,))
    made.close()
    made.record((2.0,))
    made.end(40)
    made.end(0)
    assert memory.rows.peek(9) == [
        struct.pack("<3d", 41, 0, 1.0),
        struct.pack("<d", 41),
        struct.pack("<d", 40),
    ]
    memory.close()


# --- what is read while it is written ---------------------------------------------------------------------------------


def test_a_record_that_is_replaced_while_it_is_copied_is_copied_again() -> None:
    memory = SharedMemory.create()
    lock = memory.fast
    lock.publish(b"one")
    words, looks = lock._words, list[int]()

    class Words:
        def __getitem__(self, at: int) -> int:
            looks.append(at)
            if len(looks) == 2:
                lock._words = words
                lock.publish(b"two")
            return words[at]

    lock._words = Words()  # type: ignore[assignment]
    assert lock.read() == b"two"
    memory.close()


def test_a_record_with_one_wrong_bit_is_none() -> None:
    memory = SharedMemory.create()
    memory.fast.publish(b"one")
    memory.fast._memory[24] ^= 1
    assert memory.fast.read() is None
    memory.close()


def test_an_alarm_that_comes_while_the_tags_are_read_is_shown_with_the_next_look() -> None:
    memory = SharedMemory.create()
    picture, read = Snapshot(memory), memory.alarms.read
    publish_json(memory.slow, {"machine": "a"})
    late = [{"alarms": ["late"]}]

    def read_and_write() -> bytes | None:
        found = read()
        if late:
            publish_json(memory.alarms, late.pop())
        return found

    memory.alarms.read = read_and_write  # type: ignore[method-assign]
    assert [picture.slow()["alarms"] for _ in range(2)] == [[], ["late"]]
    memory.close()


@pytest.mark.parametrize("value", [-0.0, -4e-7, 4e-7])
def test_there_is_no_minus_zero_on_the_wire(value: float) -> None:
    assert json.dumps(rounded(value)) == "0.0"


def test_a_picture_of_another_version_is_none_and_the_one_before_stays() -> None:
    memory = SharedMemory.create()
    picture = Snapshot(memory)
    memory.fast.publish(bytes(24))
    assert picture.fast() == ({}, math.inf)
    publish_fast(memory.fast, {**dict.fromkeys(FAST, 0.0), "pos_act_deg": 1.5}, 5)
    assert picture.fast()[0]["pos_act_deg"] == 1.5
    memory.fast.publish(bytes(24))
    assert picture.fast()[0]["pos_act_deg"] == 1.5
    memory.close()


# --- where it lies ----------------------------------------------------------------------------------------------------


def test_each_area_begins_at_a_multiple_of_eight_bytes() -> None:
    """Head, tail and sequence are stored at once only there."""
    begins, at = dict[str, int](), 0
    for name, size in module._AREAS:
        begins[name], at = at, at + size
    assert {name: begin % 8 for name, begin in begins.items()} == dict.fromkeys(begins, 0)


def test_a_ring_has_as_many_places_as_fit_behind_its_numbers() -> None:
    """192 bytes of them; places of 40 bytes."""
    for length, slots in ((192 + 3 * 40, 3), (192 + 3 * 40 + 39, 3), (192 + 4 * 40, 4)):
        assert Ring(memoryview(bytearray(length)), 40).slots == slots


# --- what a record says -----------------------------------------------------------------------------------------------


def test_an_event_has_one_line_and_the_time_of_its_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a name nor a text forges a line of a log."""
    monkeypatch.setattr(events_module, "time", SimpleNamespace(monotonic_ns=lambda: 7_000_000_123))
    made = ring(4)
    EventLog(made).put("login", "in\rout", Identity("c\x1b1", "an\nna", Role.OPERATOR, "console"), n=1)
    found = json.loads(made.take() or b"")
    del found["utc"]
    assert found == {
        "monotonic_ns": 7_000_000_123, "kind": "login", "user": "an\ufffdna", "role": "operator",
        "client": "c\ufffd1", "place": "console", "text": "in\ufffdout", "values": {"n": 1},
    }  # fmt: skip


def test_a_link_of_the_bus_has_the_first_sixteen_bytes_of_its_name() -> None:
    """A letter that is cut in two ends no recorder."""
    made = ring(4, 40)
    frames = RingFrames(made)
    for channel, virtual in (("can0", False), ("x" * 15 + "é", True)):
        frames.link(channel, virtual=virtual)
    assert [unpacked(made.take() or b"") for _ in range(2)] == [
        LinkOpened("can0", virtual=False), LinkOpened("x" * 15 + "\ufffd", virtual=True)
    ]  # fmt: skip


def test_a_record_is_no_longer_than_its_place() -> None:
    """One byte more would lie in the next one."""
    made = ring(2, 32)
    for length, taken in ((24, True), (25, False), (32, False)):
        if taken:
            assert made.put(b"x" * length)
            continue
        with pytest.raises(UsageError, match=f"record of {length} bytes: a slot takes 24"):
            made.put(b"x" * length)
    assert made.peek(9) == [b"x" * 24]
    with pytest.raises(UsageError, match="slot of 36 bytes: a multiple of 8 is needed"):
        Ring(memoryview(bytearray(400)), 36)
    lock = SequenceLock(memoryview(bytearray(40)))
    lock.publish(b"x" * 16)
    with pytest.raises(UsageError, match="record of 17 bytes: there is room for 16"):
        lock.publish(b"y" * 17)
    assert lock.read() == b"x" * 16
