"""When the recorder may end, what still waits for the disk, and frames that leave their ring; by hand."""

from __future__ import annotations

import os
from collections import deque
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import DeviceError
from gantryctl.service.memory.frame_ring import LinkOpened
from gantryctl.service.recorder import frame_writer, process
from gantryctl.service.recorder.frame_writer import FrameWriter
from gantryctl.service.recorder.process import EventWriter, Others
from gantryctl.service.recorder.retention import RetentionPolicy


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    made = [100.0]
    monkeypatch.setattr(process, "time", SimpleNamespace(monotonic=lambda: made[0]))
    return made


def test_a_recorder_goes_on_until_it_is_told_to_end(now: list[float]) -> None:
    """Also where nobody is left: whoever started it reports it."""
    others = Others(-1, 1)
    now[0] += 1e6
    assert not others.look(ending=False)
    assert others.look(ending=True)


def test_a_recorder_waits_for_the_others_for_a_time(now: list[float]) -> None:
    """They hold the other end of a pipe: the time runs from the moment in which it was first told to end."""
    end, held = os.pipe()
    try:
        others = Others(end, 1)
        for seconds, ends in ((0.0, False), (0.6, False), (0.6, True)):
            now[0] += seconds * process._OTHERS_S
            assert others.look(ending=True) is ends
        others = Others(end, 1)
        assert not others.look(ending=True)
        os.close(held)
        held = -1
        assert others.look(ending=True)
        assert others.gone
    finally:
        os.close(end)
        if held >= 0:
            os.close(held)


def test_the_first_process_is_gone_when_another_one_is_the_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "os", SimpleNamespace(getppid=lambda: 7))
    assert not Others(-1, 7).orphaned
    assert Others(-1, 8).orphaned


@pytest.mark.parametrize(
    ("failed", "notes", "waiting", "kept"),
    [(False, 0, 0, True), (True, 0, 0, False), (False, 1, 0, False), (False, 0, 1, False)],
)
def test_a_run_is_clean_when_nothing_waits_for_the_disk(
    failed: bool, notes: int, waiting: int, kept: bool
) -> None:
    writer: Any = object.__new__(EventWriter)
    writer.failed, writer.notes = failed, deque(["a note"] * notes)
    writer._memory = SimpleNamespace(events=[[], ["an event"] * waiting])
    assert writer.all_kept is kept


def test_a_note_that_the_disk_does_not_take_waits(now: list[float]) -> None:
    """It is written once the disk takes it, and once only."""
    writer: Any = object.__new__(EventWriter)
    writer._memory = SimpleNamespace(words={process.Word.BOOT: 1}, events=[])
    writer.notes, writer.failed, writer.began_s = deque(), False, None
    written: list[str] = []
    takes = [False]

    def note(kind: str, text: str, **values: object) -> None:
        if not takes[0]:
            raise DeviceError("full")
        written.append(text)

    nothing = lambda *_: None  # noqa: E731
    journal = writer._journal = SimpleNamespace(look=nothing, note=note, reflect=nothing, settle=nothing)
    for name in ("_report_disk", "_prune", "_keep_anchor"):
        setattr(writer, name, nothing)
    writer.tell("the bus is off")
    for _ in range(2):
        with pytest.raises(DeviceError):
            writer._drain(journal)
        assert len(writer.notes) == 1
    takes[0] = True
    writer._drain(journal)
    writer._drain(journal)
    assert written == ["the bus is off"]


class Frames:
    """A ring of records, and a writer whose recorder writes down what it gets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *records: object) -> None:
        self.records, self.did = list(records), list[object]()
        self.fails, self.told = False, list[str]()
        self.links, self.frozen, self.faults = list[LinkOpened](), list[str](), deque[str]()
        memory: Any = SimpleNamespace(frames=self)
        monkeypatch.setattr(frame_writer, "unpacked", lambda record: record)
        monkeypatch.setattr(frame_writer, "FrameRecorder", lambda log, **_: self.recorder(log))
        self.writer = FrameWriter(
            memory, Path("there"), Path("a.log"), lambda: 2**40, RetentionPolicy(), self.told.append
        )

    def recorder(self, log: Path | None) -> SimpleNamespace:
        def link(channel: str, *, virtual: bool) -> Any:
            if self.fails and log is not None:
                raise DeviceError("no room for a log")
            self.links.append(LinkOpened(channel, virtual))
            return lambda *frame: self.did.append((log, frame, len(self.records)))

        ended = lambda: self.did.append("the log ends")  # noqa: E731
        return SimpleNamespace(
            link=link, frozen=self.frozen, faults=self.faults, close=lambda: None, end_log=ended
        )

    def peek(self, most: int) -> list[object]:
        return self.records[:most]

    def advance(self, count: int) -> None:
        del self.records[:count]


def test_frames_stay_in_their_ring_until_they_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """A killed recorder has lost none."""
    frames = Frames(monkeypatch, LinkOpened("can0", virtual=False), ("one",), ("two",))
    frames.writer.drain()
    assert frames.did == [(Path("a.log"), ("one",), 3), (Path("a.log"), ("two",), 3)]
    assert frames.records == []


def test_where_no_log_can_be_made_alarms_still_have_their_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """That is told once; what is not there needs no room and does not end."""
    frames = Frames(monkeypatch, LinkOpened("can0", virtual=False), ("one",))
    frames.fails = True
    frames.writer.drain()
    assert [log for log, *_ in frames.did] == [None]  # type: ignore[misc, attr-defined]
    assert frames.told == ["there is no log of the bus: no room for a log"]
    monkeypatch.setattr(frames.writer, "_free", lambda: 0)
    frames.writer.drain()
    assert len(frames.told) == 1


def test_frames_behind_a_killed_recorder_are_of_a_bus_with_the_time_of_day(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The link was opened before it came."""
    frames = Frames(monkeypatch, ("one",))
    frames.writer.drain()
    assert frames.links == [LinkOpened("bus", virtual=False)]


def test_every_file_of_frames_and_every_fault_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    frames, told = Frames(monkeypatch), list[int]()
    for new, fault in ((["a"], ""), (["b", "c"], "no room"), ([], ""), (["d"], "")):
        frames.frozen += new
        frames.faults += [fault] if fault else []
        frames.writer.drain()
        told.append(len(frames.told))
    assert told == [1, 4, 4, 5]
    assert [line.split()[-1] for line in frames.told] == ["a", "b", "c", "room", "d"]
