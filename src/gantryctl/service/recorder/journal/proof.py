"""Checks a journal: which events are certain, which were changed, which are missing."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from enum import Enum
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

from gantryctl.errors import DeviceError, UsageError
from gantryctl.service.recorder.journal.chain import (
    Anchor,
    anchors_in,
    chained,
    content_of,
    first_hash,
    of_journal,
    sealed,
)
from gantryctl.service.recorder.journal.file import (
    BESIDE,
    FAULTS,
    SELECT,
    Damaged,
    check_tables,
    is_damage,
)
from gantryctl.service.recorder.journal.key import Key, read_key
from gantryctl.service.recorder.journal.mirror import read_mirror
from gantryctl.service.recorder.journal.places import places_of

Rows: TypeAlias = Callable[[str, tuple[Any, ...]], Iterator[tuple[Any, ...]]]
# No event is shorter: a number that a damaged file gives for its end is not believed beyond that.
_ROW_BYTES: Final = 150


class Fault(Enum):
    """What is wrong with a journal."""

    NONE = "none"
    DAMAGED = "damaged"
    """Events were changed, or the file is damaged."""
    SHORT = "short"
    """It is whole, but newer events were there."""
    OTHER = "other"
    """It is whole, but another one was there."""


class Span(NamedTuple):
    """Numbers of events, both ends among them."""

    first: int
    last: int

    def __str__(self) -> str:
        return str(self.first) if self.first == self.last else f"{self.first} to {self.last}"


class Verdict(NamedTuple):
    """The result of `verify`.

    Attributes:
        rows: how many events are certain.
        wrong: the first thing that is wrong, or "".
        first: number of the first event; above 1 when older ones were taken out by age or size.
        anchors: how many of the anchors given were found in the chain.
        fault: what is wrong, as a value.
        certain: events that are there as they were written.
        changed: events that are there, and not as they were written, or it cannot be told.
        missing: events that were written, and are not there or cannot be read.
        sealed: whether the seals were checked, too.
    """

    rows: int
    wrong: str
    first: int = 1
    anchors: int = 0
    fault: Fault = Fault.NONE
    certain: tuple[Span, ...] = ()
    changed: tuple[Span, ...] = ()
    missing: tuple[Span, ...] = ()
    sealed: bool = False


def verify(
    directory: Path,
    anchors: Sequence[Anchor] = (),
    newest: int = 0,
    *,
    key: Key | None = None,
    keyed: bool = True,
) -> Verdict:
    """Check the journal of a machine: every event, its hash and seal, and its end against mirrors and daily anchors.

    Args:
        anchors: events that must be in it as they were. Those from before its first one are not looked for.
        newest: check only so many, for a quick start; 0 for all.
        key: instead of the one in its place. keyed: with False the seals are not checked, and no key is needed.

    Raises:
        UsageError: there is no journal and never was one. DeviceError: the key cannot be read.
    """
    places = places_of(directory)
    if key is None and keyed and (places.key.exists() or places.database.exists()):
        key = read_key(places.key)
    try:
        # Read before the events: the writer goes on meanwhile, and a mirror is never ahead of them.
        shown = [read_mirror(path, key).newest for path in places.mirrors]
        known = [each.anchor for each in shown if each is not None]
        daily = kept_anchors(places.anchors)
    except OSError as fault:
        raise DeviceError(f"{places.outside}: {fault.strerror or fault}") from fault
    if not known:
        known = daily[-1:]
    if not places.database.is_file():
        last = max(known, key=lambda each: each.seq, default=None)
        if last is None or not last.seq:
            raise UsageError(f"{places.database}: there is no journal yet; `gantryctl serve` begins one")
        wrong = f"the journal is gone: event {last.seq} was there on {last.utc}"
        return Verdict(0, wrong, fault=Fault.SHORT, missing=(Span(1, last.seq),))
    return verify_file(places.database, key, known, [*daily, *anchors], newest, given=anchors)


def verify_file(
    path: Path,
    key: Key | None,
    known: Sequence[Anchor] = (),
    anchors: Sequence[Anchor] = (),
    newest: int = 0,
    given: Sequence[Anchor] = (),
) -> Verdict:
    """Check the file of a journal, or of a copy.

    Args:
        key: seals are checked with it.
        known: what its newest event was when somebody looked last: it must be of this very journal.
        anchors: those of this journal must be in it; of the `given` ones the last must be of this journal.

    Raises:
        DeviceError: it cannot be opened.
    """
    try:
        with reading(path) as rows:
            check = _Check(rows, key, path)
            return check.run(known, anchors, newest, given)
    except Damaged as fault:
        last = max((each.seq for each in known), default=0)
        return Verdict(0, str(fault), fault=Fault.DAMAGED, missing=_missing(last), sealed=key is not None)


def judge(
    rows: Rows, path: Path, key: Key, known: Sequence[Anchor], anchors: Sequence[Anchor], newest: int
) -> Verdict:
    """Check a journal that is open already; Damaged where it cannot be read at all."""
    return _Check(rows, key, path).run(known, anchors, newest, ())


def kept_anchors(path: Path) -> list[Anchor]:
    """Read the daily anchors, without lines that are not anchors; OSError when they are there and cannot be read."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return []
    found: list[Anchor] = []
    for line in lines:
        # A line that a power cut has torn proves nothing; the others do.
        try:
            found += anchors_in(line)
        except ValueError:
            continue
    return found


def _missing(last: int) -> tuple[Span, ...]:
    return (Span(1, last),) if last else ()


class _Spans:
    """Numbers that come in order, as spans."""

    def __init__(self) -> None:
        self._found: list[Span] = []
        self.count = 0

    def add(self, first: int, last: int) -> None:
        if last < first:
            return
        self.count += last - first + 1
        if self._found and self._found[-1].last == first - 1:
            first = self._found.pop().first
        self._found.append(Span(first, last))

    def all(self) -> tuple[Span, ...]:
        return tuple(self._found)


class _Check:
    """One pass over the events of a file."""

    def __init__(self, rows: Rows, key: Key | None, path: Path) -> None:
        self._rows, self._key, self._path = rows, key, path
        self.certain, self.changed, self.missing = _Spans(), _Spans(), _Spans()
        self.wrong, self.fault = "", Fault.NONE
        check_tables(lambda query: list(rows(query, ())))
        self._journal, key_name = self._one("SELECT name, key FROM journal", str)
        self._base, self._base_hash = self._one("SELECT seq, hash FROM base", int)
        self._head, self._head_hash = self._one("SELECT seq, hash FROM head", int)
        if key is not None and key_name != key.name:
            self._tell("it is sealed with another key")

    def _one(self, query: str, kind: type[int] | type[str]) -> tuple[Any, str]:
        row = next(self._rows(query, ()), (None, None))
        if not (isinstance(row[0], kind) and isinstance(row[1], str)):
            raise Damaged("what is not an event of it cannot be read")
        return row[0], row[1]

    def _tell(self, wrong: str, fault: Fault = Fault.DAMAGED) -> None:
        """Note what is wrong; the first counts, and damage more than an end that is missing."""
        if not self.wrong:
            self.wrong, self.fault = wrong, fault

    def run(
        self, known: Sequence[Anchor], anchors: Sequence[Anchor], newest: int, given: Sequence[Anchor]
    ) -> Verdict:
        """Check everything."""
        base, last = self._begin(newest)
        mine = of_journal([*anchors, *known], self._journal)
        mine_given = of_journal(given, self._journal)
        count, certain, found = base, True, 0
        self._compare(base, last, mine)
        for seq, row in self._in_order(base, max([self._head, *mine])):
            if seq > count + 1:
                self.missing.add(count + 1, seq - 1)
                self._tell(f"row {count + 1} is missing")
                certain = False
            count = seq
            certain = self._judge(row, last, self._compare(seq, row[-2], mine), certain)
            found += len(mine_given.get(seq, ())) if certain else 0
            last = row[-2]
        self._end(count, last, mine, known)
        if given and given[-1].journal != self._journal:
            self._tell("the last of the anchors given is of another journal", Fault.OTHER)
        return Verdict(
            self.certain.count, self.wrong, base + 1, found, self.fault,
            self.certain.all(), self.changed.all(), self.missing.all(), self._key is not None,
        )  # fmt: skip

    def _begin(self, newest: int) -> tuple[int, str]:
        """Number and hash before the first row to be judged."""
        if newest:
            before = "SELECT seq, hash FROM events WHERE seq = (SELECT seq FROM head) - ?"
            for seq, digest in self._rows(before, (newest,)):
                return seq, digest
        start = first_hash(self._journal)
        if self._base == 0 and self._base_hash != start:
            self._tell("its name is not the one it began with")
        if self._base == 0:
            return 0, start
        said = json.dumps({"base": self._base, "hash": self._base_hash})
        if next(self._rows("SELECT 1 FROM events WHERE detail = ?", (said,)), None) is None:
            # Then nothing says that less than everything must be there.
            self._tell(f"rows up to {self._base} were removed, and no event records it")
            return 0, start
        return self._base, self._base_hash

    def _bytes(self) -> int:
        sizes = (self._path.with_name(self._path.name + ending) for ending in ("", *BESIDE[:1]))
        return sum(path.stat().st_size for path in sizes if path.exists())

    def _in_order(self, base: int, end: int) -> Iterator[tuple[int, tuple[Any, ...]]]:
        """Give the rows behind the base with their numbers, those up to `end` also from a damaged file."""
        count = base
        try:
            for row in self._rows(f"{SELECT} WHERE seq > ? ORDER BY seq", (base,)):
                if row[0] != count + 1:
                    break
                count += 1
                yield count, row
        except Damaged as fault:
            self._tell(str(fault))
        # From here on one by one: a damaged page takes its own events along, not those behind it.
        for seq in range(count + 1, min(end, base + self._bytes() // _ROW_BYTES) + 1):
            try:
                for row in self._rows(f"{SELECT} WHERE seq = ?", (seq,)):
                    yield seq, row
            except Damaged as fault:
                self._tell(str(fault))

    def _compare(self, seq: int, digest: str, mine: dict[int, list[Anchor]]) -> bool:
        """Compare an event with the anchors of its number."""
        for each in mine.get(seq, ()):
            if each.hash != digest:
                self._tell(f"event {seq} is another one than on {each.utc}")
                return False
        return True

    def _judge(self, row: tuple[Any, ...], before: str, known: bool, sure: bool) -> bool:
        """Judge one row behind the hash before; True when it is certain.

        Args:
            known: no anchor says anything else. sure: the row before is certain.
        """
        seq, digest, seal = row[0], row[-2], row[-1]
        try:
            content = content_of(seq, row[1:-2])
            linked = chained(before, content) == digest
            right = linked if self._key is None else seal == sealed(self._key, self._journal, digest, content)
        except (TypeError, ValueError, AttributeError):
            linked = right = False
        # A row that was sealed is certain by itself, unless the row before is as certain and does not lead to it.
        certain = right and known and (linked or not sure)
        if not linked:
            self._tell(f"row {seq} was changed, or one before it was taken out or put in")
        elif not right:
            self._tell(f"row {seq} was not sealed with the key of this journal")
        (self.certain if certain else self.changed).add(seq, seq)
        return certain

    def _end(self, count: int, last: str, mine: dict[int, list[Anchor]], known: Sequence[Anchor]) -> None:
        """Check the end of the chain."""
        later = max((seq for seq in mine if seq > count), default=0)
        if (self._head, self._head_hash) != (count, last):
            self._tell(f"the end is missing: {count} rows, {self._head} were written")
        if later:
            utc = mine[later][0].utc
            self._tell(f"the end is missing: {count} rows, event {later} was there on {utc}", Fault.SHORT)
        self.missing.add(count + 1, max(later, min(self._head, count + self._bytes() // _ROW_BYTES)))
        for each in known:
            if each.journal != self._journal and each.seq:
                self._tell(f"it is another journal than on {each.utc}", Fault.OTHER)


@contextmanager
def reading(path: Path) -> Iterator[Rows]:
    """Open a journal for reading: `rows(query, values)` yields tuples, and Damaged is raised for what cannot be read.

    Raises:
        UsageError: there is none. DeviceError: it cannot be opened.
    """
    if not path.is_file():
        raise UsageError(f"{path}: there is no journal yet; `gantryctl serve` begins one")
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as db:
            # One transaction, so that the writer changes nothing under the reader.
            db.execute("BEGIN")
            yield rows_of(db, path)
    except sqlite3.Error as fault:
        raise DeviceError(f"{path}: {fault}") from fault


def rows_of(db: Any, path: Path) -> Rows:
    """Make the function that reads rows of a connection."""

    def rows(query: str, values: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
        try:
            found: Iterable[tuple[Any, ...]] = db.execute(query, values)
            for row in found:
                yield tuple(row)
        except FAULTS as fault:
            kind = Damaged if is_damage(fault) else DeviceError
            raise kind(f"{path.name}: {fault}") from fault

    return rows
