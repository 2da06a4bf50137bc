"""Error tables as CSV: reading those of any instrument, writing ours.

Columns, in any order: `base_deg`, `direction` (ccw | cw), `displacement_deg`, `error_deg`, and `run` where a
series was repeated. `chord_mm` may stand in place of `error_deg` when the radius of the target circle is
given: the error is then 2 asin(c / 2R) minus the displacement. Separators may be comma, semicolon or tab; a
decimal comma, a byte order mark, blank and # lines, spaces and capitals in the header, and further columns
do no harm. Everything doubtful is refused, with line, column and value.
"""

from __future__ import annotations

import csv
import io
import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gantryctl.engineering.accuracy.table import Direction, ErrorTable, Layout, RowKey
from gantryctl.errors import UsageError

HEADER = "base_deg,direction,displacement_deg,error_deg"
RIGHT_HEADER = f"{HEADER} (or chord_mm with a radius in place of error_deg; a column run is optional)"
# Problems listed at once.
MAX_PROBLEMS = 20

_KEYS = ("base_deg", "direction", "displacement_deg")
_VALUES = ("error_deg", "chord_mm")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)
_DIRECTIONS = {
    **dict.fromkeys(("ccw", "counter-clockwise", "counterclockwise", "+"), Direction.CCW),
    **dict.fromkeys(("cw", "clockwise", "-"), Direction.CW),
}
# What lies beyond is a wrong unit or a wrong column, not a gantry.
_LIMITS = {"base_deg": 360.0, "displacement_deg": 180.0, "error_deg": 180.0, "chord_mm": 1e6}
# A file may say 0.0 with some digits of rounding behind it.
_ZERO_CHORD_MM = 1e-9


class _Cell(NamedTuple):
    line: int
    row: RowKey
    displacement_deg: float
    error_deg: float


def read_error_table(
    path: str | Path, radius_m: float | None = None, layout: Layout = Layout.APART
) -> ErrorTable:
    """The error table in a file.

    Args:
        path: the CSV file.
        radius_m: radius of the target circle; needed for `chord_mm`, refused as useless with `error_deg`.
        layout: where the stops lay; a file cannot tell (`Layout.RETURN` for a table of procedure C).

    Raises:
        UsageError: the file cannot be read or used; every problem has a line of its own.
    """
    path = Path(path)
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from error
    # Spreadsheets save their Unicode text as UTF-16, which begins with a byte order mark.
    encoding = "utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError as error:
        raise UsageError(
            f"{path}: not a text file (byte {error.start} is no {encoding}); save it as CSV UTF-8"
        ) from None
    return parse_error_table(text, radius_m, layout, name=path.name)


def parse_error_table(
    text: str, radius_m: float | None = None, layout: Layout = Layout.APART, name: str = "table"
) -> ErrorTable:
    """The error table in CSV text; `name` is what messages call it."""
    if radius_m is not None and not (math.isfinite(radius_m) and radius_m > 0.0):
        raise UsageError(f"radius = {radius_m} m: must be above 0")
    return _Reader(name, radius_m, layout).read(text)


def format_error_table(table: ErrorTable) -> str:
    """The table as CSV that `parse_error_table` reads back exactly."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["base_deg", "direction", "run", "displacement_deg", "error_deg"])
    for row, errors in zip(table.rows, table.errors_deg.tolist(), strict=True):
        for displacement, error in zip(table.displacements_deg, errors, strict=True):
            writer.writerow(
                [
                    # 17 significant digits give every double back exactly (IEEE 754).
                    f"{row.base_deg:.17g}",
                    row.direction.value,
                    row.run,
                    f"{displacement:.17g}",
                    f"{error:.17g}",
                ]
            )
    return out.getvalue()


class _Reader:
    """Reader that collects problems, so that one message lists all of them."""

    def __init__(self, name: str, radius_m: float | None, layout: Layout) -> None:
        self.name = name
        self.layout = layout
        self.radius_m = radius_m
        self.problems: list[str] = []

    def read(self, text: str) -> ErrorTable:
        lines = _lines(text)
        separator, header_line, header = self._header(lines)
        records = ((number, _split(line, separator)) for number, line in lines if number > header_line)
        found = [self._cell(number, header, values) for number, values in records]
        cells = [cell for cell in found if cell is not None]
        self._stop_at_problems()
        if not cells:
            raise UsageError(f"{self.name}: no rows below the header")
        return self._table(cells)

    def problem(self, line: int, column: str, value: str, hint: str) -> None:
        self.problems.append(f"{self.name}: line {line}, column {column} = {value[:40]!r}: {hint}")

    def _header(self, lines: list[tuple[int, str]]) -> tuple[str, int, list[str]]:
        if not lines:
            raise UsageError(f"{self.name}: empty; the header is {RIGHT_HEADER}")
        number, first = lines[0]
        # Where the decimal sign is a comma, spreadsheets separate by semicolons.
        separator = max(",;\t", key=first.count)
        header = [cell.strip().lower() for cell in _split(first, separator)]
        wrong = [f"column {key} is missing" for key in _KEYS if key not in header]
        found = [value for value in _VALUES if value in header]
        if len(found) != 1:
            wrong.append(
                "neither error_deg nor chord_mm" if not found else "both error_deg and chord_mm; keep one"
            )
        wrong += [f"column {key} twice" for key in {*_KEYS, *found, "run"} if header.count(key) > 1]
        if wrong:
            raise UsageError(f"{self.name}: line {number}: {'; '.join(wrong)}. The header is {RIGHT_HEADER}")
        if found == ["chord_mm"] and self.radius_m is None:
            raise UsageError(
                f"{self.name}: column chord_mm needs the radius of the target circle (--radius-m)"
            )
        if found == ["error_deg"] and self.radius_m is not None:
            raise UsageError(
                f"{self.name}: a radius is of no use here, column error_deg is an angle; leave --radius-m out"
            )
        return separator, number, header

    def _cell(self, line: int, header: list[str], values: list[str]) -> _Cell | None:
        if len(values) > len(header):
            hint = f"{len(values)} values for {len(header)} columns"
            self.problem(
                line,
                header[-1],
                values[-1],
                f"{hint}; with a decimal comma the separator must be a semicolon",
            )
            return None
        if len(values) < len(header):
            self.problem(line, header[len(values)], "", "missing")
            return None
        by_name = dict(zip(header, (value.strip() for value in values), strict=True))
        base = self._number(line, "base_deg", by_name["base_deg"])
        displacement = self._number(line, "displacement_deg", by_name["displacement_deg"])
        direction = _DIRECTIONS.get(by_name["direction"].lower())
        if direction is None:
            self.problem(line, "direction", by_name["direction"], "must be ccw or cw")
        run = self._run(line, by_name.get("run", "1"))
        error = self._error(line, by_name, displacement)
        if base is None or displacement is None or direction is None or run is None or error is None:
            return None
        return _Cell(line, RowKey(base, direction, run), displacement, error)

    def _number(self, line: int, column: str, value: str) -> float | None:
        # A comma is a decimal comma; with a point beside it (1,234.5) there are two of them, and no number.
        text = value.replace(",", ".")
        if not _NUMBER.fullmatch(text) or not math.isfinite(float(text)):
            self.problem(
                line, column, value, "missing" if not value else "not a number (finite, like -0.0012)"
            )
            return None
        number = float(text)
        if column == "displacement_deg" and not 0.0 <= number < 180.0:
            self.problem(
                line, column, value, "must be 0 .. 180 deg; a displacement has no sign, the direction says it"
            )
            return None
        if abs(number) > _LIMITS[column]:
            self.problem(line, column, value, f"must be within +-{_LIMITS[column]:g}")
            return None
        return number

    def _run(self, line: int, value: str) -> int | None:
        if re.fullmatch(r"[1-9]\d{0,5}", value, re.ASCII):
            return int(value)
        self.problem(line, "run", value, "must be 1, 2, 3 ...")
        return None

    def _error(self, line: int, by_name: dict[str, str], displacement: float | None) -> float | None:
        column = "chord_mm" if "chord_mm" in by_name else "error_deg"
        value = self._number(line, column, by_name[column])
        if value is None or displacement is None:
            return None
        if displacement == 0.0 and abs(value) > _ZERO_CHORD_MM:
            self.problem(
                line, column, by_name[column], "must be 0 at displacement 0, the base is its own reference"
            )
            return None
        if self.radius_m is None or displacement == 0.0:
            return value if displacement else 0.0
        # c = 2 R sin(angle/2), R in m and c in mm.
        diameter = 2000.0 * self.radius_m
        if not 0.0 < value <= diameter:
            self.problem(line, column, by_name[column], f"must be above 0 and at most 2 R = {diameter:g} mm")
            return None
        return math.degrees(2.0 * math.asin(value / diameter)) - displacement

    def _table(self, cells: list[_Cell]) -> ErrorTable:
        columns = sorted({0.0, *(cell.displacement_deg for cell in cells)})
        seen: dict[tuple[RowKey, float], _Cell] = {}
        for cell in cells:
            first = seen.setdefault((cell.row, cell.displacement_deg), cell)
            if first is not cell:
                self.problem(
                    cell.line,
                    "displacement_deg",
                    f"{cell.displacement_deg:g}",
                    f"given before in line {first.line}; repeated series need a column run (1, 2, ...)",
                )
        rows = tuple(dict.fromkeys(cell.row for cell in cells))
        for row in rows:
            missing = [d for d in columns[1:] if (row, d) not in seen]
            if missing:
                where = f"base {row.base_deg:g} deg, {row.direction.value}, run {row.run}"
                absent = ", ".join(f"{d:g}" for d in missing)
                self.problems.append(f"{self.name}: {where}: no value at displacement_deg {absent}")
        self._stop_at_problems()
        if len(columns) == 1:
            raise UsageError(f"{self.name}: only displacement 0; nothing was measured")
        errors = [[seen[row, d].error_deg if (row, d) in seen else 0.0 for d in columns] for row in rows]
        return ErrorTable(rows, tuple(columns), np.array(errors), self.layout)

    def _stop_at_problems(self) -> None:
        if self.problems:
            more = len(self.problems) - MAX_PROBLEMS
            shown = self.problems[:MAX_PROBLEMS] + ([f"{self.name}: and {more} more"] if more > 0 else [])
            raise UsageError("\n".join([*shown, f"The header is {RIGHT_HEADER}"]))


def _lines(text: str) -> list[tuple[int, str]]:
    """Numbered lines that hold something: no blank lines, comments, separators only, or a spreadsheet's
    "sep=;".
    """
    numbered = enumerate(text.lstrip("\ufeff").splitlines(), start=1)
    return [
        (number, line)
        for number, line in numbered
        # `sep=;` is a spreadsheet's own line for the separator.
        if line.strip(" \t;,") and not line.lstrip().startswith("#") and not line.lower().startswith("sep=")
    ]


def _split(line: str, separator: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=separator))
    # A cell longer than the reader allows: the caller names it.
    except csv.Error:
        return line.split(separator)
