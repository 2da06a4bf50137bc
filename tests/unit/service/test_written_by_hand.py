"""Hashes of the journal as sha256sum gives them, damage and a full disk, and a recording of an axis that turns back."""

from __future__ import annotations

import sqlite3

import pytest

from gantryctl.service.recorder.journal.chain import chained, sealed
from gantryctl.service.recorder.journal.file import is_damage
from gantryctl.service.recorder.journal.key import Key
from gantryctl.service.recorder.row_filter import _differ


def test_the_hash_of_an_event_holds_the_one_before() -> None:
    """printf 'ab[1,"x"]' | sha256sum."""
    assert chained("ab", b'[1,"x"]') == "404ccf9b2d84996687cd99204275df6a2ed0681b923f21df2303cfd2fb13c76e"


def test_the_seal_of_an_event_names_its_journal() -> None:
    key = Key(bytes(32))
    assert sealed(key, "one", "ab", b"[1]") != sealed(key, "two", "ab", b"[1]")


@pytest.mark.parametrize(
    ("code", "damage"),
    [
        (sqlite3.SQLITE_CORRUPT, True), (sqlite3.SQLITE_NOTADB, True), (sqlite3.SQLITE_IOERR_SHORT_READ, True),
        (sqlite3.SQLITE_FULL, False), (sqlite3.SQLITE_IOERR, False), (sqlite3.SQLITE_NOMEM, False),
    ],
)  # fmt: skip
def test_a_full_disk_is_no_damage(code: int, damage: bool) -> None:
    fault = sqlite3.OperationalError("the words do not count")
    fault.sqlite_errorcode = code
    assert is_damage(fault) is damage


@pytest.mark.parametrize(("a", "b"), [(1.0, 2.1), (2.1, 1.0)])
def test_a_change_of_either_sign_is_a_change(a: float, b: float) -> None:
    assert _differ(a, b, 1.0)
    assert not _differ(a, b, 1.2)
