"""The writer of events at each of its looks: health, what it tells, when it prunes and anchors, how it ends."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import JournalState, SharedMemory, Word
from gantryctl.service.recorder import process
from gantryctl.service.recorder.journal.writer import JournalFault
from gantryctl.service.recorder.process import EventWriter
from gantryctl.service.recorder.retention import MB, RetentionPolicy
from support.unread import unread_stream

PLENTY = 10**12
DAY_S = 86400.0


class Kept:
    """A journal that says what was asked of it, and fails while `fault` is set."""

    def __init__(self, *_: object) -> None:
        self.done: list[tuple[object, ...]] = []
        self.fault: JournalFault | None = None
        self.locked = False
        self.taken = 0
        self.during: Callable[[], None] = lambda: None

    def look(self) -> None:
        if self.fault is not None:
            raise self.fault

    def append_all(self, boot: int, batches: list[Any]) -> None:
        self.during()
        self.done.append(("events", boot, sum(len(batch.records) for batch in batches)))

    def note(self, kind: str, text: str, **values: object) -> None:
        self.done.append((kind, text))

    def reflect(self) -> None:
        self.done.append(("reflected",))

    def prune(self, days: int, bytes_max: int) -> int:
        self.done.append(("pruned", days, bytes_max))
        return self.taken

    def anchor(self) -> Any:
        self.done.append(("anchored",))
        return SimpleNamespace(line="7 00 - journal")

    def settle(self) -> None:
        self.done.append(("settled",))

    def close(self) -> None:
        self.done.append(("closed",))

    def times(self, what: str) -> int:
        return sum(each[0] == what for each in self.done)

    def told(self) -> list[str]:
        return [str(each[1]) for each in self.done if each[0] == "alarm"]


class Bench:
    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, directory: Path, policy: RetentionPolicy | None = None
    ) -> None:
        self.now_s, self.free = 100.0, PLENTY
        self.journal, self.opened = Kept(), 0
        monkeypatch.setattr(process, "time", SimpleNamespace(monotonic=lambda: self.now_s))
        monkeypatch.setattr(process, "Journal", self.open)
        self.memory = SharedMemory.create()
        self.memory.words[Word.BOOT] = 5
        self.writer = EventWriter(self.memory, directory, lambda: self.free, policy)
        self.log = EventLog(self.memory.events[2])

    def open(self, *_: object) -> Kept:
        self.opened += 1
        return self.journal


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Bench:
    return Bench(monkeypatch, tmp_path)


@pytest.mark.parametrize(
    ("failed", "free", "locked", "busy_s", "state"),
    [
        (False, PLENTY, False, None, JournalState.OK),
        (False, 16 * MB, False, 1.0, JournalState.OK),
        (False, PLENTY, False, 1.01, JournalState.SLOW),
        (False, PLENTY, True, 1.01, JournalState.LOCKED),
        (False, 16 * MB - 1, True, 1.01, JournalState.FULL),
        (True, 0, True, 1.01, JournalState.FAILED),
    ],
)
def test_the_gravest_of_what_is_wrong_is_its_health(
    bench: Bench, failed: bool, free: int, locked: bool, busy_s: float | None, state: JournalState
) -> None:
    """16 MB are reserved for events; a commit of a second is slow."""
    bench.writer.drain()
    bench.writer.failed, bench.free, bench.journal.locked = failed, free, locked
    bench.writer.began_s = None if busy_s is None else bench.now_s - busy_s
    assert bench.writer.state is state


def test_a_journal_that_works_again_has_not_failed(bench: Bench) -> None:
    bench.writer.failed = True
    bench.writer.drain()
    assert not bench.writer.failed


@pytest.mark.parametrize(("damaged", "opened"), [(True, 2), (False, 1)])
def test_only_a_damaged_journal_is_opened_anew(bench: Bench, damaged: bool, opened: int) -> None:
    bench.journal.fault = JournalFault("the disk is full", damaged=damaged)
    with pytest.raises(JournalFault):
        bench.writer.drain()
    assert bench.journal.times("closed") == damaged
    bench.journal.fault = None
    bench.writer.drain()
    assert bench.opened == opened


def test_events_and_what_it_says_itself_are_mirrored_in_the_same_look(bench: Bench) -> None:
    bench.log.put("command", "one")
    bench.log.put("command", "two")
    bench.writer.tell("three")
    assert bench.writer.drain()
    assert bench.journal.done[:3] == [("events", 5, 2), ("service", "three"), ("reflected",)]
    assert bench.journal.done[-1] == ("settled",)
    assert bench.writer.all_kept
    assert not bench.writer.drain()


def test_the_number_of_a_start_is_taken_with_62_bits(bench: Bench) -> None:
    bench.memory.words[Word.BOOT] = 2**62 + 2**40 + 9
    bench.log.put("command", "one")
    bench.writer.drain()
    assert bench.journal.done[0] == ("events", 2**40 + 9, 1)


@pytest.mark.parametrize(("took_s", "told"), [(1.0, False), (1.5, True)])
def test_a_slow_commit_is_told_once(bench: Bench, took_s: float, told: bool) -> None:
    def wait() -> None:
        bench.now_s += took_s
        assert bench.writer.state is (JournalState.SLOW if told else JournalState.OK)

    bench.journal.during = wait
    bench.log.put("command", "one")
    bench.writer.drain()
    bench.now_s += 10.0
    assert bench.writer.state is JournalState.OK
    assert any(line.startswith("JRN-02") for line in bench.journal.told()) is told
    bench.journal.done.clear()
    bench.writer.drain()
    assert bench.journal.told() == []


@pytest.mark.parametrize(
    ("looks_mb", "told"),
    [
        ([1000], []),
        # Near the reserve, and never below it.
        ([70, 65], []),
        # 64 and 16 MB are reserved; a tenth more is room again.
        ([64, 63, 63], ["JRN-01"]),
        ([63, 70, 71], ["JRN-01", "room again: 71 MB"]),
        ([63, 15, 17, 18, 63], ["JRN-01", "JRN-01", "JRN-01"]),
    ],
)
def test_a_disk_that_gets_full_is_told_at_each_step_and_with_room_again(
    bench: Bench, looks_mb: list[int], told: list[str]
) -> None:
    for free_mb in looks_mb:
        bench.free = free_mb * MB
        bench.writer.drain()
    found = [str(text) for kind, text, *_ in (d for d in bench.journal.done if len(d) == 2)]
    assert len(found) == len(told)
    assert all(words in line for words, line in zip(told, found, strict=True))


def test_it_prunes_every_ten_minutes_and_goes_on_at_once_while_there_is_more(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    bench = Bench(monkeypatch, tmp_path, RetentionPolicy(journal_mb=3, journal_days=30))
    bench.journal.taken = 20_000
    for _ in range(3):
        bench.writer.drain()
    assert bench.journal.times("pruned") == 3
    assert ("pruned", 30, 3 * 1024 * 1024) in bench.journal.done
    bench.journal.taken = 0
    bench.writer.drain()
    for after_s, times in ((599.0, 4), (1.0, 5)):
        bench.now_s += after_s
        bench.writer.drain()
        assert bench.journal.times("pruned") == times


def test_it_anchors_at_the_start_every_day_and_at_the_end(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    for after_s, times in ((0.0, 1), (DAY_S - 1.0, 1), (1.0, 2), (1.0, 2)):
        bench.now_s += after_s
        bench.writer.drain()
        assert bench.journal.times("anchored") == times
    bench.writer.close()
    assert bench.journal.times("anchored") == 3
    assert bench.journal.done[-1] == ("closed",)
    assert capsys.readouterr().err == "journal anchor: 7 00 - journal\n" * 3


def test_a_journal_goes_on_where_nobody_reads_its_anchors(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    with unread_stream() as gone:
        monkeypatch.setattr(sys, "stderr", gone)
        bench.log.put("command", "move")
        assert bench.writer.drain()
        bench.now_s += DAY_S
        assert not bench.writer.drain()
        monkeypatch.undo()
    assert bench.journal.times("anchored") == 2


def test_what_comes_in_the_last_look_is_kept(bench: Bench) -> None:
    """It is told to end while it looks, and an event comes after this look."""
    ended, looks = threading.Event(), 0
    drain = bench.writer.drain

    def last() -> bool:
        nonlocal looks
        looks += 1
        busy = drain()
        if looks == 1:
            bench.log.put("command", "the last one")
            ended.set()
        return busy

    bench.writer.drain = last  # type: ignore[method-assign]
    bench.writer.run(ended)
    assert ("events", 5, 1) in bench.journal.done
    assert bench.writer.all_kept


def test_a_failure_is_told_with_its_length_when_it_is_over(bench: Bench) -> None:
    """Two failed looks, 30 s apart, and 30 s later the disk works again: a minute from the first one on."""
    ended, looks = threading.Event(), 0
    drain = bench.writer.drain
    wait = ended.wait
    pauses: list[float | None] = []

    def look() -> bool:
        nonlocal looks
        looks += 1
        bench.journal.fault = JournalFault("the disk is gone") if looks <= 2 else None
        bench.now_s += 30.0 if looks > 1 else 0.0
        if looks == 3:
            ended.set()
        return drain()

    def paused(timeout: float | None = None) -> bool:
        pauses.append(timeout)
        return wait(0.0)

    bench.writer.drain, ended.wait = look, paused  # type: ignore[method-assign]
    bench.writer.run(ended)
    (line,) = bench.journal.told()
    assert line.startswith("JRN-02")
    assert "60" in line
    # A second between two tries, not the milliseconds of a look.
    assert pauses[:2] == [1.0, 1.0]


def test_an_event_never_waits_for_the_upkeep_and_the_upkeep_never_for_an_event(bench: Bench) -> None:
    """Looks of 10 ms: files and disk every 100 ms, an event in the look after it came, whenever that is."""
    ended, kept_s, seen = threading.Event(), list[float](), 0

    def paused(timeout: float | None = None) -> bool:
        nonlocal seen
        if bench.journal.times("events") > seen:
            seen += 1
            kept_s.append(round(bench.now_s - 100.0, 3))
        bench.now_s += 0.010
        at_s = round(bench.now_s - 100.0, 3)
        if at_s in (0.03, 0.27):
            bench.log.put("command", "move")
        if at_s >= 1.0:
            ended.set()
        return False

    ended.wait = paused  # type: ignore[method-assign]
    bench.writer.run(ended)
    assert kept_s == [0.03, 0.27]
    # At 0, with each event, every 100 ms behind the last time and at the end; not in each of the 100 looks.
    assert 10 <= bench.journal.times("settled") <= 15
