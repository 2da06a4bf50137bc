"""A drift file: what changes on a machine after it was identified, row by row; read, or refused with its problems."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from gantryctl.errors import ConfigError, UsageError
from gantryctl.machine import Machine, configs_folder, field_specs, show_value, with_values
from gantryctl.machine.loading import check_table
from gantryctl.machine.problems import unknown_path
from gantryctl.machine.reading import parse_toml, printable, read_text
from gantryctl.machine.specs import Value, value_at
from gantryctl.machine.tables.fields import Table, table, text

ROWS_MAX: Final = 200
_PLANT: Final = "plant."
_HOW: Final = ("set", "times", "plus")
_NO_SUCH: Final = "; a delivered drift file goes by its name: "


class DriftTable(Table):
    """[drift]: the file as a whole."""

    name: str = text("", 64, "Short name.")
    description: str = text("", 300, "One line for people.")


class _Head(Table):
    drift: DriftTable = table("The file as a whole.", DriftTable)


@dataclass(frozen=True)
class Change:
    """What becomes of one key of [plant].

    Attributes:
        how: "set" puts the value there; "times" multiplies by it, "plus" adds it.
    """

    path: str
    how: str
    value: Value

    def of(self, present: Value) -> Value:
        """The value afterwards."""
        if self.how == "set":
            return self.value
        assert isinstance(present, int | float)
        assert isinstance(self.value, int | float)
        return present * self.value if self.how == "times" else present + self.value


@dataclass(frozen=True)
class DriftRow:
    """One way in which a machine changes; its changes are made one after the other."""

    name: str
    meaning: str
    changes: tuple[Change, ...]

    def on(self, machine: Machine) -> Machine:
        """The machine afterwards, with the calibration that it had before.

        Raises:
            ConfigError: a value is beyond the limits of its key, or the machine contradicts itself.
        """
        values: dict[str, Value] = {}
        for change in self.changes:
            values[change.path] = change.of(values.get(change.path, value_at(machine, change.path)))
        return with_values(machine, values)


@dataclass(frozen=True)
class Drift:
    """A drift file.

    Attributes:
        on_top_of: names of the rows that every other row has too.
    """

    name: str
    description: str
    rows: tuple[DriftRow, ...]
    on_top_of: tuple[str, ...] = ()

    def on_top(self, names: Sequence[str]) -> Drift:
        """Every row on top of these: their changes first, then its own; a row that has them already stays.

        Raises:
            UsageError: a name is no row of the file.
        """
        known = {row.name: row for row in self.rows}
        for name in (name for name in names if name not in known):
            raise UsageError(
                f"--on-top {show_value(name)}: is no row of {self.name}: {', '.join(known)}{_near(name, known)}"
            )
        below = tuple(dict.fromkeys(change for name in names for change in known[name].changes))
        rows = tuple(
            replace(row, changes=(*(each for each in below if each not in row.changes), *row.changes))
            for row in self.rows
        )
        return replace(self, rows=rows, on_top_of=tuple(names))


def drifts_folder() -> Path:
    """Folder of the drift files that are delivered."""
    return configs_folder() / "drifts"


def load_drift(path: Path | str, machine: Machine) -> Drift:
    """Read and check a drift file, or a delivered one by its name.

    Args:
        machine: whose values "times" and "plus" start from.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    path = Path(path)
    delivered = tuple(sorted(file.stem for file in drifts_folder().glob("*.toml")))
    if not path.exists() and str(path) in delivered:
        path = drifts_folder() / f"{path.name}.toml"
    return parse_drift(read_text(path, _NO_SUCH + ", ".join(delivered)), str(path), machine)


def parse_drift(content: str, name: str, machine: Machine) -> Drift:
    """Check the text of a drift file; `name` stands in front of every problem.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    data = parse_toml(content, name)
    rows = data.pop("row", {})
    head = check_table(_Head, data, name).drift
    reader = _Reader(printable(name, 300), machine)
    found = reader.rows(rows)
    if reader.problems:
        raise ConfigError(reader.problems)
    return Drift(head.name or Path(name).stem, head.description, found)


class _Reader:
    """Collects the problems of one file."""

    def __init__(self, name: str, machine: Machine) -> None:
        self._name, self._machine = name, machine
        self.problems: list[str] = []

    def rows(self, data: Any) -> tuple[DriftRow, ...]:
        if not isinstance(data, dict):
            self._say(f"row = {show_value(data)}: must be tables [row.NAME]")
            return ()
        if not data:
            self._say("has no rows; give at least one table [row.NAME] with what changes")
        if len(data) > ROWS_MAX:
            self._say(f"has {len(data)} rows, allowed {ROWS_MAX}")
            return ()
        own = {name: self._own(name, row) for name, row in data.items()}
        found = tuple(self._row(name, row, own) for name, row in data.items())
        for row in found if not self.problems else ():
            try:
                row.on(self._machine)
            except ConfigError as wrong:
                self.problems += [
                    f"{self._place(row.name)}: {line.partition(': ')[2]}" for line in wrong.problems
                ]
        return found

    def _say(self, line: str) -> None:
        self.problems.append(f"{self._name}: {line}")

    def _place(self, row: str) -> str:
        return f"{self._name}: [row.{printable(row)}]"

    def _own(self, name: str, row: Any) -> tuple[Change, ...]:
        """Changes that stand in a row itself."""
        if not isinstance(row, dict):
            self._say(f"[row] {printable(name)} = {show_value(row)}: must be a table [row.{printable(name)}]")
            return ()
        allowed = ("meaning", "together", *_HOW)
        for key in (key for key in row if key not in allowed):
            self.problems.append(
                f"{self._place(name)} {printable(key)}: is not one of {', '.join(allowed)}{_near(key, allowed)}"
            )
        if not isinstance(row.get("meaning", ""), str):
            self.problems.append(
                f"{self._place(name)} meaning = {show_value(row['meaning'])}: must be text in quotes"
            )
        return tuple(
            change
            for how in _HOW
            for path, value in _flat(row.get(how, {}))
            if (change := self._change(name, how, path, value)) is not None
        )

    def _row(self, name: str, row: Any, own: Mapping[str, tuple[Change, ...]]) -> DriftRow:
        meaning = row.get("meaning", name) if isinstance(row, dict) else name
        together = row.get("together") if isinstance(row, dict) else None
        changes = own[name]
        if together is not None:
            changes = self._together(name, together, own)
        elif not changes and not self.problems:
            self.problems.append(
                f"{self._place(name)}: changes nothing; give keys of [plant] in set, times or plus, or other rows in "
                "together"
            )
        return DriftRow(name, str(meaning), changes)

    def _together(self, name: str, names: Any, own: Mapping[str, tuple[Change, ...]]) -> tuple[Change, ...]:
        place = f"{self._place(name)} together"
        if own[name]:
            self.problems.append(f"{place}: a row either changes keys itself or takes other rows together")
        if not isinstance(names, list) or not all(isinstance(each, str) for each in names) or len(names) < 2:
            self.problems.append(f"{place} = {show_value(names)}: must be the names of at least two rows")
            return ()
        singles = [each for each in own if own[each]]
        for each in (each for each in names if each not in singles):
            self.problems.append(
                f"{place}: {show_value(each)} is no row that changes keys itself: {', '.join(singles)}"
                f"{_near(each, singles)}"
            )
        changes = tuple(change for each in names for change in own.get(each, ()))
        for change in (change for change in changes if change.how == "set"):
            if sum(other.path == change.path for other in changes) > 1:
                self.problems.append(
                    f"{place}: two of these rows change {change.path}, and one sets it whatever it was"
                )
                break
        return changes

    def _change(self, row: str, how: str, path: str, value: Any) -> Change | None:
        place, spec = f"{self._place(row)} {how}", field_specs().get(path)
        if spec is None:
            self.problems.append(f"{place}: {unknown_path(path)}")
            return None
        if not path.startswith(_PLANT):
            self.problems.append(f"{place}: {path} is no property of the plant; only keys of [plant] drift")
            return None
        numbers = value if isinstance(value, list) else [value]
        if any(isinstance(each, float) and not math.isfinite(each) for each in numbers):
            self.problems.append(f"{place} {path} = {show_value(value)}: is not a finite number")
            return None
        if how == "set":
            return Change(path, how, tuple(value) if isinstance(value, list) else value)
        present = value_at(self._machine, path)
        if spec.kind != "number" or not isinstance(present, int | float):
            self.problems.append(f"{place} {path}: is no number but takes {spec.allowed}; put it into set")
            return None
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.problems.append(f"{place} {path} = {show_value(value)}: must be a number")
            return None
        if how == "times" and present == 0.0:
            self.problems.append(
                f"{place} {path}: is 0 in {self._machine.name}, and so is every multiple of it; use set or plus"
            )
            return None
        return Change(path, how, float(value))


def _flat(data: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Values of nested tables by dotted path, in the order of the file."""
    if not isinstance(data, dict):
        yield path, data
        return
    for key, value in data.items():
        yield from _flat(value, f"{path}.{key}" if path else key)


def _near(word: str, words: Any) -> str:
    near = difflib.get_close_matches(word, list(words), 1)
    return f"; did you mean {near[0]}?" if near else ""
