"""What the journal has acknowledged survives kills and power cuts: nothing lost, nothing twice, chain intact.

INV-8: every acknowledged event is in the journal after any kill or power cut, once, in order, hash chain intact.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import accumulate
from pathlib import Path

import pytest

from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.recorder.journal import writer
from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.journal.writer import Journal
from gantryctl.service.recorder.retention import RetentionPolicy
from support.power_cut import Disk, Step

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="anonymous memory files")
Evidence = Callable[[str, dict[str, object]], None]
EVENTS = 60


def record(number: int) -> bytes:
    return json.dumps(
        {"utc": "", "monotonic_ns": 0, "kind": "command", "text": f"event {number} " + "x" * 200}
    ).encode()


def run_on(disk: Disk, synchronous: str) -> None:
    """Appends events, one or a few at a time, and notes in the disk's steps what was acknowledged."""
    directory = disk.root / "state" / "machine"
    directory.mkdir(parents=True)
    journal = Journal(directory, lambda path: disk.connect(path, synchronous), disk.opened)
    disk.steps.append(Step("kept", "", 0))
    number = 0
    while number < EVENTS:
        count = 1 + number % 3
        journal.append(1, 0, number + 1, [record(number + n + 1) for n in range(count)])
        number += count
        disk.steps.append(Step("kept", "", number))
        journal.settle()
    journal.close()


def cuts(root: Path, synchronous: str, count: int) -> tuple[int, int, int]:
    """Cut points, cuts that lost acknowledged events, and cuts after which something was not as it should be."""
    disk, chance = Disk(root / "run"), random.Random(1)
    run_on(disk, synchronous)
    first = next(i for i, step in enumerate(disk.steps) if step.kind == "kept")
    key = places_of(disk.root / "state" / "machine").key
    lost = broken = 0
    points = sorted(chance.randrange(first + 1, len(disk.steps) + 1) for _ in range(count))
    acknowledged = list(accumulate((step.offset if step.kind == "kept" else 0 for step in disk.steps), max))
    place = root / "cut" / "state" / "machine"
    for at in disk.after_cuts(points, root / "cut", chance):
        kept = acknowledged[at - 1]
        shutil.copy(key, places_of(place).key)
        reopened = Journal(place)
        reopened.close()
        rows = [row for row in read_journal(place) if row.values["kind"] == "command"]
        lost += len(rows) < kept
        broken += bool(reopened.locked or verify(place).wrong)
        numbers = [int(row.values["text"].split()[1]) for row in rows]
        assert numbers == list(range(1, len(rows) + 1)), "in order, each once"
        shutil.rmtree(root / "cut")
    return count, lost, broken


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The log of SQLite is settled as often as can be."""
    monkeypatch.setattr(writer, "_SETTLE_S", 0.0)


@pytest.mark.usefixtures("at_once")
def test_a_power_cut_loses_nothing_that_was_acknowledged(tmp_path: Path) -> None:
    assert cuts(tmp_path, "", 60) == (60, 0, 0)


def test_this_test_can_fail_without_full_synchronisation_events_are_lost(tmp_path: Path) -> None:
    _, lost, broken = cuts(tmp_path, "NORMAL", 60)
    assert lost > 10
    # And the mirrors know it each time.
    assert broken >= lost


@pytest.mark.slow
def test_a_hundred_thousand_power_cuts(evidence: Evidence, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of them with a log that is settled as often as can be."""
    place = Path("/dev/shm") if os.access("/dev/shm", os.W_OK) else None  # noqa: S108 - folders of our own in it
    found: list[tuple[int, int, int]] = []
    for settle_s, synchronous, count in ((1.0, "", 50_000), (0.0, "", 50_000), (1.0, "NORMAL", 1000)):
        monkeypatch.setattr(writer, "_SETTLE_S", settle_s)
        with tempfile.TemporaryDirectory(dir=place) as root:
            found.append(cuts(Path(root), synchronous, count))
    (seldom, often, normal) = found
    evidence(
        "journal_power_cuts",
        {
            "cuts": seldom[0] + often[0],
            "lost_acknowledged": seldom[1] + often[1],
            "not_intact": seldom[2] + often[2],
            "cuts_with_synchronous_normal": normal[0],
            "lost_with_synchronous_normal": normal[1],
            "noticed_with_synchronous_normal": normal[2],
        },
    )
    assert (seldom[1:], often[1:]) == ((0, 0), (0, 0))


def kills(directory: Path, count: int) -> dict[str, object]:
    """Kill the recorder at random moments while events come; every event is there once, in order."""
    memory, chance = SharedMemory.create(), random.Random(2)
    memory.words[Word.BOOT], memory.words[Word.SUPERVISOR] = 9, os.getpid()
    log = EventLog(memory.events[2])
    arguments = [str(memory.handle), str(directory), RetentionPolicy().to_json(), "-1"]
    command = [sys.executable, "-m", "gantryctl.service.recorder", *arguments]
    written = kills_in_work = 0
    for _ in range(count):
        process = subprocess.Popen(command, pass_fds=(memory.handle,))
        started = memory.events[2].done
        # However long that takes: a kill before the first commit of a process would show nothing.
        while memory.events[2].done == started:
            assert process.poll() is None, "the recorder has ended by itself"
            # A busy computer takes longer to start a process than the ring has room for.
            if len(memory.events[2]) < memory.events[2].slots // 2:
                written += 1
                assert log.put("command", f"event {written} " + "x" * 200)
            time.sleep(0.002)
        for _ in range(chance.randrange(40)):
            written += 1
            assert log.put("command", f"event {written} " + "x" * 200)
            time.sleep(chance.random() * 1e-3)
        kills_in_work += len(memory.events[2]) > 0
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        acknowledged = memory.events[2].done
        # The newest event is enough here: that none before it is missing is judged at the end. Other kinds are words
        # of the recorder itself, which was held up on a busy computer.
        (newest,) = read_journal(directory, limit=1, newest=True, kind="command")
        assert int(newest.values["text"].split()[1]) >= acknowledged, "an acknowledged event is lost"
    process = subprocess.Popen(command, pass_fds=(memory.handle,))
    # One more event: when it is kept, this process has begun, and knows what SIGTERM means.
    written += 1
    assert log.put("command", f"event {written} " + "x" * 200)
    while memory.events[2].done < written:
        assert process.poll() is None, "the recorder has ended by itself"
        time.sleep(0.01)
    process.terminate()
    assert process.wait() == 0
    rows = read_journal(directory, limit=1_000_000, kind="command")
    texts = [row.values["text"].split()[1] for row in rows]
    assert texts == [str(n) for n in range(1, written + 1)], "in order, each once"
    verdict = verify(directory)
    assert verdict.wrong == ""
    memory.close()
    return {
        "kills": count,
        "events": written,
        "kills_with_events_under_way": kills_in_work,
        "lost": 0,
        "intact": True,
        "load_average": os.getloadavg(),
    }


def test_a_killed_recorder_loses_nothing_and_keeps_nothing_twice(tmp_path: Path) -> None:
    kills(tmp_path / "state" / "machine", 3)


@pytest.mark.slow
def test_two_hundred_kills_of_the_recorder(tmp_path: Path, evidence: Evidence) -> None:
    evidence("journal_kills", kills(tmp_path / "state" / "machine", 200))
