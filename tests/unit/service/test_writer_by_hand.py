"""The writer of the journal by hand: what it finds at its start, what locks it, what is on the disk when."""

from __future__ import annotations

import json
import os
import sqlite3
from contextlib import closing
from datetime import datetime, tzinfo
from pathlib import Path
from types import SimpleNamespace
from typing import Self

import pytest

from gantryctl.errors import DeviceError, UsageError
from gantryctl.service.recorder.journal import file, reading, writer
from gantryctl.service.recorder.journal.chain import Anchor
from gantryctl.service.recorder.journal.file import Damaged
from gantryctl.service.recorder.journal.key import Key, made_key, read_key
from gantryctl.service.recorder.journal.mirror import Mirror, Newest, SystemFile
from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.recorder.journal.proof import verify, verify_file
from gantryctl.service.recorder.journal.reading import _entry, _first, copy_journal, read_journal
from gantryctl.service.recorder.journal.writer import Journal

pytestmark = pytest.mark.usefixtures("keys")


def record(text: str, kind: str = "command") -> bytes:
    return json.dumps({"utc": "2026-01-01", "monotonic_ns": 1, "kind": kind, "text": text}).encode()


def filled(directory: Path, count: int = 3) -> Journal:
    made = Journal(directory)
    made.append(1, 0, 1, [record(f"event {n}") for n in range(1, count + 1)])
    return made


def texts(directory: Path) -> list[str]:
    return [entry.values["text"] for entry in read_journal(directory)]


def test_a_journal_that_was_cut_to_nothing_is_gone_and_locks_the_new_one(tmp_path: Path) -> None:
    """There is nothing to move aside; the mirrors know that three events were there."""
    filled(tmp_path).close()
    os.truncate(tmp_path / "journal.sqlite", 0)
    made = Journal(tmp_path)
    assert made.locked
    assert made.moved_aside is None
    made.close()
    (told,) = texts(tmp_path)
    assert told.startswith("JRN-04")
    assert "3" in told.removeprefix("JRN-04")


def test_of_two_mirrors_the_one_that_knows_more_is_believed(tmp_path: Path) -> None:
    """A power cut came between them, and the journal is gone."""
    made = filled(tmp_path)
    name = made._name
    made.close()
    places = places_of(tmp_path)
    key = read_key(places.key)
    for path, seq in zip(places.mirrors, (41, 42), strict=True):
        mirror = Mirror(path, key)
        mirror.write(Newest(Anchor(seq, "00", "2026-01-01", name), 0))
        mirror.close()
    (tmp_path / "journal.sqlite").unlink()
    Journal(tmp_path).close()
    (told,) = texts(tmp_path)
    assert "42" in told
    assert "41" not in told


def test_an_anchor_is_of_an_event_and_there_once(tmp_path: Path) -> None:
    made = Journal(tmp_path)
    assert made.anchor() is None
    made.append(1, 0, 1, [record("one")])
    anchor = made.anchor()
    assert anchor is not None
    assert anchor.seq == 1
    assert made.anchor() is None
    made.append(1, 0, 2, [record("two")])
    assert made.anchor() is not None
    made.close()


def test_an_anchor_is_in_its_file_when_the_disk_is_asked_to_keep_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, kept = filled(tmp_path), list[str]()
    anchors = places_of(tmp_path).anchors
    monkeypatch.setattr(writer.os, "fsync", lambda _: kept.append(anchors.read_text(encoding="utf-8")))
    anchor = made.anchor()
    made.close()
    assert anchor is not None
    assert kept == [f"\n{anchor.line}\n"]


@pytest.mark.parametrize(
    ("rows", "locked"),
    [
        (["lock", "command"], True), (["command", "lock"], True), (["lock", "journal"], False),
        (["journal", "lock"], True), (["lock", "note"], True),
    ],
)  # fmt: skip
def test_a_lock_holds_over_all_events_of_its_commit(tmp_path: Path, rows: list[str], locked: bool) -> None:
    """Until somebody else says something about the journal; what the writer notes frees nothing."""
    made = Journal(tmp_path)
    lock, note = file.own_row("alarm", "JRN-07", lock=True), file.own_row("service", "a note")
    each = {"lock": lock, "note": note} | {
        kind: file.row_of(1, 0, number, record(kind, kind))
        for number, kind in enumerate(("command", "journal"), 1)
    }
    made._keep([each[row] for row in rows])
    assert made.locked is locked
    made.reflect()
    made.close()
    again = Journal(tmp_path)
    assert again.locked is locked
    again.close()


def test_a_commit_that_failed_leaves_the_numbers_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = filled(tmp_path)
    with monkeypatch.context() as failing:
        failing.setattr(file, "INSERT", "INSERT INTO nowhere VALUES (?)")
        with pytest.raises(writer.JournalFault):
            made.append(1, 0, 4, [record("event 4"), record("event 5")])
    assert made.newest.seq == 3
    made.append(1, 0, 4, [record("event 4")])
    made.close()
    assert [entry.seq for entry in read_journal(tmp_path)] == [1, 2, 3, 4]


@pytest.mark.parametrize(("newest", "seen"), [(1, False), (2, True), (3, True), (0, True)])
def test_a_quick_check_judges_as_many_of_the_newest_as_it_says(
    tmp_path: Path, newest: int, seen: bool
) -> None:
    """Event 4 of five was changed."""
    filled(tmp_path, 5).close()
    with closing(sqlite3.connect(tmp_path / "journal.sqlite")) as db, db:
        db.execute("UPDATE events SET text = 'nothing' WHERE seq = 4")
    assert bool(verify(tmp_path, newest=newest).wrong) is seen


def test_a_journal_that_somebody_else_has_sealed_is_told(tmp_path: Path) -> None:
    filled(tmp_path).close()
    assert verify(tmp_path).wrong == ""
    assert verify(tmp_path, key=Key(b"x" * 32)).wrong == "it is sealed with another key"


def test_what_lies_beside_a_journal_that_was_cut_to_nothing_is_kept_as_evidence(tmp_path: Path) -> None:
    """SQLite would take the log away that belongs to no database."""
    filled(tmp_path).close()
    os.truncate(tmp_path / "journal.sqlite", 0)
    (tmp_path / "journal.sqlite-wal").write_bytes(b"evidence")
    made = Journal(tmp_path)
    made.close()
    assert made.moved_aside is not None
    assert made.moved_aside.with_name(f"{made.moved_aside.name}-wal").read_bytes() == b"evidence"


def test_what_proves_a_journal_is_for_its_owner_alone(tmp_path: Path) -> None:
    """Whatever the umask, and where the folder of the keys is there already."""
    before = os.umask(0)
    try:
        made = filled(tmp_path / "journal")
        assert made.anchor() is not None
        made.close()
        (tmp_path / "keys").mkdir()
        for place in ("keys/one", "new/folder/two"):
            key = made_key(tmp_path / place)
            assert made_key(tmp_path / place).secret == key.secret
            assert (tmp_path / place).stat().st_mode & 0o777 == 0o600
        assert (tmp_path / "new" / "folder").stat().st_mode & 0o777 == 0o700
    finally:
        os.umask(before)
    assert made.places.anchors.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("unsettled", "passed_s", "settles"),
    [(True, 1.0, True), (True, 0.9, False), (False, 1.0, False), (False, 0.0, False)],
)
def test_what_was_committed_is_in_the_database_a_second_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unsettled: bool, passed_s: float, settles: bool
) -> None:
    made, now_s = filled(tmp_path), [1e6]
    monkeypatch.setattr(writer, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    made.settle()
    made._unsettled = unsettled
    now_s[0] += passed_s
    log = made._db.execute
    asked: list[str] = []
    db, made._db = made._db, SimpleNamespace(execute=lambda text: (asked.append(text), log(text))[1])  # type: ignore[assignment]
    made.settle()
    assert [text for text in asked if "wal_checkpoint" in text] == asked
    assert bool(asked) is settles
    made._db = db
    made.close()


@pytest.mark.parametrize("detail", ["[]", "5", "null", "no JSON"])
def test_a_row_whose_detail_is_no_table_is_no_event(detail: str) -> None:
    values = {
        name: 1 if name in ("boot", "source", "number", "monotonic_ns") else "x" for name in file.FIELDS
    }
    row = (7, *{**values, "detail": '{"a": 1}'}.values(), "hash", "seal")
    assert _entry(row).seq == 7
    with pytest.raises(Damaged, match="number 7 is no event"):
        _entry((7, *{**values, "detail": detail}.values(), "hash", "seal"))


@pytest.mark.parametrize(("rows", "first"), [([], 1), ([(0,)], 1), ([(41,)], 42)])
def test_a_journal_begins_behind_what_was_taken_from_it(rows: list[tuple[int]], first: int) -> None:
    assert _first(lambda *_: iter(rows)) == first


def test_an_event_of_the_journal_itself_is_of_no_boot_and_of_its_own_source() -> None:
    assert file.own_row("alarm", "text")[:2] == (0, file.OWN)


def test_a_file_that_cannot_be_made_a_journal_is_closed_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise sqlite3.OperationalError("disk full")

    monkeypatch.setattr(file, "_make", fails)
    db = sqlite3.connect(tmp_path / "new.sqlite")
    with pytest.raises(sqlite3.OperationalError, match="disk full"):
        file.open_file(tmp_path / "new.sqlite", lambda _: db, Key(bytes(32)))
    with pytest.raises(sqlite3.ProgrammingError):
        db.execute("SELECT 1")


@pytest.mark.parametrize(("known", "last"), [((), 0), ((5,), 5), ((5, 9, 2), 9)])
def test_of_a_damaged_file_everything_is_missing_that_was_known(
    tmp_path: Path, known: tuple[int, ...], last: int
) -> None:
    (tmp_path / "journal").write_bytes(b"no database" * 100)
    anchors = [Anchor(seq, "hash", "2026-01-01", "name") for seq in known]
    found = verify_file(tmp_path / "journal", None, anchors)
    assert [(span.first, span.last) for span in found.missing] == ([(1, last)] if last else [])


def test_a_journal_whose_key_is_gone_cannot_be_checked(tmp_path: Path) -> None:
    made = filled(tmp_path)
    made.close()
    made.places.key.unlink()
    with pytest.raises(DeviceError, match="key"):
        verify(tmp_path)


def test_each_source_has_numbers_of_its_own_and_an_old_batch_takes_none_back(tmp_path: Path) -> None:
    """Events 1 to 3 of one source, 1 to 2 of another one, the first of the one once more, then 2 to 4 of it."""
    made = filled(tmp_path)
    made.append(1, 1, 1, [record("other 1"), record("other 2")])
    made.append(1, 0, 1, [record("event 1")])
    made.append(1, 0, 2, [record(f"event {n}") for n in (2, 3, 4)])
    made.close()
    assert texts(tmp_path) == ["event 1", "event 2", "event 3", "other 1", "other 2", "event 4"]


def test_every_field_of_an_event_goes_into_its_own_column() -> None:
    said = {
        "utc": "2026-01-02", "monotonic_ns": 3, "kind": "note", "user": "anna", "role": "service", "client": "c0de",
        "place": "console", "text": "all is well", "values": {"b": 2, "a": 1},
    }  # fmt: skip
    row = file.row_of(7, 2, 41, json.dumps(said).encode())
    assert dict(zip(file.FIELDS, row, strict=True)) == {
        **{name: value for name, value in said.items() if name != "values"},
        "boot": 7,
        "source": 2,
        "number": 41,
        "detail": '{"a": 1, "b": 2}',
    }


def test_what_the_recorder_says_has_the_time_in_utc(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is one o'clock where the computer stands, and noon in UTC."""

    class Here(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Self:
            return cls(2026, 1, 2, 13 if tz is None else 12, tzinfo=tz)

    monkeypatch.setattr(file, "datetime", Here)
    found = dict(zip(file.FIELDS, file.own_row("service", "text"), strict=True))
    assert found["utc"] == "2026-01-02T12:00:00.000+00:00"


def test_a_copy_is_on_the_disk_before_it_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    filled(tmp_path / "state").close()
    target, named = tmp_path / "copy.sqlite", list[bool]()
    monkeypatch.setattr(reading, "os", SimpleNamespace(**vars(os)))
    monkeypatch.setattr(reading.os, "fsync", lambda _: named.append(target.exists()))
    assert copy_journal(tmp_path / "state" / "journal.sqlite", target) == (0, "", 0, 0)
    assert named == [False]
    assert target.exists()
    assert copy_journal(tmp_path / "state" / "journal.sqlite", target) == (3, "", 0, 0)


def test_a_copy_that_is_refused_leaves_nothing_behind(tmp_path: Path) -> None:
    for name in ("one", "two"):
        filled(tmp_path / name).close()
    copy_journal(tmp_path / "one" / "journal.sqlite", tmp_path / "copy.sqlite")
    with pytest.raises(UsageError, match="they are different journals"):
        copy_journal(tmp_path / "two" / "journal.sqlite", tmp_path / "copy.sqlite")
    assert [path.name for path in tmp_path.glob("copy*")] == ["copy.sqlite"]


def test_a_journal_that_was_begun_in_place_of_a_lost_one_and_got_no_event_is_gone_on_with(
    tmp_path: Path,
) -> None:
    """Its writer was killed before it could say so."""
    made = filled(tmp_path)
    key = made._key
    made.close()
    path = tmp_path / "journal.sqlite"
    path.unlink()
    file.open_file(path, file.connect, key).close()
    again = Journal(tmp_path)
    assert (again.moved_aside, again.locked) == (None, True)
    again.close()
    (told,) = texts(tmp_path)
    assert told.startswith("JRN-04")


def test_the_mirrors_are_written_when_there_is_something_new(tmp_path: Path) -> None:
    """Twice for each commit, and not in each look."""
    written: list[Path] = []

    class Counted(SystemFile):
        def __init__(self, path: Path) -> None:
            super().__init__(path)
            self.path = path

        def write(self, offset: int, data: bytes) -> None:
            written.append(self.path)
            super().write(offset, data)

    made = Journal(tmp_path, opened=Counted)
    written.clear()
    for number in (1, 2):
        made.append(1, 0, number, [record("an event")])
        for _ in range(3):
            made.reflect()
    assert written == [*made.places.mirrors] * 2
    made.close()


def test_a_log_that_cannot_be_settled_is_a_fault_of_the_journal(tmp_path: Path) -> None:
    made = filled(tmp_path)

    def fails(_: str) -> None:
        raise sqlite3.OperationalError("disk I/O error")

    db, made._settled_s = made._db, float("-inf")
    made._db = SimpleNamespace(execute=fails)  # type: ignore[assignment]
    with pytest.raises(writer.JournalFault, match="disk I/O error"):
        made.settle()
    made._db = db
    made.close()


def test_without_mirrors_the_head_of_the_file_says_what_is_missing_at_its_end(tmp_path: Path) -> None:
    """The last two of five were taken out."""
    filled(tmp_path, 5).close()
    path = tmp_path / "journal.sqlite"
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("DELETE FROM events WHERE seq > 3")
    found = verify_file(path, None)
    assert [(span.first, span.last) for span in found.missing] == [(4, 5)]
    assert found.wrong == "the end is missing: 3 rows, 5 were written"
