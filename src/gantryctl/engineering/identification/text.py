"""Identified numbers, beside the truth of the simulator where there is one, as a table of text."""

from __future__ import annotations

import math
from collections.abc import Iterable

from gantryctl.engineering.identification.truth import LABELS, Comparison
from gantryctl.engineering.report.text import TextTable
from gantryctl.machine import NUMBERS, Calibration


def truth_table(title: str, head: str, rows: Iterable[Comparison], digits: int) -> TextTable:
    """One row per number; `head` names the column of what was found."""
    cells = tuple(
        (
            row.name,
            "-" if row.identified is None else f"{row.identified:.{digits}g}",
            _interval(row.half_width),
            f"{row.truth:.{digits}g}",
            row.unit,
            "" if math.isnan(row.error_percent) else f"{row.error_percent:+.1f} %",
        )
        for row in rows
    )
    return TextTable(title, ("", head, "+- (95 %)", "truth", "", "off by"), cells)


def numbers_table(calibration: Calibration) -> TextTable:
    """The identified numbers alone, where nobody knows the truth."""
    found = {
        name: (getattr(calibration.identified, name), half) for name, half in calibration.half_width.items()
    }
    rows = tuple(
        (LABELS[name][0], f"{found[name][0]:.6g}", _interval(found[name][1]), LABELS[name][1])
        for name in NUMBERS
        if name in found
    )
    return TextTable("Identified", ("", "found", "+- (95 %)", ""), rows)


def unknown_lines(calibration: Calibration) -> list[str]:
    """A line for each number that could not be identified, with the reason."""
    return [
        f"not identified: {LABELS[name][0]}: {reason.words}" for name, reason in calibration.unknown.items()
    ]


def _interval(half_width: float | None) -> str:
    return "" if half_width is None else f"{half_width:.2g}"
