"""Text tables for a terminal, a page or the head of a proposal."""

from __future__ import annotations

from typing import NamedTuple


class TextTable(NamedTuple):
    """A table; the first column is text, the others are numbers."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
