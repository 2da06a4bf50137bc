"""The recorder process: it ends after the others, says what it has to say, and knows when everything is kept."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gantryctl.errors import DeviceError, UsageError
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.recorder import process
from gantryctl.service.recorder.journal import mirror
from gantryctl.service.recorder.journal.chain import Anchor
from gantryctl.service.recorder.journal.key import Key, read_key
from gantryctl.service.recorder.journal.places import KEYS_VARIABLE, places_of
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.journal.writer import Journal, JournalFault
from gantryctl.service.recorder.process import EventWriter, Others

pytestmark = pytest.mark.usefixtures("keys")
PLENTY = 10**12


class Clock:
    def __init__(self) -> None:
        self.s = 100.0

    def monotonic(self) -> float:
        return self.s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(process, "time", made)
    return made


@pytest.fixture
def pipe() -> Iterator[list[int]]:
    """The end that the recorder looks at, and the one that the others hold."""
    ends = [*os.pipe()]
    yield ends
    for each in ends:
        os.close(each)


def test_the_recorder_ends_after_the_others(pipe: list[int], clock: Clock) -> None:
    others = Others(pipe[0], os.getppid())
    assert not others.look(ending=False)
    assert not others.look(ending=True)
    os.close(pipe.pop())
    assert others.look(ending=True)
    assert others.gone


def test_others_that_are_gone_do_not_end_it_unasked(pipe: list[int], clock: Clock) -> None:
    others = Others(pipe[0], os.getppid())
    os.close(pipe.pop())
    assert not others.look(ending=False)
    assert others.look(ending=True)


def test_others_that_hang_hold_it_for_forty_seconds(pipe: list[int], clock: Clock) -> None:
    """The controller brings the axis to rest within 20 s, and keeps its state then."""
    others = Others(pipe[0], os.getppid())
    clock.s += 1000.0
    assert not others.look(ending=True)
    clock.s += 39.0
    assert not others.look(ending=True)
    clock.s += 2.0
    assert others.look(ending=True)
    assert not others.gone


@pytest.fixture
def events(tmp_path: Path) -> tuple[EventWriter, EventLog]:
    memory = SharedMemory.create()
    memory.words[Word.BOOT] = 5
    return EventWriter(memory, tmp_path, lambda: PLENTY), EventLog(memory.events[2])


def test_everything_is_kept_when_nothing_waits_and_nothing_fails(
    events: tuple[EventWriter, EventLog],
) -> None:
    writer, log = events
    assert writer.all_kept
    log.put("command", "one")
    assert not writer.all_kept
    writer.drain()
    assert writer.all_kept
    writer.tell("two")
    assert not writer.all_kept
    writer.drain()
    assert writer.all_kept
    writer.failed = True
    assert not writer.all_kept
    writer.close()


def test_what_it_has_to_say_waits_for_a_disk_that_fails(
    events: tuple[EventWriter, EventLog], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer, _ = events
    writer.drain()
    note = Journal.note

    def fails(*_: Any, **__: Any) -> None:
        raise JournalFault("the disk is full")

    monkeypatch.setattr(Journal, "note", fails)
    writer.tell("the run before was cut off")
    for _ in range(2):
        with pytest.raises(JournalFault):
            writer.drain()
    monkeypatch.setattr(Journal, "note", note)
    writer.drain()
    writer.close()
    assert [row.values["text"] for row in read_journal(tmp_path)] == ["the run before was cut off"]


def test_a_mirror_is_on_the_disk_when_it_counts_as_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, done = tmp_path / "journal.mirror", []
    path.write_bytes(b"\0" * 16)
    write, sync = os.pwrite, os.fdatasync

    def written(handle: int, data: bytes, offset: int) -> int:
        done.append("written")
        return write(handle, data, offset)

    def on_the_disk(handle: int) -> None:
        sync(handle)
        done.append("on the disk")

    monkeypatch.setattr(mirror.os, "pwrite", written)
    monkeypatch.setattr(mirror.os, "fdatasync", on_the_disk)
    file = mirror.SystemFile(path)
    file.write(8, b"newest")
    file.close()
    assert done == ["written", "on the disk"]
    assert path.read_bytes() == b"\0" * 8 + b"newest" + b"\0" * 2


@pytest.mark.parametrize("named", [True, False])
def test_every_machine_has_its_own_proofs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: bool
) -> None:
    if named:
        monkeypatch.setenv(KEYS_VARIABLE, str(tmp_path / "keys"))
    else:
        monkeypatch.delenv(KEYS_VARIABLE, raising=False)
    one, other = places_of(tmp_path / "state" / "one"), places_of(tmp_path / "state" / "other")
    files = [path for each in (one, other) for path in (each.database, each.key, each.anchors, *each.mirrors)]
    assert len(set(files)) == len(files)
    # Whoever writes the state directory does not write there.
    for each in (one, other):
        assert tmp_path / "state" not in each.key.parents


def test_a_mirror_with_the_seal_of_somebody_else_shows_nothing(tmp_path: Path) -> None:
    mine, his = Key(b"m" * 32), Key(b"h" * 32)
    for key in (mine, his):
        made = mirror.Mirror(tmp_path / key.name, key)
        for _ in range(2):
            made.write(mirror.Newest(Anchor(3, "00", "", "journal"), 0))
        made.close()
    assert mirror.read_mirror(tmp_path / mine.name, mine).newest is not None
    assert mirror.read_mirror(tmp_path / his.name, mine) == mirror.Reflection(None, 0, damaged=True)


def test_a_mirror_has_its_two_copies_in_different_pages_of_the_disk(tmp_path: Path) -> None:
    made = mirror.Mirror(tmp_path / "mirror", Key(b"m" * 32))
    for seq in (3, 4):
        made.write(mirror.Newest(Anchor(seq, "00", "", "journal"), 0))
    made.close()
    data = (tmp_path / "mirror").read_bytes()
    assert len(data) == 4096 + 512
    assert not any(data[512:4096])
    assert all(any(copy) for copy in (data[:512], data[4096:]))


@pytest.mark.parametrize(
    "wrong",
    [{}, {"turn": "1"}, {"lock": 1.0}, {"seq": True}, {"hash": 0}, {"utc": None}, {"journal": ["j"]}],
    ids=str,
)
def test_a_mirror_of_another_form_shows_nothing_even_with_the_right_seal(
    tmp_path: Path, wrong: dict[str, object]
) -> None:
    key = Key(b"m" * 32)
    body = {"turn": 1, "lock": 0, "seq": 3, "hash": "00", "utc": "", "journal": "journal"} | wrong
    copy = mirror._text({**body, "seal": key.seal("newest", mirror._plain(body))})
    (tmp_path / "mirror").write_bytes(copy.ljust(4096, b"\0") + bytes(512))
    shown = mirror.read_mirror(tmp_path / "mirror", key)
    assert (shown.newest is None, shown.damaged) == (bool(wrong), bool(wrong))


@pytest.mark.parametrize(
    ("text", "mode", "words"),
    [
        ("ab" * 32, 0o600, ""),
        ("ab" * 32 + "\n", 0o400, ""),
        ("ab" * 31, 0o600, "64 hexadecimal digits"),
        ("ab" * 33, 0o600, "64 hexadecimal digits"),
        ("xy" * 32, 0o600, "64 hexadecimal digits"),
        ("ab" * 32, 0o640, "others may read"),
        ("ab" * 32, 0o604, "others may read"),
    ],
)
def test_a_key_is_64_digits_that_nobody_else_reads(tmp_path: Path, text: str, mode: int, words: str) -> None:
    path = tmp_path / "journal.key"
    path.write_text(text)
    path.chmod(mode)
    if words:
        with pytest.raises(DeviceError, match=words):
            read_key(path)
    else:
        assert read_key(path).secret == b"\xab" * 32


def test_proofs_stand_in_a_place_that_every_process_finds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KEYS_VARIABLE, "keys")
    with pytest.raises(UsageError, match="write an absolute path"):
        places_of(tmp_path)
