"""The file of the journal: tables, hash chain, damage."""

from __future__ import annotations

import hashlib
import json
import math
import os
import sqlite3
import stat
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from gantryctl.errors import DeviceError

FILE: Final = "journal.sqlite"
FIELDS: Final = (
    "boot", "source", "number", "utc", "monotonic_ns", "kind", "user", "role", "client", "place", "text", "detail"
)  # fmt: skip
START: Final = "0" * 64
_RIGHTS: Final = 0o640
# Rows whose chain is checked when a journal is opened; `verify` checks all.
_TAIL: Final = 10_000
# `head` is the last event, `base` the last one that was taken out because of its age or the size.
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
CREATE TABLE IF NOT EXISTS base (
    one INTEGER PRIMARY KEY CHECK (one = 1), seq INTEGER NOT NULL, hash TEXT NOT NULL
) STRICT;
INSERT OR IGNORE INTO head VALUES (1, 0, '{start}');
INSERT OR IGNORE INTO base VALUES (1, 0, '{start}');
"""


class Damaged(DeviceError):
    """The file is cut, edited or of another kind."""


# Errors that say nothing about the file's content.
_OF_THE_DISK: Final = frozenset(
    {
        sqlite3.SQLITE_PERM, sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_NOMEM,
        sqlite3.SQLITE_READONLY, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_FULL, sqlite3.SQLITE_CANTOPEN,
    }
)  # fmt: skip


def chained(previous: str, seq: int, values: Sequence[Any]) -> str:
    """Hash of a row, hexadecimal."""
    text = json.dumps([previous, seq, *values], separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


_LOST: Final = {"kind": "service", "text": "an event was damaged on its way"}
INSERT: Final = f"INSERT INTO events VALUES (?, {', '.join('?' * len(FIELDS))}, ?)"  # noqa: S608 - marks only


def row_of(boot: int, source: int, number: int, record: bytes | None) -> tuple[Any, ...]:
    """Make the content of a row, in the order of `FIELDS`."""
    found: dict[str, Any] = _LOST if record is None else json.loads(record)
    return (
        boot, source, number, found.get("utc", ""), found.get("monotonic_ns", 0), found["kind"],
        found.get("user", ""), found.get("role", ""), found.get("client", ""), found.get("place", ""),
        found["text"], json.dumps(found.get("values", {}), sort_keys=True, ensure_ascii=True),
    )  # fmt: skip


def own_record(kind: str, text: str, **values: Any) -> bytes:
    """Make an event of the journal's writer."""
    utc = datetime.now(UTC).isoformat(timespec="milliseconds")
    found = {"utc": utc, "monotonic_ns": time.monotonic_ns(), "kind": kind, "text": text, "values": values}
    return json.dumps(found).encode()


def connect(path: Path) -> sqlite3.Connection:
    """Connect in autocommit to a file that its owner writes, its group reads and others cannot see."""
    # SQLite gives the files beside it the same rights, and reports better what is wrong with the file.
    with suppress(OSError):
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, _RIGHTS)
        with os.fdopen(handle):
            os.fchmod(handle, stat.S_IMODE(os.fstat(handle).st_mode) & _RIGHTS)
    return sqlite3.connect(path, isolation_level=None, check_same_thread=False)


def open_file(path: Path, connected: Callable[[Path], sqlite3.Connection]) -> sqlite3.Connection:
    """Open the journal; make it where there is none.

    Raises:
        Damaged: it is not whole. sqlite3.Error: it cannot be opened, or is another kind of file.
    """
    db = connected(path)
    try:
        # What `append` has returned for survives a kill and a power cut: of 1000 simulated power cuts none lost such an
        # event, with synchronous = NORMAL 938 did (docs/evidence/journal_power_cuts.json).
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = FULL")
        db.executescript(_SCHEMA.format(start=START))
        _check_tail(db)
    except BaseException:
        db.close()
        raise
    return db


def _check_tail(db: sqlite3.Connection) -> None:
    """Check that the last rows fit together; Damaged otherwise."""
    if db.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
        raise Damaged("the database is damaged")
    base_seq, base_hash = db.execute("SELECT seq, hash FROM base").fetchone()
    head_seq, head_hash = db.execute("SELECT seq, hash FROM head").fetchone()
    rows = db.execute("SELECT * FROM events ORDER BY seq DESC LIMIT ?", (_TAIL + 1,)).fetchall()[::-1]
    if (rows[-1][0], rows[-1][-1]) != (head_seq, head_hash) if rows else head_seq != base_seq:
        raise Damaged("the end of the journal is missing")
    if len(rows) > _TAIL:
        last = rows.pop(0)[-1]
    else:
        last = base_hash
        if rows and rows[0][0] != base_seq + 1:
            raise Damaged(f"row {base_seq + 1} is missing")
    for row in rows:
        last = chained(last, row[0], row[1:-1])
        if last != row[-1]:
            raise Damaged(f"row {row[0]} was changed")


def older(db: sqlite3.Connection, before_utc: str, base: int) -> int:
    """Find the last event before the first one that is young enough."""
    query = "SELECT seq FROM events WHERE utc >= ? ORDER BY seq LIMIT 1"
    found = db.execute(query, (before_utc,)).fetchone()
    return int(found[0]) - 1 if found else base


def surplus(db: sqlite3.Connection, bytes_max: int, base: int, head: int) -> int:
    """Find the last of the oldest events whose removal brings all of them below the limit."""
    names = ("page_count", "freelist_count", "page_size")
    pages, free, size = (db.execute(f"PRAGMA {name}").fetchone()[0] for name in names)
    used = (pages - free) * size
    return base + math.ceil((head - base) * (1.0 - bytes_max / used)) if used > bytes_max else base


def is_damage(fault: Exception) -> bool:
    """Tell damage to the file from a disk that is full or not ours."""
    if isinstance(fault, OSError):
        return False
    return getattr(fault, "sqlite_errorcode", 0) & 0xFF not in _OF_THE_DISK


def move_aside(path: Path) -> Path:
    """Rename a damaged journal with the files beside it; return the new name."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f")
    aside = path.with_name(f"{path.stem}-damaged-{stamp}.sqlite")
    path.rename(aside)
    for ending in ("-wal", "-shm"):
        beside = path.with_name(path.name + ending)
        if beside.exists():
            beside.rename(aside.with_name(aside.name + ending))
    return aside
