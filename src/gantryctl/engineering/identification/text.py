"""Identified numbers beside the truth of the simulator, as a table of text."""

from __future__ import annotations

from collections.abc import Iterable

from gantryctl.engineering.identification.truth import Comparison
from gantryctl.engineering.report.text import TextTable


def truth_table(title: str, head: str, rows: Iterable[Comparison], digits: int) -> TextTable:
    """One row per number; `head` names the column of what was found."""
    cells = tuple(
        (
            row.name,
            f"{row.identified:.{digits}g}",
            f"{row.truth:.{digits}g}",
            row.unit,
            f"{row.error_percent:+.1f} %" if row.truth else "",
        )
        for row in rows
    )
    return TextTable(title, ("", head, "truth", "", "off by"), cells)
