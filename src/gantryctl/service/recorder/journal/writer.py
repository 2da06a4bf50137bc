"""The one writer of the journal: keeps events, their mirrors and anchors, and tells what is not as it was left."""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.errors import DeviceError
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.recorder.journal import file
from gantryctl.service.recorder.journal.chain import Anchor, chained, content_of, sealed
from gantryctl.service.recorder.journal.key import keep_key, made_key
from gantryctl.service.recorder.journal.mirror import Mirror, Newest, OpenFile, SystemFile
from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.recorder.journal.proof import Fault, judge, kept_anchors, rows_of
from gantryctl.service.recorder.journal.watch import Change, Changed, FileWatch

# Events that stay whatever their age and size: the last runs can always be read.
KEPT_LEAST: Final = 1000
# Events taken out in one commit: no longer than a second.
PRUNED_MOST: Final = 20_000
# Events whose chain is checked when a journal is opened; `verify` checks all.
_TAIL: Final = 10_000
# What was committed goes from the log of SQLite into its database after so long at most.
_SETTLE_S: Final = 1.0


class JournalFault(DeviceError):
    """The journal cannot keep events now: disk full, read-only, failing.

    Attributes:
        damaged: the database itself is at fault: opened anew, it is moved aside.
    """

    def __init__(self, text: str, *, damaged: bool = False) -> None:
        super().__init__(text)
        self.damaged = damaged


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


class Journal:
    """The journal of a machine's state directory.

    One that is damaged, short or another one than was left is moved aside and a new one begun: nothing is ever
    repaired. The first event of the new one says it, and locks the journal until service has acknowledged it.

    Attributes:
        moved_aside: where the old one went, or None.

    Args:
        connect: opens the database, in autocommit; a test puts a failing file system under it.
        opened: opens a mirror, likewise.

    Raises:
        JournalFault: the directory or the key cannot be used.
    """

    def __init__(
        self,
        directory: Path,
        connect: Callable[[Path], sqlite3.Connection] | None = None,
        opened: Callable[[Path], OpenFile] = SystemFile,
    ) -> None:
        self.places = places_of(directory)
        self.path, self._connect = self.places.database, connect or file.connect
        self.moved_aside: Path | None = None
        try:
            self.places.directory.mkdir(parents=True, exist_ok=True)
            self._key = made_key(self.places.key)
            self.places.outside.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._mirrors = [Mirror(path, self._key, opened) for path in self.places.mirrors]
            self._anchors = kept_anchors(self.places.anchors)
            self._begin()
        except (DeviceError, sqlite3.Error, OSError) as fault:
            raise JournalFault(f"{self.path}: {fault}") from fault

    # --- opening ----------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Open the journal, or a new one behind one that is not as it was left."""
        known = [mirror.shown.newest.anchor for mirror in self._mirrors if mirror.shown.newest is not None]
        known = known or self._anchors[-1:]
        last = max(known, key=lambda each: each.seq, default=None)
        if not self.path.exists() or not self.path.stat().st_size:
            # Leftovers beside a database that is gone would be removed by SQLite: they are evidence.
            if any(self.path.with_name(self.path.name + ending).exists() for ending in file.BESIDE):
                self.moved_aside = file.move_aside(self.path, "left")
            self._db = file.open_file(self.path, self._connect, self._key)
            fault, wrong = Fault.SHORT if last is not None and last.seq else Fault.NONE, ""
        else:
            fault, wrong = self._opened(known)
        self._take_up()
        if fault is Fault.DAMAGED and self.moved_aside is not None:
            self._tell(Code.JRN_05, wrong, file=self.moved_aside.name)
        elif fault is not Fault.NONE:
            self._tell(Code.JRN_04, wrong, reason=self._what_is_missing(last))
        elif self._seq:
            self._look_at_mirrors()
        self.reflect()
        self._watch = self._new_watch()
        self._told: set[Changed] = set()
        self._settled_s, self._unsettled = time.monotonic(), True

    def _opened(self, known: Sequence[Anchor]) -> tuple[Fault, str]:
        """Open the file that is there; move it aside when it is not what it should be, and open a new one.

        Returns what was wrong with it, as a value and in words.
        """
        fault, wrong = Fault.DAMAGED, ""
        try:
            self._db = file.open_file(self.path, self._connect, self._key)
            try:
                verdict = judge(
                    rows_of(self._db, self.path), self.path, self._key, known, self._anchors, _TAIL
                )
                fault, wrong = verdict.fault, verdict.wrong
                empty = self._db.execute("SELECT seq FROM head").fetchone() == (0,)
            except BaseException:
                self._db.close()
                raise
            # An empty one has nothing to say: it was begun in place of another one, and not got far.
            if fault is Fault.NONE or (empty and fault is not Fault.DAMAGED):
                return fault, wrong
            self._db.close()
        except (file.Damaged, *file.FAULTS) as found:
            if not isinstance(found, file.Damaged) and not file.is_damage(found):
                raise
            wrong = str(found)
        self.moved_aside = file.move_aside(self.path, "damaged" if fault is Fault.DAMAGED else "short")
        self._db = file.open_file(self.path, self._connect, self._key)
        return fault, wrong

    def _take_up(self) -> None:
        """Go on where the journal ends."""
        self._name = str(self._db.execute("SELECT name FROM journal").fetchone()[0])
        self._seq, self._hash = self._db.execute("SELECT seq, hash FROM head").fetchone()
        newest = self._db.execute("SELECT utc FROM events WHERE seq = ?", (self._seq,)).fetchone()
        self._utc = str(newest[0]) if newest else ""
        self._boot, self._numbers = -1, dict[int, int]()
        shown = [mirror.shown.newest for mirror in self._mirrors if mirror.shown.newest is not None]
        mine = [each for each in shown if each.anchor.journal == self._name]
        latest = max(mine, key=lambda each: each.anchor.seq, default=None)
        self._lock, after = (0, 0) if latest is None else (latest.lock, latest.anchor.seq)
        # What was committed after the mirror was written.
        for row in self._db.execute(f"{file.SELECT} WHERE seq > ? ORDER BY seq", (after,)):
            self._lock = file.lock_after(self._lock, row[0], row[1:-2])
        self._mirrored = -1

    def _what_is_missing(self, last: Anchor | None) -> Any:
        assert last is not None
        if self.moved_aside is None:
            return Words.JOURNAL_GONE(number=last.seq, when=last.utc)
        return Words.JOURNAL_SHORT(number=last.seq, when=last.utc, file=self.moved_aside.name)

    def _look_at_mirrors(self) -> None:
        for mirror in self._mirrors:
            if mirror.shown.newest is None:
                self._tell(Code.JRN_07, reason=Words.MIRROR_GONE(file=str(mirror.path)))
            elif mirror.shown.damaged:
                # As a power cut leaves it: the other copy has shown that nothing is missing.
                self.note(
                    "service", f"{mirror.path}: one of two copies was torn or changed, the other one was used"
                )

    # --- events -----------------------------------------------------------------------------------

    @property
    def locked(self) -> bool:
        """Whether something was found that service has not acknowledged yet, or that lasts."""
        return self._lock > 0 or any(each.change is Change.MOVED for each in self._told)

    def append(self, boot: int, source: int, first: int, records: Sequence[bytes | None]) -> None:
        """Keep one batch, as `append_all`."""
        self.append_all(boot, [Batch(source, first, records)])

    def append_all(self, boot: int, batches: Sequence[Batch]) -> None:
        """Keep events in one commit: they are on the disk when this returns. Those that are there already are left out.

        Args:
            boot: number of this start of the service.

        Raises:
            JournalFault: not all of it was kept for certain; given again, nothing of it is kept twice.
        """
        if boot != self._boot:
            try:
                self._numbers, self._boot = file.numbers_of(self._db, boot), boot
            except sqlite3.Error as fault:
                raise self._failed(fault) from fault
        self._keep(
            [
                file.row_of(boot, batch.source, number, record)
                for batch in batches
                for number, record in enumerate(batch.records, batch.first)
                if number > self._numbers.get(batch.source, 0)
            ]
        )
        for batch in batches:
            last = batch.first + len(batch.records) - 1
            self._numbers[batch.source] = max(self._numbers.get(batch.source, 0), last)
        self.reflect()

    def note(self, kind: str, text: str, **values: object) -> None:
        """Keep an event of the recorder itself; like every event it counts as kept after `reflect`."""
        self._keep([file.own_row(kind, text, **values)])

    def _tell(self, code: Code, wrong: str = "", **values: object) -> None:
        """Keep an alarm that locks the journal until service has acknowledged it; `wrong` goes into its detail."""
        self.note("alarm", refusal(code, **values).line, code=str(code), lock=True, wrong=wrong)

    def _keep(self, new: Sequence[tuple[Any, ...]], *more: tuple[str, tuple[Any, ...]]) -> None:
        """Commit new rows, and other changes with them."""
        seq, last, utc, lock = self._seq, self._hash, self._utc, self._lock
        if not new:
            return
        try:
            with self._db:  # commits, or rolls back
                self._db.execute("BEGIN IMMEDIATE")
                for values in new:
                    seq += 1
                    content = content_of(seq, values)
                    last = chained(last, content)
                    self._db.execute(
                        file.INSERT, (seq, *values, last, sealed(self._key, self._name, last, content))
                    )
                    utc, lock = str(values[3]), file.lock_after(lock, seq, values)
                self._db.execute("UPDATE head SET seq = ?, hash = ?", (seq, last))
                for query, parts in more:
                    self._db.execute(query, parts)
        except sqlite3.Error as fault:
            raise self._failed(fault) from fault
        self._seq, self._hash, self._utc, self._lock = seq, last, utc, lock
        self._unsettled = True

    def _failed(self, fault: sqlite3.Error) -> JournalFault:
        return JournalFault(f"{self.path}: {fault}", damaged=file.is_damage(fault))

    def reflect(self) -> None:
        """Write the newest event into both mirrors: before that no event counts as kept.

        Raises:
            JournalFault: a mirror cannot be written.
        """
        if self._mirrored == self._seq:
            return
        newest = Newest(self.newest, self._lock)
        for mirror in self._mirrors:
            try:
                mirror.write(newest)
            except (OSError, DeviceError) as fault:
                raise JournalFault(f"{mirror.path}: {fault}") from fault
        self._mirrored = self._seq

    def prune(self, days: int, bytes_max: int) -> int:
        """Remove the oldest events, and write which, with their hash, in the same commit; return how many.

        The newest `KEPT_LEAST` stay, whatever the limits; one call takes `PRUNED_MOST` at most.

        Args:
            days: events go that are older than so many dates of daily anchors; 0 for no limit.
            bytes_max: what the events may occupy. The file does not shrink: its room is used again.

        Raises:
            JournalFault: nothing was changed.
        """
        db, head = self._db, self._seq
        try:
            base = db.execute("SELECT seq FROM base").fetchone()[0]
            upto = max(self._older(days) if days else base, file.surplus(db, bytes_max, base, head))
            upto = min(upto, head - KEPT_LEAST, base + PRUNED_MOST)
            if upto <= base:
                return 0
            last = db.execute("SELECT hash FROM events WHERE seq = ?", (upto,)).fetchone()[0]
        except sqlite3.Error as fault:
            raise self._failed(fault) from fault
        # Decision 0011: what is taken out stays provable. The chain begins at the hash that this event keeps.
        text = f"events {base + 1} to {upto} were taken out by age or size"
        self._keep(
            [file.own_row("journal", text, base=upto, hash=last)],
            ("DELETE FROM events WHERE seq <= ?", (upto,)),
            ("UPDATE base SET seq = ?, hash = ?", (upto, last)),
        )
        self.reflect()
        return int(upto - base)

    def _older(self, days: int) -> int:
        """Find the last event with so many dates of anchors behind it; 0 where there are not so many."""
        # By the order of the anchors and not by the clock: one that was stepped ahead by a year is one date.
        dates: set[str] = set()
        for each in sorted(
            (anchor for anchor in self._anchors if anchor.journal == self._name), reverse=True
        ):
            dates.add(each.utc[:10])
            if len(dates) > days:
                return each.seq
        return 0

    # --- what proves it ---------------------------------------------------------------------------

    @property
    def newest(self) -> Anchor:
        """Number and hash of the newest event."""
        return Anchor(self._seq, self._hash, self._utc, self._name)

    def anchor(self) -> Anchor | None:
        """Add a line for the newest event to those outside the state directory; None where it has one already.

        Raises:
            JournalFault: the disk does not take it.
        """
        newest = self.newest
        if not newest.seq or self._anchors[-1:] == [newest]:
            return None
        try:
            self._write_anchors([newest])
        except OSError as fault:
            raise JournalFault(f"{self.places.anchors}: {fault.strerror or fault}") from fault
        self._anchors.append(newest)
        self._watch.add(self.places.anchors)
        return newest

    def _write_anchors(self, anchors: Sequence[Anchor]) -> None:
        handle = os.open(self.places.anchors, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o600)
        with os.fdopen(handle, "ab") as lines:
            # A line of its own, also behind one that a power cut has torn.
            lines.write("".join(f"\n{each.line}\n" for each in anchors).encode())
            lines.flush()
            os.fsync(lines.fileno())

    def settle(self) -> None:
        """Bring what was committed from the log of SQLite into its database, a second after the last time.

        A damaged bit in the log takes all events behind it along; in the database a few.
        """
        now_s = time.monotonic()
        if not self._unsettled or now_s < self._settled_s + _SETTLE_S:
            return
        self._settled_s, self._unsettled = now_s, False
        try:
            self._db.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
        except sqlite3.Error as fault:
            raise self._failed(fault) from fault

    def look(self) -> None:
        """Look whether the files still have their names, and no second one; what is gone is written anew.

        Raises:
            JournalFault: it cannot be written anew.
        """
        found = set(self._watch.look())
        self._told &= found
        new = found - self._told
        if not new:
            return
        gone = [each.path for each in new if each.change in (Change.GONE, Change.CUT)]
        if any(each.change is Change.CUT and each.path.name.startswith(self.path.name) for each in new):
            raise JournalFault(f"{self.path}: was cut while it was in use", damaged=True)
        if gone:
            self._write_anew(gone)
        self._told |= new
        for path in gone:
            self._tell(Code.JRN_07, reason=Words.FILE_REPLACED(file=str(path)))
        for each in new:
            if each.change is Change.LINKED:
                self._tell(Code.JRN_07, reason=Words.FILE_LINKED(file=str(each.path)))
            elif each.change is Change.MOVED:
                self._tell(Code.JRN_07, reason=Words.DIRECTORY_MOVED(file=str(each.path)))

    def _write_anew(self, gone: Sequence[Path]) -> None:
        """Put files in the place of those whose names are gone: all that they held is still open here."""
        try:
            self.places.directory.mkdir(parents=True, exist_ok=True)
            self.places.outside.mkdir(mode=0o700, parents=True, exist_ok=True)
            if self.places.key in gone:
                self.places.key.unlink(missing_ok=True)
                keep_key(self.places.key, self._key)
            if self.places.anchors in gone:
                self.places.anchors.unlink(missing_ok=True)
                self._write_anchors(self._anchors)
            for mirror in self._mirrors:
                if mirror.path in gone:
                    mirror.path.unlink(missing_ok=True)
                mirror.close()
            if any(path.name.startswith(self.path.name) for path in gone):
                self._write_events_anew()
            self._watch.close()
            self._mirrored = -1
            self.reflect()
            self._watch = self._new_watch()
        except (DeviceError, sqlite3.Error, OSError) as fault:
            raise JournalFault(f"{self.path}: {fault}") from fault

    def _write_events_anew(self) -> None:
        draft = self.path.with_name(f"{self.path.name}.part")
        draft.unlink(missing_ok=True)
        with closing(file.connect(draft)) as made:
            self._db.backup(made)
        # Closed first: SQLite removes the log by its name.
        self._db.close()
        file.move_aside(self.path, "foreign")
        draft.replace(self.path)
        self._db = file.open_file(self.path, self._connect, self._key)

    def _new_watch(self) -> FileWatch:
        beside = [self.path.with_name(self.path.name + ending) for ending in file.BESIDE]
        beyond = [*self.places.mirrors, self.places.key, self.places.anchors]
        return FileWatch(self.places.directory, [self.path, *beside, *beyond])

    def close(self) -> None:
        """Close the files."""
        self._watch.close()
        for mirror in self._mirrors:
            mirror.close()
        self._db.close()
