"""The database of the journal: tables, rows, what is too old, damage."""

from __future__ import annotations

import json
import math
import os
import secrets
import sqlite3
import stat
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from gantryctl.errors import DeviceError
from gantryctl.service.recorder.journal.chain import first_hash
from gantryctl.service.recorder.journal.key import Key

FIELDS: Final = (
    "boot", "source", "number", "utc", "monotonic_ns", "kind", "user", "role", "client", "place", "text", "detail"
)  # fmt: skip
COLUMNS: Final = ("seq", *FIELDS, "hash", "seal")
SELECT: Final = f"SELECT {', '.join(COLUMNS)} FROM events"  # noqa: S608 - names of columns only
INSERT: Final = f"INSERT INTO events VALUES ({', '.join('?' * len(COLUMNS))})"  # noqa: S608 - marks only
# Files that SQLite keeps beside a database.
BESIDE: Final = ("-wal", "-shm")
# Source of the events that the journal's writer adds.
OWN: Final = 9
VERSION: Final = 2
_RIGHTS: Final = 0o640
# `head` is the last event, `base` the last one that was taken out because of its age or the size.
TABLES: Final = (
    """CREATE TABLE events (
    seq INTEGER PRIMARY KEY, boot INTEGER NOT NULL, source INTEGER NOT NULL, number INTEGER NOT NULL,
    utc TEXT NOT NULL, monotonic_ns INTEGER NOT NULL, kind TEXT NOT NULL, user TEXT NOT NULL, role TEXT NOT NULL,
    client TEXT NOT NULL, place TEXT NOT NULL, text TEXT NOT NULL, detail TEXT NOT NULL, hash TEXT NOT NULL,
    seal TEXT NOT NULL
) STRICT""",
    "CREATE TABLE head (one INTEGER PRIMARY KEY CHECK (one = 1), seq INTEGER NOT NULL, hash TEXT NOT NULL) STRICT",
    "CREATE TABLE base (one INTEGER PRIMARY KEY CHECK (one = 1), seq INTEGER NOT NULL, hash TEXT NOT NULL) STRICT",
    "CREATE TABLE journal (one INTEGER PRIMARY KEY CHECK (one = 1), name TEXT NOT NULL, key TEXT NOT NULL) STRICT",
)
# Whatever sqlite3 raises for a damaged file: of its own, and when it makes Python values of what stands there.
FAULTS: Final = (sqlite3.Error, ValueError, TypeError, OverflowError, MemoryError, RecursionError, IndexError)
# Errors of SQLite that say something about the file's content; all others are of the disk or of this process.
_OF_THE_FILE: Final = frozenset(
    {
        sqlite3.SQLITE_ERROR, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_FORMAT,
        sqlite3.SQLITE_MISMATCH, sqlite3.SQLITE_CONSTRAINT, sqlite3.SQLITE_TOOBIG,
    }
)  # fmt: skip
_LOST: Final = {"kind": "service", "text": "an event was damaged on its way"}


class Damaged(DeviceError):
    """The file is cut, edited or of another kind."""


def row_of(boot: int, source: int, number: int, record: bytes | None) -> tuple[Any, ...]:
    """Make the content of a row, in the order of `FIELDS`."""
    found: dict[str, Any] = _LOST if record is None else json.loads(record)
    return (
        boot, source, number, found.get("utc", ""), found.get("monotonic_ns", 0), found["kind"],
        found.get("user", ""), found.get("role", ""), found.get("client", ""), found.get("place", ""),
        found["text"], json.dumps(found.get("values", {}), sort_keys=True, ensure_ascii=True),
    )  # fmt: skip


def own_row(kind: str, text: str, **values: Any) -> tuple[Any, ...]:
    """Make the content of an event of the journal's writer."""
    utc = datetime.now(UTC).isoformat(timespec="milliseconds")
    found = {"utc": utc, "monotonic_ns": time.monotonic_ns(), "kind": kind, "text": text, "values": values}
    return row_of(0, OWN, time.time_ns(), json.dumps(found).encode())


def lock_after(lock: int, seq: int, values: tuple[Any, ...]) -> int:
    """Follow the lock: an event of the writer sets it, one about the journal from somebody else frees it."""
    found = dict(zip(FIELDS, values, strict=True))
    if found["source"] != OWN:
        return 0 if found["kind"] == "journal" else lock
    return seq if json.loads(found["detail"]).get("lock") else lock


def connect(path: Path) -> sqlite3.Connection:
    """Connect in autocommit to a file that its owner writes, its group reads and others cannot see."""
    # SQLite gives the files beside it the same rights, and reports better what is wrong with the file.
    with suppress(OSError):
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, _RIGHTS)
        with os.fdopen(handle):
            os.fchmod(handle, stat.S_IMODE(os.fstat(handle).st_mode) & _RIGHTS)
    return sqlite3.connect(path, isolation_level=None, check_same_thread=False)


def open_file(path: Path, connected: Callable[[Path], sqlite3.Connection], key: Key) -> sqlite3.Connection:
    """Open the journal; make it where there is none.

    Raises:
        sqlite3.Error: it cannot be opened, or is no database.
    """
    db = connected(path)
    try:
        # What `append` has returned for survives a kill and a power cut (docs/evidence/journal_power_cuts.json:
        # with synchronous = NORMAL nearly every cut loses such an event).
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = FULL")
        if not db.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]:
            _make(db, key)
    except BaseException:
        db.close()
        raise
    return db


def _make(db: sqlite3.Connection, key: Key) -> None:
    name = secrets.token_hex(16)
    with db:
        db.execute("BEGIN IMMEDIATE")
        for table in TABLES:
            db.execute(table)
        for row in ("INSERT INTO head VALUES (1, 0, ?)", "INSERT INTO base VALUES (1, 0, ?)"):
            db.execute(row, (first_hash(name),))
        db.execute("INSERT INTO journal VALUES (1, ?, ?)", (name, key.name))
        db.execute(f"PRAGMA user_version = {VERSION}")


def check_tables(rows: Callable[[str], list[tuple[Any, ...]]]) -> None:
    """Check that database and tables are those of a journal of this version; Damaged otherwise."""
    version = rows("PRAGMA user_version")[0][0]
    if version != VERSION:
        raise Damaged(f"it is of version {version}, wanted {VERSION}")
    if rows("PRAGMA quick_check(1)") != [("ok",)]:
        raise Damaged("the database is damaged")
    if rows("SELECT sql FROM sqlite_schema ORDER BY rowid") != [(table,) for table in TABLES]:
        raise Damaged("its tables are not those of a journal")


def numbers_of(db: sqlite3.Connection, boot: int) -> dict[int, int]:
    """Find the newest event of every source in the newest start of the service, if that is this one."""
    found: dict[int, int] = {}
    for boot_kept, source, number in db.execute(
        "SELECT boot, source, number FROM events WHERE source <> ? ORDER BY seq DESC", (OWN,)
    ):
        if boot_kept != boot:
            break
        found.setdefault(source, number)
    return found


def surplus(db: sqlite3.Connection, bytes_max: int, base: int, head: int) -> int:
    """Find the last of the oldest events whose removal brings all of them below the limit."""
    names = ("page_count", "freelist_count", "page_size")
    pages, free, size = (db.execute(f"PRAGMA {name}").fetchone()[0] for name in names)
    used = (pages - free) * size
    return base + math.ceil((head - base) * (1.0 - bytes_max / used)) if used > bytes_max else base


def is_damage(fault: BaseException) -> bool:
    """Tell damage to the file from a disk that is full or not ours, or a process that is short of memory."""
    if isinstance(fault, (OSError, MemoryError)):
        return False
    code = getattr(fault, "sqlite_errorcode", None)
    # Without a code: what stands there is no text, or no number.
    return code is None or code & 0xFF in _OF_THE_FILE or code == sqlite3.SQLITE_IOERR_SHORT_READ


def move_aside(path: Path, why: str) -> Path:
    """Rename a journal with the files beside it, whichever are there; return the new name."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f")
    aside = path.with_name(f"{path.stem}-{why}-{stamp}.sqlite")
    for ending in ("", *BESIDE):
        beside = path.with_name(path.name + ending)
        with suppress(FileNotFoundError):
            beside.rename(aside.with_name(aside.name + ending))
    return aside
