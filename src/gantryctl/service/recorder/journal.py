"""The journal: every command, alarm, change of control or setting and login, each bound to the one before.

Row n holds the SHA-256 over row n-1's hash and its own content, so any single edit shows.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

from gantryctl.errors import DeviceError
from gantryctl.program.alarms.codes import Code
from gantryctl.service.recorder import journal_file as file

# Events that stay whatever their age and size: the last runs can always be read.
KEPT_LEAST: Final = 1000
# Events taken out in one commit: no longer than a second.
PRUNED_MOST: Final = 20_000
# Source of the events that the journal's writer adds.
OWN: Final = 9


_Rows: TypeAlias = Callable[[str, tuple[Any, ...]], Iterator[tuple[Any, ...]]]


class JournalFault(DeviceError):
    """The journal cannot keep events now: disk full, read-only, failing."""


class Entry(NamedTuple):
    """One row."""

    seq: int
    values: dict[str, Any]
    hash: str


class Batch(NamedTuple):
    """Events of one source, in their order.

    Attributes:
        source: who wrote them.
        first: number of the first one, counted by its source.
        records: as `EventLog.put` made them; None for one that was damaged on the way.
    """

    source: int
    first: int
    records: Sequence[bytes | None]


class Anchor(NamedTuple):
    """Number and hash of one event, to be kept out of reach of those who can write the journal."""

    seq: int
    hash: str
    utc: str


class Verdict(NamedTuple):
    """The result of `verify`.

    Attributes:
        rows: checked rows.
        wrong: the first thing that is wrong, or "".
        first: number of the first row; above 1 when older ones were taken out by age or size.
        anchors: how many of the anchors given were found in the chain.
    """

    rows: int
    wrong: str
    first: int = 1
    anchors: int = 0


class Journal:
    """The one writer's journal of a directory; a damaged one is moved aside and a new one begun.

    Attributes:
        moved_aside: where the damaged one went, or None.

    Args:
        connect: opens the database, in autocommit; a test puts a failing file system under it.

    Raises:
        JournalFault: the directory cannot be used.
    """

    def __init__(self, directory: Path, connect: Callable[[Path], sqlite3.Connection] | None = None) -> None:
        self.path = directory / file.FILE
        connect = connect or file.connect
        self.moved_aside: Path | None = None
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._db = file.open_file(self.path, connect)
        except (file.Damaged, sqlite3.Error, OSError, ValueError, TypeError) as fault:
            if not file.is_damage(fault):
                raise JournalFault(f"{self.path}: {fault}") from fault
            self.moved_aside = file.move_aside(self.path)
            self._db = file.open_file(self.path, connect)
        self._seq, self._hash = self._db.execute("SELECT seq, hash FROM head").fetchone()

    def append(self, boot: int, source: int, first: int, records: Sequence[bytes | None]) -> None:
        """Keep one batch, as `append_all`."""
        self.append_all(boot, [Batch(source, first, records)])

    def append_all(self, boot: int, batches: Sequence[Batch]) -> None:
        """Keep events in one commit: they are on the disk when this returns. Those that are there already are left out.

        Args:
            boot: number of this start of the service.

        Raises:
            JournalFault: nothing of it was kept.
        """
        seq, last = self._seq, self._hash
        try:
            with self._db:  # commits, or rolls back
                self._db.execute("BEGIN IMMEDIATE")
                for source, first, records in batches:
                    for number, record in enumerate(records, first):
                        values = file.row_of(boot, source, number, record)
                        known = "SELECT 1 FROM events WHERE boot = ? AND source = ? AND number = ?"
                        if self._db.execute(known, (boot, source, number)).fetchone():
                            continue
                        seq, last = seq + 1, file.chained(last, seq + 1, values)
                        self._db.execute(file.INSERT, (seq, *values, last))
                self._db.execute("UPDATE head SET seq = ?, hash = ?", (seq, last))
        except sqlite3.Error as fault:
            raise JournalFault(f"{self.path}: {fault}") from fault
        self._seq, self._hash = seq, last

    def prune(self, before_utc: str, bytes_max: int) -> int:
        """Remove the oldest events, and write which, with their hash, in the same commit; return how many.

        The newest `KEPT_LEAST` stay, whatever the limits; one call takes `PRUNED_MOST` at most.

        Args:
            before_utc: events of before this time go, ISO 8601; "" for no limit.
            bytes_max: what the events may occupy. The file does not shrink: its room is used again.

        Raises:
            JournalFault: nothing was changed.
        """
        db, head = self._db, self._seq
        try:
            base = db.execute("SELECT seq FROM base").fetchone()[0]
            upto = max(file.older(db, before_utc, base), file.surplus(db, bytes_max, base, head))
            upto = min(upto, head - KEPT_LEAST, base + PRUNED_MOST)
            if upto <= base:
                return 0
            last = db.execute("SELECT hash FROM events WHERE seq = ?", (upto,)).fetchone()[0]
            # Decision 0011: what is taken out stays provable. The chain begins at the hash that this event keeps.
            said = file.own_record(
                "journal", f"events {base + 1} to {upto} were taken out by age or size", base=upto, hash=last
            )
            values = file.row_of(0, OWN, time.time_ns(), said)
            seq, head_hash = head + 1, file.chained(self._hash, head + 1, values)
            with db:
                db.execute("BEGIN IMMEDIATE")
                db.execute(file.INSERT, (seq, *values, head_hash))
                db.execute("UPDATE head SET seq = ?, hash = ?", (seq, head_hash))
                db.execute("DELETE FROM events WHERE seq <= ?", (upto,))
                db.execute("UPDATE base SET seq = ?, hash = ?", (upto, last))
        except sqlite3.Error as fault:
            raise JournalFault(f"{self.path}: {fault}") from fault
        self._seq, self._hash = seq, head_hash
        return int(upto - base)

    def locked(self) -> bool:
        """Whether it follows a damaged journal, and service has not acknowledged that yet."""
        first = self._db.execute("SELECT detail FROM events WHERE seq = 1").fetchone()
        if first is None or json.loads(first[0]).get("code") != Code.JRN_05:
            return False
        acknowledged = "SELECT 1 FROM events WHERE kind = 'journal' AND source <> ? LIMIT 1"
        return self._db.execute(acknowledged, (OWN,)).fetchone() is None

    def note(self, kind: str, text: str, **values: object) -> None:
        """Keep an event of the recorder itself."""
        self.append(0, OWN, time.time_ns(), [file.own_record(kind, text, **values)])

    def close(self) -> None:
        """Close the file."""
        self._db.close()


def read_journal(directory: Path, after: int = 0, limit: int = 10_000, newest: bool = False) -> list[Entry]:
    """Read rows by number, in a process other than the writer's.

    Raises:
        DeviceError: the journal is missing or cannot be read.
    """
    order = "DESC" if newest else "ASC"
    query = f"SELECT * FROM events WHERE seq > ? ORDER BY seq {order} LIMIT ?"  # noqa: S608 - one of two words
    with _reading(directory) as rows:
        found = [_entry(row) for row in rows(query, (after, limit))]
    return found[::-1] if newest else found


def anchor(directory: Path) -> Anchor:
    """Return number and hash of the newest event.

    Raises:
        DeviceError: there is no journal, or it is empty.
    """
    newest = read_journal(directory, limit=1, newest=True)
    if not newest:
        raise DeviceError(f"{directory / file.FILE}: no event yet")
    return Anchor(newest[0].seq, newest[0].hash, newest[0].values["utc"])


def verify(directory: Path, anchors: Sequence[Anchor] = (), newest: int = 0) -> Verdict:
    """Check every row and its hash, the end, and that a removal of old events was written down.

    Args:
        anchors: events that must be in it as they were. Those from before its first row are not looked for.
        newest: check only so many, for a quick start; 0 for all.

    Raises:
        DeviceError: there is no journal.
    """
    try:
        with _reading(directory) as rows:
            return _verified(rows, {each.seq: each for each in anchors}, newest)
    except file.Damaged as fault:
        return Verdict(0, str(fault))


def _verified(rows: _Rows, anchors: dict[int, Anchor], newest: int) -> Verdict:
    base, base_hash = next(iter(rows("SELECT seq, hash FROM base", ())), (0, file.START))
    written_down, said = base == 0, json.dumps({"base": base, "hash": base_hash})
    if newest:
        before = "SELECT seq, hash FROM events WHERE seq = (SELECT seq FROM head) - ?"
        base, base_hash = next(iter(rows(before, (newest,))), (base, base_hash))
        written_down = True
    count, last, found = base, base_hash, 0

    def verdict(wrong: str) -> Verdict:
        return Verdict(count - base, wrong, base + 1, found)

    if base in anchors and anchors[base].hash != base_hash:
        return verdict(f"event {base} is another one than on {anchors[base].utc}")
    for row in rows("SELECT * FROM events WHERE seq > ? ORDER BY seq", (base,)):
        count += 1
        if row[0] != count:
            return verdict(f"row {count} is missing")
        last = file.chained(last, count, row[1:-1])
        if last != row[-1]:
            return verdict(f"row {count} was changed, or one before it was taken out or put in")
        known = anchors.get(count)
        if known is not None and known.hash != last:
            return verdict(f"event {count} is another one than on {known.utc}")
        found += known is not None
        written_down = written_down or row[-2] == said
    wrong = _end(rows, anchors, count, last)
    if not (wrong or written_down):
        wrong = f"rows up to {base} were removed, and no event records it"
    return verdict(wrong)


def _end(rows: _Rows, anchors: dict[int, Anchor], count: int, last: str) -> str:
    """Check the end; return what is wrong with it, or ""."""
    head = next(iter(rows("SELECT seq, hash FROM head", ())), None)
    if head != (count, last):
        return f"the end is missing: {count} rows, {head[0] if head else 'none'} were written"
    for each in anchors.values():
        if each.seq > count:
            return f"the end is missing: {count} rows, event {each.seq} was there on {each.utc}"
    return ""


@contextmanager
def _reading(directory: Path) -> Iterator[_Rows]:
    """Open the journal for reading: `rows(query, values)` yields tuples."""
    path = directory / file.FILE
    if not path.is_file():
        raise DeviceError(f"{path}: there is no journal yet")

    def rows(query: str, values: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
        try:
            yield from db.execute(query, values)
        except (sqlite3.Error, ValueError) as fault:
            raise file.Damaged(f"{path}: {fault}") from fault

    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as db:
            # One transaction, so that the writer changes nothing under the reader.
            db.execute("BEGIN")
            yield rows
    except sqlite3.Error as fault:
        raise DeviceError(f"{path}: {fault}") from fault


def _entry(row: tuple[Any, ...]) -> Entry:
    return Entry(row[0], dict(zip(file.FIELDS, row[1:-1], strict=True)), row[-1])
