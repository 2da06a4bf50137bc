"""The file of the journal by hand: what is one of ours, which numbers were used, what is too much, what is damage."""

from __future__ import annotations

import os
import sqlite3
import stat
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.service.recorder.journal import file
from gantryctl.service.recorder.journal.chain import Anchor, anchors_in, of_journal


def test_anchors_are_lines_with_others_between_them() -> None:
    """A power cut tears one: each is written with an empty line before it."""
    assert anchors_in("\n7 aa 2026 m\n\n  \n8 bb - m\n") == [
        Anchor(7, "aa", "2026", "m"),
        Anchor(8, "bb", "-", "m"),
    ]
    with pytest.raises(ValueError, match="not enough"):
        anchors_in("7 aa")


def test_two_anchors_of_one_event_are_both_compared() -> None:
    one, other = Anchor(7, "aa", "2026", "m"), Anchor(7, "bb", "2026", "m")
    assert of_journal([one, other, Anchor(8, "cc", "2026", "n")], "m") == {7: [one, other]}


def test_a_link_is_no_journal_and_what_others_may_do_is_taken_away(tmp_path: Path) -> None:
    target = tmp_path / "secret"
    target.write_bytes(b"")
    target.chmod(0o666)
    (tmp_path / "link").symlink_to(target)
    file.connect(tmp_path / "link").close()
    # SQLite follows it by itself, and nothing of it was changed before.
    assert stat.S_IMODE(target.stat().st_mode) == 0o666
    before = os.umask(0)
    try:
        file.connect(tmp_path / "new").close()
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640
    (tmp_path / "new").chmod(0o666)
    file.connect(tmp_path / "new").close()
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640


def answers(**changes: Any) -> Any:
    """Rows of a sound file, but for those that are changed."""
    found = {
        "user_version": [(file.VERSION,)], "quick_check": [("ok",)],
        "sqlite_schema": [(table,) for table in file.TABLES],
    } | changes  # fmt: skip
    return lambda query: next(rows for name, rows in found.items() if name in query)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, ""), ({"user_version": [(1,)]}, "of version 1, wanted 2"),
        ({"user_version": [(3,)]}, "of version 3, wanted 2"),
        ({"quick_check": [("row 3 missing from index",)]}, "is damaged"),
        ({"quick_check": [("ok",), ("row 3",)]}, "is damaged"),
        ({"sqlite_schema": [(table,) for table in file.TABLES[:3]]}, "not those of a journal"),
        ({"sqlite_schema": [*((each,) for each in file.TABLES), ("CREATE TABLE a",)]}, "not those of a journal"),
    ],
)  # fmt: skip
def test_a_file_of_another_kind_or_version_is_no_journal(changes: dict[str, Any], words: str) -> None:
    if words:
        with pytest.raises(file.Damaged, match=words):
            file.check_tables(answers(**changes))
    else:
        file.check_tables(answers())


def test_the_numbers_of_the_newest_start_are_those_that_count() -> None:
    """A number of 62 bits may come again by chance: events of an older start with it count nothing."""
    db = sqlite3.connect(":memory:")
    db.execute("CREATE TABLE events (seq INTEGER PRIMARY KEY, boot, source, number)")
    rows = [
        (5, 0, 90), (5, 1, 91), (4, 0, 50), (5, 0, 1), (5, 0, 2), (5, 1, 7), (0, file.OWN, 10**18), (5, 0, 3),
    ]  # fmt: skip
    db.executemany("INSERT INTO events (boot, source, number) VALUES (?, ?, ?)", rows)
    assert file.numbers_of(db, 5) == {0: 3, 1: 7}
    assert file.numbers_of(db, 4) == {}
    db.close()


@pytest.mark.parametrize(
    ("bytes_max", "last"),
    # 60 of 100 pages are used, 245 760 bytes; a quarter of 1000 events must go for 184 320 of them.
    [(245_760, 100), (300_000, 100), (184_320, 350), (245_759, 101), (0, 1100)],
)
def test_so_many_of_the_oldest_go_that_the_rest_fits(bytes_max: int, last: int) -> None:
    pages = {"page_count": 100, "freelist_count": 40, "page_size": 4096}

    def execute(query: str) -> Any:
        return SimpleNamespace(fetchone=lambda: (pages[query.removeprefix("PRAGMA ")],))

    db: Any = SimpleNamespace(execute=execute)
    assert file.surplus(db, bytes_max, 100, 1100) == last


def with_code(code: int) -> sqlite3.Error:
    fault = sqlite3.OperationalError("said by SQLite")
    fault.sqlite_errorcode = code
    return fault


@pytest.mark.parametrize(
    ("fault", "damage"),
    [
        (MemoryError(), False), (OSError(28, "no space"), False), (ValueError("no text"), True),
        (with_code(sqlite3.SQLITE_CORRUPT), True), (with_code(sqlite3.SQLITE_FULL), False),
        # Extended codes: the kind stands in the lowest byte.
        (with_code(sqlite3.SQLITE_CORRUPT | 2 << 8), True), (with_code(sqlite3.SQLITE_IOERR | 3 << 8), False),
        (with_code(sqlite3.SQLITE_IOERR_SHORT_READ), True), (with_code(sqlite3.SQLITE_BUSY), False),
    ],
)  # fmt: skip
def test_damage_is_of_the_file_and_not_of_disk_or_memory(fault: BaseException, damage: bool) -> None:
    assert file.is_damage(fault) is damage


def test_a_file_goes_aside_with_all_that_belongs_to_it(tmp_path: Path) -> None:
    """The log of SQLite is evidence: a new journal of the same name would remove it."""
    path = tmp_path / "journal.sqlite"
    for ending in ("", "-wal", "-shm"):
        path.with_name(path.name + ending).write_text(ending, encoding="utf-8")
    aside = file.move_aside(path, "damaged")
    assert aside.name.startswith("journal-damaged-")
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted(
        aside.name + ending for ending in ("", "-wal", "-shm")
    )
    # What is not there is no fault.
    assert not file.move_aside(tmp_path / "gone.sqlite", "left").exists()
