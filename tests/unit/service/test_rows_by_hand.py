"""Rows of the scan on their way from the ring into a file, with a file and a filter that write down what they get."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import DeviceError
from gantryctl.service.memory.memory import Word
from gantryctl.service.recorder import trace_writer
from gantryctl.service.recorder.retention import MB, RetentionPolicy
from gantryctl.service.recorder.trace_writer import TraceWriter


class Rows:
    """A ring of 100 places."""

    slots = 100

    def __init__(self) -> None:
        self.records: list[bytes] = []

    def __len__(self) -> int:
        return len(self.records)

    def peek(self, most: int, after: int = 0) -> list[bytes]:
        return self.records[after : after + most]

    def advance(self, count: int) -> None:
        del self.records[:count]

    def put(self, number: int, *times: float) -> None:
        self.records += [struct.pack("<3d", number, 0.0, time_s) for time_s in times]

    def end(self, number: int) -> None:
        self.records.append(struct.pack("<d", number))


class Desk:
    """A writer, its disk and its clock.

    Attributes:
        did: what became of the files. free_mb: on the disk. holds: rows that the filter has not decided on.
        fails: a file that takes no row.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        self.did: list[Any] = []
        self.now_s, self.free_mb, self.holds, self.fails, self.size_mb = 100.0, 1000.0, 0, False, 1.0
        self.rows = Rows()
        self.words = {Word.RECORDING_STOPPED: 0, Word.RECORDING_LONG: 0}
        about = json.dumps({"columns": ["time_s"], "metadata": {"period_s": 0.001}}).encode()
        memory: Any = SimpleNamespace(
            rows=self.rows, words=self.words, columns=SimpleNamespace(read=lambda: about)
        )
        desk = self

        class File:
            resumed_s = 0.0

            def __init__(self, path: Path, *_: object, **__: object) -> None:
                self.live_path = path
                desk.did.append("begun")

            def record(self, row: Any) -> None:
                if desk.fails:
                    raise DeviceError("full")
                desk.did.append(row[0])

            def flush(self) -> None:
                desk.did.append(("flushed", len(desk.rows)))

            def close(self) -> None:
                desk.did.append("closed")

            def leave(self) -> None:
                desk.did.append("left")

        class Filter:
            def __init__(self, *_: object) -> None:
                self.waiting: list[Any] = []

            @property
            def held(self) -> int:
                return len(self.waiting)

            def take(self, mark: float, row: Any) -> list[Any]:
                self.waiting.append(row)
                kept = len(self.waiting) - desk.holds
                decided, self.waiting = self.waiting[: max(0, kept)], self.waiting[max(0, kept) :]
                return decided

            def flush(self) -> list[Any]:
                found, self.waiting = self.waiting, []
                return found

        monkeypatch.setattr(trace_writer, "ArrowRecorder", File)
        monkeypatch.setattr(trace_writer, "RowFilter", Filter)
        monkeypatch.setattr(trace_writer, "time", SimpleNamespace(monotonic=lambda: self.now_s))
        self.writer = TraceWriter(
            memory, folder, lambda: int(self.free_mb * MB), RetentionPolicy(reserve_mb=64)
        )
        monkeypatch.setattr(self.writer, "_size", lambda: int(self.size_mb * MB))

    def drain(self, seconds: float = 1.0) -> list[Any]:
        """What is done a while later."""
        self.now_s += seconds
        self.did.clear()
        self.writer.drain()
        self.writer.join()
        return list(self.did)


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Desk:
    return Desk(monkeypatch, tmp_path)


def test_a_row_leaves_the_ring_when_it_is_in_the_file(desk: Desk) -> None:
    """Of five rows the filter holds two, which stay for a recorder that comes after a killed one."""
    desk.holds = 2
    desk.rows.put(1, 0.0, 1.0, 2.0, 3.0, 4.0)
    assert desk.drain() == ["begun", 0.0, 1.0, 2.0, ("flushed", 5)]
    assert len(desk.rows) == 2
    # What was taken already is not taken twice.
    desk.rows.put(1, 5.0)
    assert desk.drain(11.0) == [3.0, ("flushed", 3)]
    assert len(desk.rows) == 2


def flushed(did: list[Any]) -> int:
    return sum(isinstance(each, tuple) for each in did)


def test_at_rest_a_block_is_written_every_ten_seconds_or_when_the_ring_is_half_full(desk: Desk) -> None:
    desk.holds = 2
    desk.rows.put(1, *range(5))
    desk.drain()
    for seconds, flushes in ((1.0, 0), (8.0, 0), (2.0, 1)):
        desk.rows.put(1, 10.0)
        assert flushed(desk.drain(seconds)) == flushes
    # 48 and the two that are held are half of a hundred; one more is beyond it.
    desk.rows.put(1, *[20.0] * 48)
    assert flushed(desk.drain()) == 0
    desk.rows.put(1, 21.0)
    assert flushed(desk.drain()) == 1
    assert len(desk.rows) == 2


def test_rows_wait_for_a_second(desk: Desk) -> None:
    desk.rows.put(1, 0.0)
    desk.drain()
    desk.rows.put(1, 1.0)
    assert desk.drain(0.9) == []
    assert desk.drain(0.1) == [1.0, ("flushed", 1)]


@pytest.mark.parametrize(
    ("free_mb", "stopped", "begins"), [(65, 0, True), (63, 0, False), (70, 1, False), (71, 1, True)]
)
def test_a_disk_has_room_again_with_a_tenth_more_than_its_reserve(
    desk: Desk, free_mb: float, stopped: int, begins: bool
) -> None:
    """64 MB are the reserve: 70.4 are enough once it was passed."""
    desk.free_mb, desk.words[Word.RECORDING_STOPPED] = free_mb, stopped
    desk.rows.put(1, 0.0)
    assert ("begun" in desk.drain()) is begins
    assert bool(desk.words[Word.RECORDING_STOPPED]) is not begins


@pytest.mark.parametrize(("size_mb", "long"), [(64.0, 0), (65.0, 3)])
def test_a_file_of_64_megabytes_is_long(desk: Desk, size_mb: float, long: int) -> None:
    desk.rows.put(3, 0.0)
    desk.drain()
    desk.size_mb = size_mb
    desk.rows.put(3, 1.0)
    desk.drain()
    assert desk.words[Word.RECORDING_LONG] == long


def test_a_recording_that_has_ended_is_not_begun_again(desk: Desk) -> None:
    desk.rows.put(1, 0.0)
    desk.rows.end(1)
    assert desk.drain() == ["begun", 0.0, "closed"]
    assert desk.drain() == []
    desk.rows.put(2, 0.0)
    assert desk.drain() == ["begun", 0.0, ("flushed", 1)]


def test_the_end_of_a_recording_that_nobody_has_seen_begins_none(desk: Desk) -> None:
    desk.rows.put(1, 0.0)
    desk.drain()
    desk.rows.end(2)
    assert desk.drain() == ["closed"]


def test_a_recording_that_was_left_for_want_of_room_goes_on_and_is_closed_at_its_end(
    desk: Desk, tmp_path: Path
) -> None:
    desk.rows.put(1, 0.0)
    desk.drain()
    desk.free_mb = 10.0
    desk.rows.put(1, 1.0)
    assert desk.drain() == ["left"]
    desk.free_mb = 1000.0
    desk.rows.put(1, 2.0)
    assert desk.drain() == ["begun", 2.0, ("flushed", 1)]


def test_a_file_that_takes_nothing_is_left_and_the_ring_goes_on(desk: Desk) -> None:
    desk.rows.put(1, 0.0)
    desk.drain()
    desk.holds, desk.fails = 1, True
    desk.rows.put(1, 1.0, 2.0, 3.0)
    desk.drain()
    assert len(desk.rows) == 0


@pytest.mark.parametrize("last", [True, False])
def test_only_the_last_process_closes_the_file(desk: Desk, last: bool) -> None:
    """With what the filter holds; the recorder that comes next goes on with one that is left."""
    desk.holds = 1
    desk.rows.put(1, 0.0, 1.0)
    desk.drain()
    desk.did.clear()
    desk.writer.end(last=last)
    assert desk.did == [1.0, "closed" if last else "left"]
