"""What proves the journal: mirrors of its newest event, its key, anchors, copies; and who tries to get past them.

INV-8: nothing that was acknowledged is missing unnoticed.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sqlite3
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from gantryctl.errors import DeviceError, UsageError
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import JournalState, SharedMemory, Word
from gantryctl.service.recorder.journal.chain import Anchor, chained, content_of, sealed
from gantryctl.service.recorder.journal.file import COLUMNS, INSERT, SELECT, Damaged
from gantryctl.service.recorder.journal.key import Key, made_key, read_key
from gantryctl.service.recorder.journal.mirror import Mirror, Newest, read_mirror
from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.recorder.journal.proof import Fault, Span, verify, verify_file
from gantryctl.service.recorder.journal.reading import _entry, anchor, compare, copy_journal, read_journal
from gantryctl.service.recorder.journal.writer import Journal
from gantryctl.service.recorder.process import EventWriter

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
EVENTS = 60
HALF = 30
PLENTY = 10**12


def record(number: int, text: str) -> bytes:
    values = {"utc": "2026-01-01T00:00:00.000+00:00", "monotonic_ns": number, "kind": "command"}
    return json.dumps({**values, "text": f"{text} {number}"}).encode()


def add(directory: Path, first: int, last: int, text: str = "event") -> None:
    """Events of one start of the service."""
    journal = Journal(directory)
    for number in range(first, last + 1, HALF):
        upto = min(last, number + HALF - 1)
        journal.append(1, 0, number, [record(n, text) for n in range(number, upto + 1)])
    journal.close()


def texts(directory: Path) -> list[str]:
    return [row.values["text"] for row in read_journal(directory)]


def alarms(directory: Path) -> list[str]:
    """The events that lock the journal, by their codes."""
    rows = (row.values for row in read_journal(directory))
    return [row["text"].split()[0] for row in rows if '"lock": true' in row["detail"]]


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """A machine's state directory with 60 events; what proves them stands beside its root."""
    made = tmp_path / "state" / "machine"
    made.mkdir(parents=True)
    add(made, 1, EVENTS)
    return made


def test_a_whole_journal_is_certain_from_its_first_event_to_its_last(directory: Path) -> None:
    verdict = verify(directory)
    assert (verdict.rows, verdict.wrong, verdict.sealed) == (EVENTS, "", True)
    assert (verdict.certain, verdict.changed, verdict.missing) == ((Span(1, EVENTS),), (), ())
    assert not verify(directory, keyed=False).sealed
    assert places_of(directory).outside == directory.parent.with_name("state-keys") / "machine"


# --- what was deleted, cut, put back, swapped ------------------------------------------------------


def older(directory: Path) -> dict[str, bytes]:
    """The files of the state directory as they were when half of the events were in."""
    shutil.rmtree(directory)
    shutil.rmtree(places_of(directory).outside)
    directory.mkdir()
    add(directory, 1, HALF)
    kept = {path.name: path.read_bytes() for path in directory.iterdir()}
    add(directory, HALF + 1, EVENTS)
    return kept


def put_back(directory: Path, kept: dict[str, bytes], *names: str) -> None:
    for name in names or kept:
        (directory / name).write_bytes(kept[name])


def only_the_database(directory: Path) -> None:
    put_back(directory, older(directory), "journal.sqlite")


def the_whole_directory(directory: Path) -> None:
    put_back(directory, older(directory))


def deleted(directory: Path) -> None:
    (directory / "journal.sqlite").unlink()


def all_of_it_deleted(directory: Path) -> None:
    shutil.rmtree(directory)


def cut_to_nothing(directory: Path) -> None:
    (directory / "journal.sqlite").write_bytes(b"")


def cut_in_half(directory: Path) -> None:
    path = directory / "journal.sqlite"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2 // 4096 * 4096])


def the_last_ones_taken_out(directory: Path) -> None:
    """By somebody who mends the end as well."""
    with sqlite3.connect(directory / "journal.sqlite") as db:
        db.execute("DELETE FROM events WHERE seq > ?", (HALF,))
        db.execute("UPDATE head SET (seq, hash) = (SELECT seq, hash FROM events WHERE seq = ?)", (HALF,))
    db.close()


def of_another_machine(directory: Path) -> None:
    other = directory.parent / "another"
    other.mkdir()
    add(other, 1, EVENTS + 5)
    shutil.copy(other / "journal.sqlite", directory)


def swapped_with_its_mirror(directory: Path) -> None:
    of_another_machine(directory)
    shutil.copy(directory.parent / "another" / "journal.mirror", directory)


def of_another_machine_with_the_same_key(directory: Path) -> None:
    other = directory.parent / "another"
    keep = places_of(other).key
    keep.parent.mkdir(parents=True)
    shutil.copy(places_of(directory).key, keep)
    other.mkdir()
    add(other, 1, EVENTS + 5)
    shutil.copy(other / "journal.sqlite", directory)


def another_key(directory: Path) -> None:
    key = places_of(directory).key
    key.unlink()
    made_key(key)


def mirrors_deleted(directory: Path) -> None:
    for path in places_of(directory).mirrors:
        path.unlink()


def one_mirror_deleted(directory: Path) -> None:
    the_whole_directory(directory)
    places_of(directory).mirrors[1].unlink()


def a_directory(directory: Path) -> None:
    (directory / "journal.sqlite").unlink()
    (directory / "journal.sqlite").mkdir()


Attack = Callable[[Path], None]
ATTACKS: dict[Attack, tuple[str, Fault]] = {
    only_the_database: ("JRN-04", Fault.SHORT),
    the_whole_directory: ("JRN-04", Fault.SHORT),
    deleted: ("JRN-04", Fault.SHORT),
    all_of_it_deleted: ("JRN-04", Fault.SHORT),
    cut_to_nothing: ("JRN-04", Fault.DAMAGED),
    cut_in_half: ("JRN-05", Fault.DAMAGED),
    the_last_ones_taken_out: ("JRN-04", Fault.SHORT),
    of_another_machine: ("JRN-05", Fault.DAMAGED),
    swapped_with_its_mirror: ("JRN-05", Fault.DAMAGED),
    of_another_machine_with_the_same_key: ("JRN-04", Fault.OTHER),
    another_key: ("JRN-05", Fault.DAMAGED),
}


@pytest.mark.parametrize("attack", list(ATTACKS), ids=lambda attack: attack.__name__)
def test_what_is_missing_or_swapped_is_told_by_verify_and_locks_the_next_start(
    directory: Path, attack: Attack
) -> None:
    code, fault = ATTACKS[attack]
    attack(directory)
    verdict = verify(directory)
    assert verdict.fault is fault
    assert verdict.wrong
    journal = Journal(directory)
    assert journal.locked
    journal.close()
    assert alarms(directory)[-1] == code
    again = Journal(directory)  # a new start acknowledges nothing, and finds nothing new
    assert again.locked
    again.append(2, 0, 1, [json.dumps({"kind": "journal", "text": "acknowledged"}).encode()])
    assert not again.locked
    again.close()
    after = Journal(directory)
    assert not after.locked
    after.close()
    assert len(alarms(directory)) == 1
    assert verify(directory).wrong == ""


@pytest.mark.parametrize("attack", [mirrors_deleted, one_mirror_deleted], ids=lambda attack: attack.__name__)
def test_a_mirror_that_is_gone_locks_the_next_start(directory: Path, attack: Attack) -> None:
    attack(directory)
    journal = Journal(directory)
    assert journal.locked
    assert journal.moved_aside is None  # its chain is whole
    journal.close()
    assert set(alarms(directory)) == {"JRN-07"}


def test_what_is_no_file_is_a_fault_of_the_disk(directory: Path) -> None:
    a_directory(directory)
    with pytest.raises(DeviceError):
        Journal(directory)


def test_what_is_missing_is_told_by_number(directory: Path) -> None:
    the_last_ones_taken_out(directory)
    verdict = verify(directory)
    assert (verdict.certain, verdict.missing) == ((Span(1, HALF),), (Span(HALF + 1, EVENTS),))
    said = "the end is missing: 30 rows, event 60 was there on 2026-01-01T00:00:00.000+00:00"
    assert verdict.wrong == said
    journal = Journal(directory)
    journal.close()
    assert "does not have event 60 of 2026-01-01T00:00:00.000+00:00" in texts(directory)[0]
    aside = journal.moved_aside
    assert aside is not None
    kept = verify_file(aside, read_key(places_of(directory).key))
    assert (kept.rows, kept.wrong) == (HALF, "")  # kept as it was found: evidence


def test_a_database_that_is_gone_takes_no_log_along(directory: Path) -> None:
    (directory / "journal.sqlite").unlink()
    (directory / "journal.sqlite-wal").write_bytes(b"log")
    Journal(directory).close()
    (left,) = directory.glob("journal-left-*-wal")
    assert left.read_bytes() == b"log"


def test_without_mirrors_the_last_anchor_knows_that_a_journal_was_there(directory: Path) -> None:
    journal = Journal(directory)
    assert journal.anchor() == journal.newest
    assert journal.anchor() is None  # it has its line
    journal.close()
    shutil.rmtree(directory)
    places_of(directory).mirrors[1].unlink()
    assert verify(directory).fault is Fault.SHORT
    Journal(directory).close()
    assert alarms(directory) == ["JRN-04"]


@pytest.mark.parametrize("copy", [0, 1])
def test_one_torn_copy_of_a_mirror_is_bridged_and_told(directory: Path, copy: int) -> None:
    path = places_of(directory).mirrors[0]
    data = bytearray(path.read_bytes())
    data[4096 * copy + 20] ^= 1
    path.write_bytes(data)
    assert read_mirror(path, None).damaged
    assert verify(directory).wrong == ""
    journal = Journal(directory)
    assert not journal.locked
    journal.close()
    assert "one of two copies was torn or changed" in texts(directory)[-1]
    assert not read_mirror(path, None).damaged


# --- the key --------------------------------------------------------------------------------------


def forge(directory: Path, key: Key | None, first: int, text: str) -> None:
    """Rewrite history from an event on, with every hash; seals with another key, or as they were."""
    path = directory / "journal.sqlite"
    with sqlite3.connect(path) as db:
        name = db.execute("SELECT name FROM journal").fetchone()[0]
        rows = db.execute(f"{SELECT} ORDER BY seq").fetchall()
        last = rows[first - 2][-2]
        for row in rows[first - 1 :]:
            values = list(row[1:-2])
            values[COLUMNS.index("text") - 1] = text
            content = content_of(row[0], values)
            last = chained(last, content)
            seal = row[-1] if key is None else sealed(key, name, last, content)
            db.execute("DELETE FROM events WHERE seq = ?", (row[0],))
            db.execute(INSERT, (row[0], *values, last, seal))
        db.execute("UPDATE head SET hash = ?", (last,))
    db.close()
    # He writes the mirror in the state directory, too.
    mirror = directory / "journal.mirror"
    lied = Newest(Anchor(len(rows), last, rows[-1][4], name), 0)
    mirror.unlink()
    made = Mirror(mirror, key or Key(b"x" * 32))
    made.write(lied)
    made.write(lied)
    made.close()


@pytest.mark.parametrize(
    "key", [None, Key(hashlib.sha256(b"his own").digest())], ids=["no key", "his own key"]
)
def test_who_knows_everything_but_the_key_cannot_rewrite_history(directory: Path, key: Key | None) -> None:
    forge(directory, key, 41, "nothing happened")
    without = verify_file(directory / "journal.sqlite", None)
    assert (without.rows, without.wrong) == (EVENTS, "")  # a consistent chain: SHA-256 needs no secret
    verdict = verify_file(directory / "journal.sqlite", read_key(places_of(directory).key))
    assert (verdict.certain, verdict.changed) == ((Span(1, 40),), (Span(41, EVENTS),))
    assert verdict.wrong == "row 41 was not sealed with the key of this journal"
    journal = Journal(directory)
    journal.close()
    assert alarms(directory) == ["JRN-05"]


def test_who_has_the_key_as_well_meets_the_anchors_that_were_kept_elsewhere(directory: Path) -> None:
    kept = anchor(directory)
    key = read_key(places_of(directory).key)
    forge(directory, key, 41, "nothing happened")
    database = directory / "journal.sqlite"
    assert verify_file(database, key).wrong == ""
    verdict = verify_file(database, key, anchors=[kept])
    assert verdict.wrong.startswith(f"event {EVENTS} is another one than on ")
    assert (verdict.certain, verdict.changed) == ((Span(1, EVENTS - 1),), (Span(EVENTS, EVENTS),))


def test_a_copy_is_read_from_a_medium_that_cannot_be_written(directory: Path, tmp_path: Path) -> None:
    """In the file format of SQLite bytes 18 and 19 are 1 for a file alone, 2 for one with a log beside it."""
    copy_journal(directory / "journal.sqlite", tmp_path / "copy.sqlite")
    head = (tmp_path / "copy.sqlite").read_bytes()[:20]
    assert (head[18], head[19]) == (1, 1)
    assert (directory / "journal.sqlite").read_bytes()[18:20] == b"\2\2"


def test_nor_can_he_go_back_to_an_older_state_and_on_from_there(directory: Path) -> None:
    """Everything in it was sealed; a second history of the same journal, too."""
    kept = older(directory)
    newest = anchor(directory)
    put_back(directory, kept)
    shutil.copy(
        directory / "journal.mirror", places_of(directory).mirrors[1]
    )  # our own machine is cheated, once
    add(directory, HALF + 1, EVENTS + 5, "nothing")
    assert verify(directory).wrong == ""
    # What is kept on another machine is not.
    assert verify(directory, [newest]).wrong == f"event {EVENTS} is another one than on {newest.utc}"


def test_a_key_is_made_for_its_owner_alone_and_one_that_others_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "keys" / "journal.key"
    key = made_key(path)
    assert made_key(path) == key
    assert len(key.secret) == 32
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.parent.stat().st_mode & 0o777 == 0o700
    assert key.secret.hex() not in repr(key)
    path.chmod(0o640)
    with pytest.raises(DeviceError, match="chmod 600"):
        read_key(path)
    path.chmod(0o600)
    path.write_text("short", encoding="ascii")
    with pytest.raises(DeviceError, match="64 hexadecimal digits"):
        made_key(path)
    with pytest.raises(DeviceError, match="cannot be read"):
        read_key(tmp_path / "nowhere")
    (tmp_path / "file").touch()
    with pytest.raises(DeviceError, match="GANTRYCTL_KEYS"):
        made_key(tmp_path / "file" / "journal.key")


# --- a second copy ---------------------------------------------------------------------------------


def test_a_copy_is_checked_against_the_journal_and_the_journal_against_the_copy(directory: Path) -> None:
    copy, path = directory.parent / "copy.sqlite", directory / "journal.sqlite"
    copy_journal(path, copy)
    add(directory, EVENTS + 1, EVENTS + 4)
    found = compare(path, copy)
    assert (found.same, found.only_one, found.only_other, found.trouble) == (EVENTS, 4, 0, "")
    assert verify_file(copy, read_key(places_of(directory).key)).rows == EVENTS
    assert verify_file(copy, None).rows == EVENTS  # on a machine that has no key
    assert copy_journal(path, copy).only_one == 4
    forge(directory, None, 50, "nothing happened")
    assert compare(path, copy).trouble == "event 50 is not the same in both"
    with pytest.raises(UsageError, match="left as it is"):
        copy_journal(path, copy)
    assert verify_file(copy, None).rows == EVENTS + 4


def test_a_copy_knows_what_the_journal_has_lost(directory: Path) -> None:
    copy, path = directory.parent / "copy.sqlite", directory / "journal.sqlite"
    copy_journal(path, copy)
    the_last_ones_taken_out(directory)
    assert "the copy has 30 events more" in compare(path, copy).trouble
    with pytest.raises(UsageError, match="30 events more"):
        copy_journal(path, copy)
    path.unlink()
    with pytest.raises(DeviceError):
        copy_journal(path, copy)
    assert verify_file(copy, None).rows == EVENTS
    other = directory.parent / "other"
    other.mkdir()
    add(other, 1, 3)
    assert compare(other / "journal.sqlite", copy).trouble == "they are different journals"


# --- while the service runs -------------------------------------------------------------------------


class Bench:
    """The journal's thread with its rings."""

    def __init__(self, directory: Path) -> None:
        self.memory = SharedMemory.create()
        self.memory.words[Word.BOOT] = 5
        self.log = EventLog(self.memory.events[2])
        self.writer = EventWriter(self.memory, directory, lambda: PLENTY)

    def kept(self, *texts: str, kind: str = "command") -> JournalState:
        for text in texts:
            self.log.put(kind, text)
        while self.writer.drain():
            pass
        return self.writer.state


@pytest.fixture
def bench(directory: Path) -> Bench:
    made = Bench(directory)
    assert made.kept("first") == JournalState.OK
    return made


@pytest.mark.parametrize(
    "name", ["journal.sqlite", "journal.sqlite-wal", "journal.sqlite-shm", "journal.mirror"]
)
@pytest.mark.parametrize("how", ["deleted", "replaced", "linked over"])
def test_a_file_that_is_deleted_or_replaced_in_use_is_written_anew_and_nothing_is_lost(
    directory: Path, bench: Bench, name: str, how: str
) -> None:
    path = directory / name
    data = path.read_bytes()
    if how == "linked over":
        (directory / "other").write_bytes(data)
        (directory / "other").replace(path)
    else:
        path.unlink()
        if how == "replaced":
            path.write_bytes(data)  # on some file systems with the same inode number, were it free
    assert bench.kept("second") == JournalState.LOCKED
    assert alarms(directory) == ["JRN-07"]
    assert bench.kept("acknowledged", kind="journal") == JournalState.OK
    bench.writer.close()
    assert verify(directory).wrong == ""
    found = texts(directory)
    assert [text for text in found if not text.startswith("JRN")][-3:] == ["first", "second", "acknowledged"]
    again = Journal(directory)
    assert not again.locked
    again.close()


@pytest.mark.parametrize("name", ["journal.mirror", "journal.key", "journal.anchors"])
def test_what_proves_it_is_written_anew_too(directory: Path, bench: Bench, name: str) -> None:
    path = places_of(directory).outside / name
    kept = path.read_bytes()
    path.unlink()
    assert bench.kept("second") == JournalState.LOCKED
    assert name == "journal.mirror" or path.read_bytes().split() == kept.split()
    bench.writer.close()
    assert verify(directory).wrong == ""


def test_a_second_name_of_the_file_locks(directory: Path, bench: Bench) -> None:
    os.link(directory / "journal.sqlite", directory / "a second name")
    assert bench.kept("second") == JournalState.LOCKED
    assert "has a second name" in texts(directory)[-2]
    assert bench.kept("acknowledged", kind="journal") == JournalState.OK  # it was read
    (directory / "a second name").unlink()
    assert bench.kept("third") == JournalState.OK
    os.link(directory / "journal.sqlite", directory / "again")
    assert bench.kept("fourth") == JournalState.LOCKED
    bench.writer.close()


@pytest.mark.parametrize("copied", [False, True])
def test_a_directory_that_is_moved_away_locks_until_it_is_back_and_keeps_its_events(
    directory: Path, bench: Bench, copied: bool
) -> None:
    away = directory.with_name("away")
    directory.rename(away)
    if copied:
        shutil.copytree(away, directory)
    assert bench.kept("second") == JournalState.LOCKED
    assert bench.kept("acknowledged", kind="journal") == JournalState.LOCKED  # as long as it is away
    if copied:
        shutil.rmtree(directory)
    away.rename(directory)
    assert bench.kept("third") == JournalState.OK
    bench.writer.close()
    assert [text for text in texts(directory) if "JRN" not in text][-3:] == [
        "second",
        "acknowledged",
        "third",
    ]
    assert verify(directory).wrong == ""


def test_a_directory_that_was_left_behind_is_noticed_at_the_next_start(directory: Path, bench: Bench) -> None:
    away = directory.with_name("away")
    directory.rename(away)
    shutil.copytree(away, directory)
    bench.kept("second")
    bench.writer.close()
    Journal(directory).close()
    assert alarms(directory) == ["JRN-04"]


def test_a_directory_that_is_removed_is_made_anew_with_every_event(directory: Path, bench: Bench) -> None:
    shutil.rmtree(directory)
    assert bench.kept("second") == JournalState.LOCKED
    bench.writer.close()
    assert [text for text in texts(directory) if "JRN" not in text][EVENTS:] == ["first", "second"]
    assert verify(directory).wrong == ""


def test_damage_in_use_is_moved_aside_and_the_events_wait_for_the_next_journal(
    directory: Path, bench: Bench
) -> None:
    bench.log.put("command", "second")
    os.truncate(directory / "journal.sqlite", 8192)
    with pytest.raises(DeviceError, match="was cut while it was in use"):
        bench.writer.drain()
    assert bench.kept("third") == JournalState.LOCKED
    assert texts(directory)[1:] == ["second", "third"]
    assert alarms(directory) == ["JRN-05"]
    bench.writer.close()


def test_an_anchor_is_kept_at_the_start_and_at_the_end(
    directory: Path, bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    bench.kept("second")
    bench.writer.close()
    lines = places_of(directory).anchors.read_text(encoding="utf-8").split("\n")
    assert [line.split()[0] for line in lines if line] == [str(EVENTS + 1), str(EVENTS + 2)]
    assert lines[-2] == anchor(directory).line
    assert f"journal anchor: {lines[-2]}\n" in capsys.readouterr().err


# --- what one look at one thing does not see -------------------------------------------------------


def test_a_sealed_row_of_a_second_history_is_not_certain_in_the_first(directory: Path) -> None:
    """Its seal is right and its number, too: only the row before does not lead to it."""
    kept = older(directory)
    with sqlite3.connect(directory / "journal.sqlite") as db:
        (other,) = db.execute(f"{SELECT} WHERE seq = ?", (HALF + 5,)).fetchall()
    db.close()
    put_back(directory, kept)
    shutil.copy(directory / "journal.mirror", places_of(directory).mirrors[1])
    add(directory, HALF + 1, EVENTS, "nothing")
    with sqlite3.connect(directory / "journal.sqlite") as db:
        db.execute("DELETE FROM events WHERE seq = ?", (HALF + 5,))
        db.execute(INSERT, other)
    db.close()
    verdict = verify_file(directory / "journal.sqlite", read_key(places_of(directory).key))
    assert verdict.wrong.startswith(f"row {HALF + 5} was changed, or one before it was taken out or put in")
    assert Span(HALF + 5, HALF + 5) in verdict.changed
    assert Span(1, HALF + 4) in verdict.certain


def test_nor_is_it_with_all_hashes_made_anew(directory: Path) -> None:
    """SHA-256 needs no secret: the seal of a row is over the hash that leads to it, so that no other history has it."""
    kept = older(directory)
    database = directory / "journal.sqlite"
    with sqlite3.connect(database) as db:
        (other,) = db.execute(f"{SELECT} WHERE seq = ?", (HALF + 5,)).fetchall()
    db.close()
    put_back(directory, kept)
    shutil.copy(directory / "journal.mirror", places_of(directory).mirrors[1])
    add(directory, HALF + 1, EVENTS, "nothing")
    with sqlite3.connect(database) as db:
        rows = db.execute(f"{SELECT} ORDER BY seq").fetchall()
        last = rows[HALF + 3][-2]
        for row in [other, *rows[HALF + 5 :]]:
            last = chained(last, content_of(row[0], row[1:-2]))
            db.execute("DELETE FROM events WHERE seq = ?", (row[0],))
            db.execute(INSERT, (*row[:-2], last, row[-1]))
        db.execute("UPDATE head SET hash = ?", (last,))
    db.close()
    assert verify_file(database, None).wrong == ""
    verdict = verify_file(database, read_key(places_of(directory).key))
    assert verdict.wrong == f"row {HALF + 5} was not sealed with the key of this journal"


def test_the_end_is_compared_by_its_hash_too(directory: Path) -> None:
    with sqlite3.connect(directory / "journal.sqlite") as db:
        db.execute("UPDATE head SET hash = ?", ("0" * 64,))
    db.close()
    assert verify_file(directory / "journal.sqlite", None).wrong.startswith("the end is missing: 60 rows")


def test_of_several_anchors_the_newest_says_what_was_there(directory: Path) -> None:
    journal = Journal(directory)
    journal.anchor()
    journal.append(1, 0, EVENTS + 1, [record(EVENTS + 1, "event")])
    journal.anchor()
    journal.close()
    shutil.rmtree(directory)
    places_of(directory).mirrors[1].unlink()
    Journal(directory).close()
    (told,) = texts(directory)
    assert told.startswith("JRN-04")
    assert str(EVENTS + 1) in told


def test_events_that_were_taken_out_of_the_middle_are_told_by_number(directory: Path) -> None:
    with sqlite3.connect(directory / "journal.sqlite") as db:
        db.execute("DELETE FROM events WHERE seq BETWEEN 20 AND 22")
    db.close()
    verdict = verify_file(directory / "journal.sqlite", read_key(places_of(directory).key))
    assert verdict.missing == (Span(20, 22),)
    # Sealed rows behind the gap are certain by themselves.
    assert verdict.certain == (Span(1, 19), Span(23, EVENTS))


@pytest.mark.parametrize("name", ["text", "utc", "monotonic_ns"])
def test_a_field_of_another_type_is_no_event(directory: Path, name: str) -> None:
    """A turned bit makes a blob of a text, and whoever reads events would fail on it."""
    with sqlite3.connect(directory / "journal.sqlite") as db:
        (row,) = db.execute(f"{SELECT} WHERE seq = 5").fetchall()
    db.close()
    at = COLUMNS.index(name)
    assert _entry(row).values["text"] == "event 5"
    with pytest.raises(Damaged, match="number 5 is no event"):
        _entry((*row[:at], b"\x00", *row[at + 1 :]))
