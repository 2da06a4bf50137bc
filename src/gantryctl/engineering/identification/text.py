"""Identified numbers, beside the truth of the simulator where there is one, as a table of text."""

from __future__ import annotations

import math
from collections.abc import Iterable

from gantryctl.engineering.identification.fit import CalibrationFit
from gantryctl.engineering.identification.truth import LABELS, Comparison
from gantryctl.engineering.identification.waves import ToothWaves
from gantryctl.engineering.report.text import TextTable
from gantryctl.machine import NUMBERS, Calibration
from gantryctl.machine.calibration import FAST_WAVES, MAP_HARMONICS
from gantryctl.units import Dial


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


def lead_lines(found: CalibrationFit, dial: Dial) -> list[str]:
    """What the map holds, the waves beside it, and how it does on a move that was not in the fit."""
    lead, fast = found.lead, found.maps.fast
    waves = ", ".join(f"{cycles:g}" for cycles, _, _ in sorted(fast)) or "none"
    lines = [
        f"map of {lead.order} waves per turn of {MAP_HARMONICS} that the law carries, lost motion of "
        f"{len(lead.reversal_rad) // 2}; single waves per turn: {waves} ({len(fast)} of {FAST_WAVES})"
    ]
    if lead.teeth is not None:
        lines.append(_teeth_words(lead.teeth))
    if found.left_over:
        lines.append(
            f"warning: the law has no place for the waves {', '.join(f'{c:g}' for c in found.left_over)}"
        )
    return [*lines, f"{'warning: ' if found.validation.warned else ''}{found.validation.words(dial)}"]


def _teeth_words(teeth: ToothWaves) -> str:
    """Whether the map has waves of single teeth, and why."""
    waves = f"waves {teeth.cycles[0]} to {teeth.cycles[-1]}"
    part = f"{teeth.left_part:.3f} +- {teeth.half_width:.3f} (95 %)"
    use = "they are in the map: teeth differ" if teeth.come_again else "they are not in the map"
    return (
        f"{waves} by the turn one way leave {part} of what the map leaves the other way without them: {use}"
    )


def unknown_lines(calibration: Calibration) -> list[str]:
    """A line for each number that could not be identified, with the reason."""
    return [
        f"not identified: {LABELS[name][0]}: {reason.words}" for name, reason in calibration.unknown.items()
    ]


def _interval(half_width: float | None) -> str:
    return "" if half_width is None else f"{half_width:.2g}"
