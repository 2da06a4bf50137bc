"""Reads the journal, in a process other than its writer's, and copies it."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.errors import DeviceError, UsageError
from gantryctl.service.recorder.journal.chain import Anchor
from gantryctl.service.recorder.journal.file import FIELDS, SELECT, Damaged
from gantryctl.service.recorder.journal.places import FILE
from gantryctl.service.recorder.journal.proof import Rows, reading

_RIGHTS: Final = 0o640
_WHOLE: Final = frozenset({"boot", "source", "number", "monotonic_ns"})


class Entry(NamedTuple):
    """One row."""

    seq: int
    values: dict[str, Any]
    hash: str


class Comparison(NamedTuple):
    """Two journals side by side.

    Attributes:
        same: events that both have, alike.
        wrong: the first event that is not alike, or why they cannot be compared; "" otherwise.
        only_one, only_other: events that only one of them has, behind those that both have.
    """

    same: int
    wrong: str
    only_one: int
    only_other: int

    @property
    def trouble(self) -> str:
        """What is wrong when the other one is a copy of the first; a copy may be older."""
        if self.wrong or not self.only_other:
            return self.wrong
        return f"the copy has {self.only_other} events more: they are missing in the journal"


def read_journal(
    directory: Path, after: int = 0, limit: int = 10_000, newest: bool = False, kind: str = ""
) -> list[Entry]:
    """Read rows by number; with a kind, those of it only.

    Raises:
        UsageError: there is no journal. DeviceError: it cannot be read, or what stands in it is no event.
    """
    order = "DESC" if newest else "ASC"
    query = f"{SELECT} WHERE seq > ? AND (kind = ? OR ? = '') ORDER BY seq {order} LIMIT ?"
    with reading(directory / FILE) as rows:
        found = [_entry(row) for row in rows(query, (after, kind, kind, limit))]
    return found[::-1] if newest else found


def anchor(directory: Path) -> Anchor:
    """Return number and hash of the newest event.

    Raises:
        UsageError: there is no journal, or it is empty. DeviceError: it cannot be read.
    """
    path = directory / FILE
    with reading(path) as rows:
        newest = next(rows("SELECT seq, hash, utc FROM events ORDER BY seq DESC LIMIT 1", ()), None)
        if newest is None:
            raise UsageError(f"{path}: no event yet")
        seq, digest, utc = newest
        return Anchor(seq, digest, utc, _name(rows))


def copy_journal(source: Path, target: Path) -> Comparison:
    """Copy a journal into a file of its own; an older copy of it is replaced when nothing in that is different.

    Returns what was compared with the older copy, the new one first.

    Raises:
        DeviceError: the journal or the older copy cannot be read, or the disk does not take it.
        UsageError: the file is no older copy of this journal; it is left as it is.
    """
    draft = target.with_name(f"{target.name}.part")
    try:
        draft.unlink(missing_ok=True)
        os.close(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _RIGHTS))
        uri = f"{source.resolve().as_uri()}?mode=ro"
        with closing(sqlite3.connect(uri, uri=True)) as db, closing(sqlite3.connect(draft)) as made:
            db.backup(made)
            # One file without others beside it, to be carried elsewhere.
            made.execute("PRAGMA journal_mode = DELETE")
        found = Comparison(0, "", 0, 0)
        if target.exists():
            found = compare(draft, target)
            if found.trouble:
                raise UsageError(f"{target}: {found.trouble}; it is left as it is")
        with draft.open("rb+") as written:
            os.fsync(written.fileno())
        draft.replace(target)
    except (sqlite3.Error, OSError) as fault:
        raise DeviceError(f"{target}: the journal cannot be copied: {fault}") from fault
    finally:
        draft.unlink(missing_ok=True)
    return found


def compare(one: Path, other: Path) -> Comparison:
    """Compare two journals event by event: hash, seal and every field.

    Events that one of them has taken out because of their age are not compared.

    Raises:
        DeviceError: one is missing or cannot be opened.
    """
    same = only_one = only_other = 0
    with reading(one) as rows_one, reading(other) as rows_other:
        try:
            if _name(rows_one) != _name(rows_other):
                return Comparison(0, "they are different journals", 0, 0)
            first = max(_first(rows_one), _first(rows_other))
            for left, right in zip_longest(_from(rows_one, first), _from(rows_other, first)):
                if left is None:
                    only_other += 1
                elif right is None:
                    only_one += 1
                elif left == right:
                    same += 1
                else:
                    return Comparison(same, f"event {left[0]} is not the same in both", only_one, only_other)
        except Damaged as fault:
            return Comparison(same, str(fault), only_one, only_other)
    return Comparison(same, "", only_one, only_other)


def _name(rows: Rows) -> str:
    return str(next(rows("SELECT name FROM journal", ()), ("",))[0])


def _first(rows: Rows) -> int:
    return int(next(rows("SELECT seq FROM base", ()), (0,))[0]) + 1


def _from(rows: Rows, first: int) -> Iterator[tuple[Any, ...]]:
    return rows(f"{SELECT} WHERE seq >= ? ORDER BY seq", (first,))


def _entry(row: tuple[Any, ...]) -> Entry:
    values = dict(zip(FIELDS, row[1:-2], strict=True))
    # A damaged bit may turn a text into a blob, strict tables or not; whoever reads events relies on these types.
    right = all(isinstance(values[name], int if name in _WHOLE else str) for name in FIELDS)
    with suppress(ValueError, TypeError, RecursionError):
        if right and isinstance(json.loads(values["detail"]), dict):
            return Entry(row[0], values, row[-2])
    raise Damaged(f"{FILE}: what stands at number {row[0]} is no event")
