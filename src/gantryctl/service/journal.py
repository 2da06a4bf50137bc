"""The journal: every command, alarm, change of control or setting and login, each bound to the one before.

SQLite in WAL mode with `synchronous=FULL`: what `append` has returned for survives a kill and a power cut. Row n holds
the SHA-256 over row n-1's hash and its own content, so any single edit shows.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.errors import DeviceError

FILE: Final = "journal.sqlite"
FIELDS: Final = (
    "boot", "source", "number", "utc", "monotonic_ns", "kind", "user", "role", "client", "place", "text", "detail"
)  # fmt: skip
_START: Final = "0" * 64
_TAIL: Final = 10_000
"""Rows whose chain is looked at when a journal is opened; `verify` looks at all."""
_SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS events (
    seq INTEGER PRIMARY KEY, boot INTEGER NOT NULL, source INTEGER NOT NULL, number INTEGER NOT NULL,
    utc TEXT NOT NULL, monotonic_ns INTEGER NOT NULL, kind TEXT NOT NULL, user TEXT NOT NULL, role TEXT NOT NULL,
    client TEXT NOT NULL, place TEXT NOT NULL, text TEXT NOT NULL, detail TEXT NOT NULL, hash TEXT NOT NULL,
    UNIQUE (boot, source, number)
) STRICT;
CREATE TABLE IF NOT EXISTS head (
    one INTEGER PRIMARY KEY CHECK (one = 1), seq INTEGER NOT NULL, hash TEXT NOT NULL
) STRICT;
INSERT OR IGNORE INTO head VALUES (1, 0, '{start}');
"""


class JournalFault(DeviceError):
    """The journal cannot keep events now: disk full, read-only, failing."""


class Damaged(DeviceError):
    """The file is no journal any more: cut, edited or of another kind."""


class Entry(NamedTuple):
    """One row."""

    seq: int
    values: dict[str, Any]
    hash: str


class Verdict(NamedTuple):
    """What `verify` found: rows looked at, and the first thing that is wrong, or ""."""

    rows: int
    wrong: str


class Journal:
    """The one writer's journal of a directory; a damaged one is moved aside and a new one begun.

    Attributes:
        moved_aside: where the damaged one went, or None.

    Args:
        connect: opens the database, in autocommit; a test puts a file system of its own under it.

    Raises:
        JournalFault: the directory cannot be used.
    """

    def __init__(self, directory: Path, connect: Callable[[Path], sqlite3.Connection] | None = None) -> None:
        self.path = directory / FILE
        connect = connect or _connect
        self.moved_aside: Path | None = None
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._db = _open(self.path, connect)
        except (Damaged, sqlite3.Error, OSError, ValueError, TypeError) as fault:
            if not _is_damage(fault):
                raise JournalFault(f"{self.path}: {fault}") from fault
            self.moved_aside = _move_aside(self.path)
            self._db = _open(self.path, connect)
        self._seq, self._hash = self._db.execute("SELECT seq, hash FROM head").fetchone()

    def append(self, boot: int, source: int, first: int, records: Sequence[bytes | None]) -> None:
        """Keep events; on the disk when this returns. Those that are there already are left out.

        Args:
            boot: number of this start of the service. source: who wrote them.
            first: number of the first one, counted by its source.
            records: as `EventLog.put` made them; None for one that was damaged on the way.

        Raises:
            JournalFault: nothing of it was kept.
        """
        seq, last = self._seq, self._hash
        try:
            with self._db:  # commits, or rolls back
                self._db.execute("BEGIN IMMEDIATE")
                for number, record in enumerate(records, first):
                    values = _row(boot, source, number, record)
                    known = "SELECT 1 FROM events WHERE boot = ? AND source = ? AND number = ?"
                    if self._db.execute(known, (boot, source, number)).fetchone():
                        continue
                    seq, last = seq + 1, chained(last, seq + 1, values)
                    self._db.execute(_INSERT, (seq, *values, last))
                self._db.execute("UPDATE head SET seq = ?, hash = ?", (seq, last))
        except sqlite3.Error as fault:
            raise JournalFault(f"{self.path}: {fault}") from fault
        self._seq, self._hash = seq, last

    def close(self) -> None:
        """Close the file."""
        self._db.close()


_OF_THE_DISK: Final = frozenset(
    {
        sqlite3.SQLITE_PERM, sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_NOMEM,
        sqlite3.SQLITE_READONLY, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_FULL, sqlite3.SQLITE_CANTOPEN,
    }
)  # fmt: skip
"""Errors that say nothing about the file's content."""
_LOST: Final = {"kind": "service", "text": "an event was damaged on its way"}
_INSERT: Final = f"INSERT INTO events VALUES (?, {', '.join('?' * len(FIELDS))}, ?)"


def chained(previous: str, seq: int, values: Sequence[Any]) -> str:
    """Hash of a row, hexadecimal."""
    text = json.dumps([previous, seq, *values], separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def read_journal(directory: Path, after: int = 0, limit: int = 10_000, newest: bool = False) -> list[Entry]:
    """Rows by number, from another process than the writer's.

    Raises:
        DeviceError: there is none, or it cannot be read.
    """
    order = "DESC" if newest else "ASC"
    query = f"SELECT * FROM events WHERE seq > ? ORDER BY seq {order} LIMIT ?"
    with _reading(directory) as rows:
        found = [_entry(row) for row in rows(query, (after, limit))]
    return found[::-1] if newest else found


def verify(directory: Path) -> Verdict:
    """Look at every row and its hash, and whether the end is there.

    Raises:
        DeviceError: there is none.
    """
    count, last = 0, _START
    try:
        with _reading(directory) as rows:
            for row in rows("SELECT * FROM events ORDER BY seq", ()):
                count += 1
                if row[0] != count:
                    return Verdict(count, f"row {count} is missing")
                last = chained(last, count, row[1:-1])
                if last != row[-1]:
                    return Verdict(
                        count, f"row {count} was changed, or one before it was taken out or put in"
                    )
            head = next(iter(rows("SELECT seq, hash FROM head", ())), None)
    except DeviceError as fault:
        if isinstance(fault, Damaged):
            return Verdict(count, str(fault))
        raise
    if head != (count, last):
        return Verdict(count, f"the end is missing: {count} rows, {head[0] if head else 'none'} were written")
    return Verdict(count, "")


class _reading:  # noqa: N801  (used like a function)
    """`with _reading(directory) as rows:` where `rows(query, values)` yields tuples."""

    def __init__(self, directory: Path) -> None:
        self._path = directory / FILE
        if not self._path.is_file():
            raise DeviceError(f"{self._path}: there is no journal yet")

    def __enter__(self) -> _Rows:
        try:
            self._db = sqlite3.connect(f"{self._path.resolve().as_uri()}?mode=ro", uri=True)
        except sqlite3.Error as fault:
            raise DeviceError(f"{self._path}: {fault}") from fault
        return _Rows(self._db, self._path)

    def __exit__(self, *_: object) -> None:
        self._db.close()


class _Rows:
    def __init__(self, db: sqlite3.Connection, path: Path) -> None:
        self._db, self._path = db, path

    def __call__(self, query: str, values: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
        try:
            yield from self._db.execute(query, values)
        except (sqlite3.Error, ValueError) as fault:
            raise Damaged(f"{self._path}: {fault}") from fault


def _entry(row: tuple[Any, ...]) -> Entry:
    return Entry(row[0], dict(zip(FIELDS, row[1:-1], strict=True)), row[-1])


def _row(boot: int, source: int, number: int, record: bytes | None) -> tuple[Any, ...]:
    """The content of a row, in the order of `FIELDS`."""
    found: dict[str, Any] = _LOST if record is None else json.loads(record)
    return (
        boot, source, number, found.get("utc", ""), found.get("monotonic_ns", 0), found["kind"],
        found.get("user", ""), found.get("role", ""), found.get("client", ""), found.get("place", ""),
        found["text"], json.dumps(found.get("values", {}), sort_keys=True, ensure_ascii=True),
    )  # fmt: skip


def _connect(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(path, isolation_level=None, check_same_thread=False)


def _open(path: Path, connect: Callable[[Path], sqlite3.Connection]) -> sqlite3.Connection:
    db = connect(path)
    try:
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = FULL")
        db.executescript(_SCHEMA.format(start=_START))
        _check_tail(db)
    except BaseException:
        db.close()
        raise
    return db


def _check_tail(db: sqlite3.Connection) -> None:
    """Whether the last rows fit together."""
    if db.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
        raise Damaged("the database is damaged")
    head_seq, head_hash = db.execute("SELECT seq, hash FROM head").fetchone()
    rows = db.execute("SELECT * FROM events ORDER BY seq DESC LIMIT ?", (_TAIL + 1,)).fetchall()[::-1]
    if (rows[-1][0], rows[-1][-1]) != (head_seq, head_hash) if rows else head_seq != 0:
        raise Damaged("the end of the journal is missing")
    last = _START if len(rows) <= _TAIL else rows.pop(0)[-1]
    for row in rows:
        last = chained(last, row[0], row[1:-1])
        if last != row[-1]:
            raise Damaged(f"row {row[0]} was changed")


def _is_damage(fault: Exception) -> bool:
    """Whether the file is damaged, rather than the disk full or not ours."""
    if isinstance(fault, OSError):
        return False
    return getattr(fault, "sqlite_errorcode", 0) & 0xFF not in _OF_THE_DISK


def _move_aside(path: Path) -> Path:
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f")
    aside = path.with_name(f"{path.stem}-damaged-{stamp}.sqlite")
    path.rename(aside)
    for ending in ("-wal", "-shm"):
        beside = path.with_name(path.name + ending)
        if beside.exists():
            beside.rename(aside.with_name(aside.name + ending))
    return aside
