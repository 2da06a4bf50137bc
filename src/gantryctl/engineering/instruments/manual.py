"""Readings that a person takes: typed at each stop, or in a file made beforehand."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from gantryctl.errors import DeviceError, UsageError
from gantryctl.units import rad

COLUMN = "angle_deg"
SUSPICIOUS_DEG = 1.0
"""A typed reading this far from where the axis stands is asked for again."""
ATTEMPTS = 3


def parse_angle_deg(text: str) -> float:
    """A typed angle, deg; a decimal comma is understood.

    Raises:
        UsageError: no finite number.
    """
    try:
        value = float(text.strip().replace(",", ".").removesuffix("deg").removesuffix("°"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UsageError(f"reading {text.strip()[:40]!r}: not an angle in deg (like 89.9987)")
    return value


class ManualReadings:
    """One reading per stop, in the order of the stops, from a list or from a person.

    Args:
        next_deg: called once per stop with the angle where the axis stands, deg; returns the reading, deg.
    """

    name = "manual"
    measures_load = True

    def __init__(self, next_deg: Callable[[float], float]) -> None:
        self._next_deg = next_deg

    @classmethod
    def of(cls, readings_deg: Iterable[float]) -> ManualReadings:
        """Readings taken beforehand."""
        remaining = iter(readings_deg)

        def following(_: float) -> float:
            value = next(remaining, None)
            if value is None:
                raise DeviceError("manual readings: there are fewer readings than stops")
            return value

        return cls(following)

    @classmethod
    def from_csv(cls, path: str | Path) -> ManualReadings:
        """A file with a column `angle_deg`, one line per stop in the order of the stops.

        Raises:
            UsageError: the file cannot be read or has no such column; line and value are named.
        """
        path = Path(path)
        try:
            lines = path.read_text(encoding="utf-8-sig").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"{path}: cannot be read ({error})") from error
        return cls.of(_column(path.name, lines))

    @classmethod
    def asking(cls, ask: Callable[[str], str], say: Callable[[str], None]) -> ManualReadings:
        """Asks a person at each stop.

        Args:
            ask: shows a prompt and returns what was typed.
            say: shows why something typed was not taken.
        """

        def following(at_deg: float) -> float:
            for _ in range(ATTEMPTS):
                try:
                    value = parse_angle_deg(ask(f"axis at {at_deg:.4f} deg; reading, deg: "))
                except UsageError as error:
                    say(str(error))
                    continue
                if abs(value - at_deg) <= SUSPICIOUS_DEG:
                    return value
                say(f"{value:g} deg is {abs(value - at_deg):.3g} deg away from where the axis stands")
            raise DeviceError(f"no usable reading at {at_deg:.4f} deg after {ATTEMPTS} attempts")

        return cls(following)

    def reading_rad(self, samples_rad: Sequence[float]) -> float:
        """The next reading, rad; the dwell's angle is shown to the person, never used as the reading."""
        return rad(self._next_deg(math.degrees(samples_rad[0])))


def _column(name: str, lines: Sequence[str]) -> list[float]:
    used = [
        (number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")
    ]
    if not used:
        raise UsageError(f"{name}: empty; the header is {COLUMN}")
    separator = ";" if ";" in used[0][1] else ","
    header = [cell.strip().lower() for cell in used[0][1].split(separator)]
    if COLUMN not in header:
        raise UsageError(f"{name}: line {used[0][0]}: no column {COLUMN}")
    index = header.index(COLUMN)
    readings = []
    for number, line in used[1:]:
        cells = next(csv.reader([line], delimiter=separator))
        if len(cells) != len(header):
            raise UsageError(f"{name}: line {number}: {len(cells)} values for {len(header)} columns")
        try:
            readings.append(parse_angle_deg(cells[index]))
        except UsageError as error:
            raise UsageError(f"{name}: line {number}, column {COLUMN}: {error}") from None
    return readings
