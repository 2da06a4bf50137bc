"""Text tables for a terminal, a page or the head of a proposal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple


class TextTable(NamedTuple):
    """A table.

    Attributes:
        left: columns that hold words; the others hold numbers and stand at the right.
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    left: tuple[int, ...] = (0,)

    @classmethod
    def of(cls, title: str, rows: Iterable[Mapping[str, str]]) -> TextTable:
        """A table of rows that name their cells; all rows have the names of the first."""
        cells = list(rows)
        heads = tuple(cells[0]) if cells else ()
        return cls(title, heads, tuple(tuple(row.values()) for row in cells))


def or_dash(value: float | None, form: str) -> str:
    """A figure in a format, or a dash where it does not exist."""
    return "-" if value is None else format(value, form)


def decimals(values: Sequence[float], least: int) -> int:
    """Decimals of a column: two digits of its largest value, of a small machine too."""
    largest = max(map(abs, values), default=0.0)
    return max(least, 1 - math.floor(math.log10(largest))) if largest > 0.0 else least


def figure(value: float, least: int) -> str:
    """A figure that stands alone, with its own decimals."""
    return f"{value:.{decimals((value,), least)}f}"


def duration(seconds: float) -> str:
    """A time for people: seconds below two minutes, then minutes."""
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
