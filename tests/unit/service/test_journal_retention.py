"""What is taken out of the journal by age and size, and what the chain says of it; a disk that is full or slow."""

from __future__ import annotations

import errno
import json
import os
import sqlite3
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import JournalState, SharedMemory, Word
from gantryctl.service.recorder import process as recorder
from gantryctl.service.recorder.journal import writer as journal_module
from gantryctl.service.recorder.journal.key import read_key
from gantryctl.service.recorder.journal.mirror import SystemFile, read_mirror
from gantryctl.service.recorder.journal.places import FILE, places_of
from gantryctl.service.recorder.journal.proof import Fault, verify
from gantryctl.service.recorder.journal.reading import anchor, compare, copy_journal, read_journal
from gantryctl.service.recorder.journal.writer import Journal, JournalFault
from gantryctl.service.recorder.process import EventWriter
from gantryctl.service.recorder.retention import MB, RetentionPolicy
from support.power_cut import Disk, Step

pytestmark = pytest.mark.usefixtures("keys")
PLENTY = 10**12
KEPT = 10


@pytest.fixture(autouse=True)
def _few_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_module, "KEPT_LEAST", KEPT)


def record(text: str, day: int = 1) -> bytes:
    utc = f"2026-01-{day:02d}T00:00:00.000+00:00"
    return json.dumps({"utc": utc, "monotonic_ns": 1, "kind": "command", "text": text}).encode()


def filled(directory: Path, days: int = 25) -> Journal:
    """Four events and an anchor a day."""
    made = Journal(directory)
    for day in range(days):
        made.append(1, 0, 4 * day + 1, [record(f"event {4 * day + n}", day + 1) for n in range(1, 5)])
        made.anchor()
    return made


def test_old_events_are_taken_out_and_the_chain_goes_on(tmp_path: Path) -> None:
    made = filled(tmp_path)
    kept = anchor(tmp_path)
    assert made.prune(15, PLENTY) == 40
    key = read_key(made.places.key)
    shown = [read_mirror(mirror, key).newest for mirror in made.places.mirrors]
    assert [each is not None and each.anchor == made.newest for each in shown] == [True, True]
    made.append(1, 0, 101, [record("event 101")])
    made.close()
    rows = read_journal(tmp_path)
    assert rows[0].values["text"] == "event 41"
    assert rows[-2].values["text"] == "events 1 to 40 were taken out by age or size"
    verdict = verify(tmp_path, [kept])
    assert verdict[:4] == (62, "", 41, 1)
    again = Journal(tmp_path)  # opened anew, it is the same journal
    assert again.moved_aside is None
    assert again.prune(15, PLENTY) == 0
    again.close()


@pytest.mark.parametrize("wrong", ["2036-01-01", "1970-01-01"])
def test_a_clock_that_was_stepped_counts_as_one_day(wrong: str, tmp_path: Path) -> None:
    """Ten years ahead, or to 1970, for a day, and right again: one date more, and no event goes before its turn."""
    made = filled(tmp_path)
    event = json.loads(record("wrong")) | {"utc": f"{wrong}T12:00:00.000+00:00"}
    made.append(1, 0, 101, [json.dumps(event).encode()])
    made.anchor()
    assert made.prune(25, PLENTY) == 4  # of the first day
    made.append(1, 0, 102, [record("event 102", 26)])
    made.anchor()
    assert made.prune(25, PLENTY) == 4
    assert read_journal(tmp_path)[0].values["text"] == "event 9"
    made.close()


def test_by_size_the_oldest_go_until_it_fits_and_the_newest_stay_whatever_happens(tmp_path: Path) -> None:
    made = filled(tmp_path)
    used = made.path.stat().st_size + 40_000
    assert made.prune(0, used) == 0
    assert made.prune(0, 0) == 100 - KEPT
    made.close()
    assert verify(tmp_path)[:4] == (KEPT + 1, "", 91, 0)


def test_a_quota_holds_however_many_events_come(tmp_path: Path) -> None:
    made, most = Journal(tmp_path), 100_000
    for first in range(1, 4001, 100):
        made.append(1, 0, first, [record(f"event {first + n} " + "x" * 200) for n in range(100)])
        while made.prune(0, most):
            pass
    made.close()
    assert verify(tmp_path).wrong == ""
    assert verify(tmp_path).first > 3000
    assert made.path.stat().st_size < 2 * most  # before each pruning there is one batch more


@pytest.mark.parametrize(
    ("edit", "wrong"),
    [
        ("DELETE FROM events WHERE seq <= 50; UPDATE base SET seq = 50, hash = (SELECT hash FROM kept)",
         "rows up to 50 were removed, and no event records it"),
        ("DELETE FROM events WHERE seq = 41", "row 41 is missing"),
        ("UPDATE base SET hash = 'x'", "rows up to 40 were removed, and no event records it"),
        ("UPDATE base SET seq = 0", "its name is not the one it began with"),
        ("DELETE FROM events WHERE kind = 'journal'", "rows up to 40 were removed, and no event records it"),
    ],
)  # fmt: skip
def test_nobody_takes_out_more_than_the_chain_says(tmp_path: Path, edit: str, wrong: str) -> None:
    made = filled(tmp_path)
    made.prune(15, PLENTY)
    made.close()
    db = sqlite3.connect(tmp_path / FILE)
    db.executescript(f"CREATE TEMP TABLE kept AS SELECT hash FROM events WHERE seq = 50; {edit}")
    db.close()
    assert verify(tmp_path).wrong == wrong


def test_an_anchor_kept_elsewhere_finds_a_journal_that_was_made_anew(tmp_path: Path) -> None:
    filled(tmp_path).close()
    kept = anchor(tmp_path)
    assert kept.seq == 100
    assert verify(tmp_path, [kept]).anchors == 1
    for path in places_of(tmp_path).mirrors:
        path.unlink()
    (tmp_path / FILE).unlink()
    filled(tmp_path, 24).close()
    assert verify(tmp_path).wrong == ""
    verdict = verify(tmp_path, [kept])
    assert (verdict.wrong, verdict.fault) == (
        "the last of the anchors given is of another journal",
        Fault.OTHER,
    )
    ours = anchor(tmp_path)
    assert verify(tmp_path, [kept, ours]).wrong == ""  # an older journal's, which was moved aside
    assert verify(tmp_path, [ours._replace(seq=200)]).fault is Fault.SHORT
    another = verify(tmp_path, [ours._replace(hash=kept.hash)])
    assert another.wrong == f"event {ours.seq} is another one than on {ours.utc}"


def test_the_anchor_of_the_last_event_taken_out_still_counts(tmp_path: Path) -> None:
    made = filled(tmp_path)
    right = made.newest._replace(seq=40, hash=read_journal(tmp_path, after=39, limit=1)[0].hash, utc="then")
    made.prune(15, PLENTY)
    made.close()
    assert verify(tmp_path, [right]).wrong == ""
    assert verify(tmp_path, [right._replace(hash="x")]).wrong == "event 40 is another one than on then"
    assert verify(tmp_path, [right._replace(seq=7, hash="x")])[:4] == (
        61,
        "",
        41,
        0,
    )  # not there any more: not judged


def test_a_first_look_at_the_newest_sees_what_is_wrong_with_them(tmp_path: Path) -> None:
    filled(tmp_path).close()
    assert verify(tmp_path, newest=10)[:4] == (10, "", 91, 0)
    assert verify(tmp_path, newest=1000)[:4] == (100, "", 1, 0)
    for row, wrong in ((90, ""), (95, "row 95 was changed, or one before it was taken out or put in")):
        with sqlite3.connect(tmp_path / FILE) as db:
            db.execute("UPDATE events SET text = 'changed' WHERE seq = ?", (row,))
        db.close()
        assert verify(tmp_path, newest=10).wrong == wrong


class Bench:
    """The journal's thread on a disk of which a test says how much is free and how slow it is."""

    def __init__(self, directory: Path, connect: Callable[[Path], Any] | None = None) -> None:
        self.memory, self.free = SharedMemory.create(), PLENTY
        self.memory.words[Word.BOOT] = 5
        self.log = EventLog(self.memory.events[2])
        self.writer = EventWriter(self.memory, directory, lambda: self.free, RetentionPolicy(), connect)
        self.directory = directory

    def texts(self) -> list[str]:
        return [row.values["text"] for row in read_journal(self.directory)]


def test_the_journal_says_when_room_gets_short_and_when_there_is_room_again(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    for free_mb in (1000, 40, 39, 65, 63, 66, 8, 17, 7, 100):  # at the edges nothing comes and goes
        bench.free = free_mb * MB
        bench.writer.drain()
    assert bench.texts() == [
        "JRN-01 40 MB free on the disk: nothing is recorded below 64 MB",
        "JRN-01 8 MB free on the disk: nothing is recorded below 64 MB, no new motion below 16 MB",
        "the disk has room again: 100 MB free",
    ]
    bench.writer.close()


class Stalling(list[Step]):
    """Steps of a disk that takes its time with every sync."""

    def __init__(self) -> None:
        super().__init__()
        self.go_on = threading.Event()

    def append(self, step: Step) -> None:
        if step.kind == "sync":
            self.go_on.wait(30.0)


def test_events_wait_in_memory_while_the_disk_is_slow_and_none_is_acknowledged_before_it_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "SLOW_S", 0.05)
    disk = Disk(tmp_path)
    bench = Bench(tmp_path, disk.connect)
    bench.writer.drain()
    bench.log.put("command", "first")
    disk.steps = slow = Stalling()
    working = threading.Thread(target=bench.writer.drain)
    working.start()
    until_s = time.monotonic() + 20.0
    while bench.writer.state != JournalState.SLOW and time.monotonic() < until_s:
        time.sleep(0.01)
    assert bench.writer.state == JournalState.SLOW
    assert bench.log.put("command", "second")  # whoever writes does not notice
    assert (len(bench.memory.events[2]), bench.memory.events[2].done) == (2, 0)
    slow.go_on.set()
    working.join()
    bench.writer.drain()
    assert bench.writer.state == JournalState.OK
    assert bench.memory.events[2].done == 2
    bench.writer.close()
    first, said, second = bench.texts()
    assert (first, second) == ("first", "second")
    assert said.startswith("JRN-02 the disk took ")


@pytest.mark.parametrize("where", [0, 1])
@pytest.mark.parametrize("behind", [["another one"], []])
def test_what_the_recorder_says_is_kept_once_however_long_a_mirror_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: int, behind: list[str]
) -> None:
    bench = Bench(tmp_path)
    bench.log.put("command", "before")
    bench.writer.drain()
    writer: Any = bench.writer
    failing, write = [writer._journal._mirrors[where]._file], SystemFile.write

    def broken(file: SystemFile, offset: int, data: bytes) -> None:
        if file in failing:
            raise OSError(errno.EIO, "a broken disk")
        write(file, offset, data)

    monkeypatch.setattr(SystemFile, "write", broken)
    bench.writer.tell("the run before was cut off")
    for text in behind:
        bench.log.put("command", text)
    for _ in range(5):
        with pytest.raises(JournalFault, match="a broken disk"):
            bench.writer.drain()
    assert bench.memory.events[2].done == 1  # nobody gets an answer for what is behind it
    failing.clear()
    bench.writer.drain()
    assert bench.memory.events[2].done == 1 + len(behind)
    bench.writer.close()
    assert bench.texts() == ["before", *behind, "the run before was cut off"]
    assert not verify(tmp_path).wrong


def test_dates_of_a_journal_that_is_gone_do_not_age_the_next_one(tmp_path: Path) -> None:
    made = filled(tmp_path)
    made.close()
    for file in tmp_path.glob(f"{FILE}*"):
        file.unlink()
    with pytest.MonkeyPatch.context() as context:
        context.setattr(journal_module, "KEPT_LEAST", 0)
        fresh = Journal(tmp_path)
        fresh.append(1, 0, 1, [record(f"event {n}") for n in range(40)])
        fresh.anchor()
        assert fresh.prune(3, PLENTY) == 0
    fresh.close()


def test_a_lock_that_was_committed_before_its_mirror_holds_after_a_kill(tmp_path: Path) -> None:
    made = Journal(tmp_path)
    made.append(1, 0, 1, [record("event")])
    second = tmp_path / "second name"
    second.hardlink_to(made.path)
    made.look()
    second.unlink()
    made.close()  # killed before it has written the mirrors
    again = Journal(tmp_path)
    assert again.locked
    assert [row.values["kind"] for row in read_journal(tmp_path)] == ["command", "alarm"]
    again.close()


def test_a_mirror_that_was_cut_in_use_is_made_whole_again(tmp_path: Path) -> None:
    made = Journal(tmp_path)
    made.append(1, 0, 1, [record("event")])
    for path in made.places.mirrors:
        size = path.stat().st_size
        os.truncate(path, 100)
        made.look()
        assert path.stat().st_size == size
    made.reflect()
    made.close()
    assert not any(read_mirror(path, None).damaged for path in made.places.mirrors)
    assert [row.values.get("kind") for row in read_journal(tmp_path)] == ["command", "alarm", "alarm"]


def test_the_recorder_takes_out_what_is_too_much_by_itself(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.writer = EventWriter(bench.memory, tmp_path, lambda: PLENTY, RetentionPolicy(journal_mb=0))
    for n in range(30):
        bench.log.put("command", f"event {n}")
    bench.writer.drain()
    bench.writer.close()
    texts = bench.texts()
    assert texts[-1] == "events 1 to 20 were taken out by age or size"
    assert texts[:-1] == [f"event {n}" for n in range(20, 30)]
    assert not verify(tmp_path).wrong


def test_a_copy_with_events_that_were_taken_out_since_is_the_same_journal(tmp_path: Path) -> None:
    made = filled(tmp_path)
    copy = tmp_path / "copy.sqlite"
    copy_journal(made.path, copy)
    assert made.prune(15, PLENTY) == 40
    made.close()
    # Of 100 events, and the one that says what was taken out.
    found = compare(made.path, copy)
    assert (found.same, found.only_one, found.only_other, found.trouble) == (60, 1, 0, "")
