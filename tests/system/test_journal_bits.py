"""Every bit of the journal's database and of its log, turned over: it is noticed, or it is harmless.

Harmless: all events are there and right. INV-8.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import shutil
import sqlite3
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from gantryctl.service.recorder.journal.chain import first_hash
from gantryctl.service.recorder.journal.mirror import read_mirror
from gantryctl.service.recorder.journal.places import FILE, places_of
from gantryctl.service.recorder.journal.proof import Verdict, verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.journal.writer import Journal

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
Evidence = Callable[[str, dict[str, object]], None]
LOG = f"{FILE}-wal"
EVENTS = 60
# Page of SQLite, header of its log and of a frame in it (https://sqlite.org/fileformat2.html).
PAGE, LOG_HEADER, FRAME_HEADER = 4096, 32, 24
FRAME = FRAME_HEADER + PAGE
PORTION = 10_000


@pytest.fixture
def root() -> Iterator[Path]:
    """In memory where there is such a place: a disk would be worn by a million writings."""
    memory = Path("/dev/shm")  # noqa: S108 - a folder of our own is made in it
    with tempfile.TemporaryDirectory(dir=memory if os.access(memory, os.W_OK) else None) as made:
        yield Path(made)


class Crashed:
    """A journal as a crash has left it: half of its events in the database, the others in the log.

    Args:
        events: how many. settled: how many of them are in the database.
    """

    def __init__(self, root: Path, events: int, settled: int) -> None:
        self.events, self.directory = events, root / "state" / "machine"
        running = root / "running" / "machine"
        running.mkdir(parents=True)
        journal = Journal(running)
        for first in range(1, events + 1, 3):
            journal.append(1, 0, first, [_record(n) for n in range(first, min(first + 3, events + 1))])
            if first + 2 == settled:
                journal._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        shutil.copytree(root / "running", root / "state")
        shutil.copytree(root / "running-keys", root / "state-keys")
        (self.directory / f"{FILE}-shm").unlink()
        self.whole = {path: path.read_bytes() for path in self._files()}
        journal.close()
        self.right = read_journal(self.directory)
        assert verify(self.directory)[:2] == (events, "")

    def _files(self) -> list[Path]:
        return [path for path in self.directory.parent.parent.glob("state*/*/*") if path.is_file()]

    def restore(self) -> None:
        """Put every file back."""
        for path in self._files():
            if path not in self.whole:
                path.unlink()
        for path, data in self.whole.items():
            path.write_bytes(data)

    def size(self, name: str) -> int:
        """Bits of a file."""
        return 8 * len(self.whole[self.directory / name])

    def verified(self, name: str, bits: Iterable[int]) -> Counter[str]:
        """Turn each of the bits over, alone, and verify."""
        told: Counter[str] = Counter()
        seen: dict[bytes, str] = {}
        path = self.directory / name
        whole = self.whole[path]
        handle = os.open(path, os.O_RDWR)
        for bit in bits:
            at = bit // 8
            os.pwrite(handle, bytes([whole[at] ^ 1 << bit % 8]), at)
            # What SQLite shows of both files decides all that follows: the same again needs no second look.
            shown = self._shown()
            if shown not in seen:
                seen[shown] = self._judged(bit, verify(self.directory))
            told[seen[shown]] += 1
            seen = seen if len(seen) < 1000 else {}
            os.pwrite(handle, whole[at : at + 1], at)
        os.close(handle)
        return told

    def _shown(self) -> bytes:
        """Digest of the database as SQLite makes it of file and log; something new where it cannot."""
        uri = f"{(self.directory / FILE).as_uri()}?mode=ro"
        try:
            with closing(sqlite3.connect(uri, uri=True)) as db:
                return hashlib.blake2b(db.serialize()).digest()
        except sqlite3.Error:
            return os.urandom(16)

    def _judged(self, bit: int, verdict: Verdict) -> str:
        if not verdict.wrong:
            assert read_journal(self.directory) == self.right, f"bit {bit}: lost, and nobody notices"
            return "harmless"
        spans = sorted((*verdict.certain, *verdict.changed, *verdict.missing))
        numbers = [n for span in spans for n in range(span.first, span.last + 1)]
        assert numbers == list(range(1, self.events + 1)), f"bit {bit}: every event is told of once"
        return "noticed"

    def started(self, name: str, bits: Iterable[int]) -> Counter[str]:
        """Turn each of the bits over, alone, and start the journal."""
        told: Counter[str] = Counter()
        for bit in bits:
            data = bytearray(self.whole[self.directory / name])
            data[bit // 8] ^= 1 << bit % 8
            (self.directory / name).write_bytes(data)
            journal = Journal(self.directory)
            journal.close()
            if journal.locked:
                told["noticed"] += 1
            else:
                found = read_journal(self.directory)[: self.events]
                assert found == self.right, f"bit {bit}: lost, and the start does not notice"
                told["harmless"] += 1
            self.restore()
        return told


def _record(number: int) -> bytes:
    values = {"utc": "2026-01-01T00:00:00.000+00:00", "monotonic_ns": number, "kind": "command"}
    about = {"user": "anna", "role": "operator", "client": "1", "place": "local", "text": f"event {number}"}
    return json.dumps({**values, **about, "values": {"target_deg": number}}).encode()


def strata(crashed: Crashed, name: str, each: int, chance: random.Random) -> list[int]:
    """Some bits of the header, and of every page of the database or frame of the log and its header."""
    begin, length = (LOG_HEADER, FRAME) if name == LOG else (0, PAGE)
    size = crashed.size(name) // 8
    head = [(0, LOG_HEADER)] if name == LOG else [(0, 100), *((at, 8) for at in range(0, size, PAGE))]
    parts = [*head, *((at, length) for at in range(begin, size, length))]
    if name == LOG:
        parts += [(at, FRAME_HEADER) for at in range(begin, size, length)]
    return [
        8 * (at + chance.randrange(width)) + chance.randrange(8) for at, width in parts for _ in range(each)
    ]


def test_bits_of_every_page_and_frame(root: Path) -> None:
    crashed, chance = Crashed(root, EVENTS, EVENTS // 2), random.Random(1)
    for name, each in ((FILE, 24), (LOG, 8)):
        bits = strata(crashed, name, each, chance)
        assert crashed.verified(name, bits)["noticed"] > len(bits) // 10
        crashed.restore()
        assert crashed.started(name, bits[::4])["noticed"] > len(bits) // 80
    for path in places_of(crashed.directory).mirrors:
        crashed.whole[path] = bytes(512)  # neither mirror shows anything: that alone is noticed
    crashed.restore()
    assert crashed.started(FILE, [8 * PAGE - 1])["noticed"]


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Bytes changed, a part cleared, cut off, two pages swapped, or something else altogether."""
    at, other = chance.randrange(len(data)), chance.randrange(len(data)) // PAGE * PAGE
    page, swapped = data[at // PAGE * PAGE :][:PAGE], data[other:][:PAGE]
    return chance.choice(
        [
            bytes(b ^ (chance.random() < 0.01) for b in data),
            data[:at] + bytes(min(3000, len(data) - at)) + data[at + 3000 :],
            data[:at],
            data.replace(page, swapped, 1),
            chance.randbytes(at % 9000),
            data,
        ]
    )


def test_whatever_the_files_are_verify_and_start_say_so_and_nothing_is_lost_unnoticed(root: Path) -> None:
    crashed, chance = Crashed(root, EVENTS, EVENTS // 2), random.Random(4)
    mirrors = places_of(crashed.directory).mirrors
    told: Counter[bool] = Counter()
    for _ in range(80):
        for path in (crashed.directory / FILE, crashed.directory / LOG, mirrors[chance.randrange(2)]):
            path.write_bytes(damaged(crashed.whole[path], chance))
        verdict = verify(crashed.directory)
        assert verdict.wrong or read_journal(crashed.directory) == crashed.right
        journal = Journal(crashed.directory)
        journal.close()
        told[journal.locked] += 1
        assert journal.locked or read_journal(crashed.directory)[:EVENTS] == crashed.right
        crashed.restore()
    assert told[True] > told[False] > 0


def test_a_bit_of_what_says_where_the_journal_begins_hides_no_event(root: Path) -> None:
    """Found by the test of every bit: the number of the last event taken out became 1, and event 1 was not told of."""
    crashed = Crashed(root, EVENTS, EVENTS // 2)
    newest = read_mirror(places_of(crashed.directory).mirrors[0], None).newest
    assert newest is not None
    hashed = crashed.whole[crashed.directory / FILE].rindex(first_hash(newest.anchor.journal).encode())
    assert crashed.verified(FILE, range(8 * (hashed - 16), 8 * (hashed + 64)))["noticed"] > 8 * 64


def test_this_test_can_fail_without_mirrors_a_bit_of_the_log_takes_events_along(root: Path) -> None:
    crashed = Crashed(root, EVENTS, EVENTS // 2)
    for path in places_of(crashed.directory).mirrors:
        path.unlink()
    with pytest.raises(AssertionError, match="lost, and nobody notices"):
        crashed.verified(LOG, [8 * (LOG_HEADER + 5 * FRAME + 100)])


@pytest.mark.slow
def test_every_bit_of_sixty_events(root: Path, evidence: Evidence) -> None:
    """Verified for every bit; started for one bit of every 16 bytes."""
    crashed, chance = Crashed(root, EVENTS, EVENTS // 2), random.Random(2)
    figures: dict[str, object] = {"events": EVENTS}
    for name in (FILE, LOG):
        found = crashed.verified(name, range(crashed.size(name)))
        crashed.restore()
        begun = crashed.started(
            name, (at + chance.randrange(128) for at in range(0, crashed.size(name), 128))
        )
        figures[name] = {
            "bits": crashed.size(name),
            "noticed": found["noticed"],
            "harmless": found["harmless"],
            "started": begun.total(),
            "start_noticed": begun["noticed"],
            "start_harmless": begun["harmless"],
            "lost_unnoticed": 0,
        }
    mirror = "journal.mirror"
    found = crashed.verified(mirror, range(crashed.size(mirror)))
    figures[mirror] = {
        "bits": crashed.size(mirror),
        "noticed": found["noticed"],
        "harmless": found["harmless"],
    }
    evidence("journal_bits", figures)


@pytest.mark.slow
def test_a_million_bits_of_larger_journals(root: Path, evidence: Evidence) -> None:
    """Written after every portion, so that a run that is ended early leaves what it has seen."""
    figures: dict[str, object] = {}
    chance = random.Random(3)
    for events, sampled in ((1000, 50_000), (300, 150_000), (100, 800_000)):
        crashed = Crashed(root / str(events), events, events // 2 // 3 * 3)
        share = crashed.size(FILE) / (crashed.size(FILE) + crashed.size(LOG))
        noticed: Counter[str] = Counter()
        for _ in range(sampled // PORTION):
            for name, count in ((FILE, round(share * PORTION)), (LOG, PORTION - round(share * PORTION))):
                bits = (chance.randrange(crashed.size(name)) for _ in range(count))
                noticed += crashed.verified(name, bits)
            figures[f"{events}_events"] = {
                "bits": crashed.size(FILE) + crashed.size(LOG),
                "sampled": noticed.total(),
                "noticed": noticed["noticed"],
                "harmless": noticed["harmless"],
                "lost_unnoticed": 0,
            }
            evidence("journal_bits_sampled", figures)
