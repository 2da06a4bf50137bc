"""Text tables for a terminal, a page or the head of a proposal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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


def duration(seconds: float) -> str:
    """A time for people: seconds below two minutes, then minutes."""
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
