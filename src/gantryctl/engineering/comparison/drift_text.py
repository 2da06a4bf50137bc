"""A comparison on plants that drift: as tables and sentences, as data for JSON, as a page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from gantryctl.engineering.accuracy.report.data import verdict_data
from gantryctl.engineering.comparison.drift_report import DriftReport, a_true
from gantryctl.engineering.comparison.key_figures import KEY_FIGURES, KeyFigures
from gantryctl.engineering.comparison.page import required_rows
from gantryctl.engineering.report.head import Head, Verdict, judged_as
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.engineering.report.text import TextTable

# Key in the data, meaning, unit, digits, and how it is made of a row.
SPREADS: Final[tuple[tuple[str, str, str, int, Callable[[KeyFigures], float]], ...]] = (
    ("a_true_a", "A true, procedure A", "deg", 4, lambda row: row.a_true_a),
    ("a_true_b", "A true, procedure B", "deg", 4, lambda row: row.a_true_b),
    ("a_true", "A true, the larger of both", "deg", 4, a_true),
    ("load_error_deg_s", "load speed error", "deg/s", 4, lambda row: row.load_error_deg_s),
    ("residual_um", "residual base motion", "um", 1, lambda row: row.residual_um),
)


def tables(report: DriftReport) -> list[TextTable]:
    """A by row and control, speed error, residual and time by row and control, and what holds over the rows."""
    return [
        _by_row(
            report, "A true, procedure A / B, deg", lambda row: f"{row.a_true_a:.4f} / {row.a_true_b:.4f}"
        ),
        _by_row(
            report,
            "Short move: load speed error, deg/s / residual base motion, um / time, s",
            lambda row: f"{row.load_error_deg_s:.4f} / {row.residual_um:.1f} / {row.time_short_s:.2f}",
        ),
        _spreads(report),
    ]


def notes(report: DriftReport) -> list[str]:
    """Conditions of the figures for the reader."""
    rows = "; ".join(f"{name}: {meaning}" for name, meaning in report.rows[1:])
    below = [f"Every row but the first has {_on_top(report)} too."] if report.drift.on_top_of else []
    return [
        *below,
        f"{report.second} and its rows know {report.calibration}; nothing is identified after a change.",
        "Before each run every axis moves to both ends of the chord test and back, and stops at its middle base.",
        f"Rows of {report.drift.name}: {rows}.",
        f"A, deg: largest X + 3 S minus smallest X - 3 S of the true angles of the chord test. The short move goes "
        f"from {report.dial.span(*report.short_deg)} deg.",
        f"Median, 95 % and worst are over the {len(report.rows) - 1} rows that change something, each counted once: a "
        "list of cases, not a probability.",
    ]


def drift_data(report: DriftReport) -> dict[str, Any]:
    """Everything `compare --drift FILE --json` prints."""
    return {
        "first": report.first,
        "second": report.second,
        "drift": report.drift.name,
        "description": report.drift.description,
        "on_top_of": list(report.drift.on_top_of),
        "calibration": report.calibration,
        "short_deg": list(report.short_deg),
        "verdict": verdict_data(report.verdict),
        "figures": {name: {"meaning": f.meaning, "unit": f.unit} for name, f in KEY_FIGURES.items()},
        "rows": [
            {
                "name": name,
                "meaning": meaning,
                "changes": [] if k == 0 else [c.__dict__ for c in report.drift.rows[k - 1].changes],
                "controls": {control: rows[k]._asdict() for control, rows in report.figures.items()},
            }
            for k, (name, meaning) in enumerate(report.rows)
        ],
        "over_rows": {
            control: {key: report.spread(control, figure)._asdict() for key, _, _, _, figure in SPREADS}
            for control in report.figures
        },
    }


def render_drift(report: DriftReport, head: Head) -> str:
    """The page of a comparison on plants that drift."""
    spread = report.spread(report.second, a_true)
    found = report.verdict
    verdict = Verdict(
        found.conformity.value.upper(),
        judged_as(found.passed),
        f"{found.text}; A true at most {spread.worst:.4f} deg, in the row {spread.worst_in}",
    )
    return render_sections(
        head,
        verdict,
        required_rows([found], report.required.limit),
        title=f"{report.first} against {report.second} when the machine changes",
        subtitle=f"One calibration on {len(report.rows)} plants: {report.drift.description or report.drift.name}"
        + (f"; all but the first on top of {_on_top(report)}" if report.drift.on_top_of else ""),
        sections=[
            Section("Figures", tables=tables(report)),
            Section("How to read them", notes(report)),
        ],
    )


def _on_top(report: DriftReport) -> str:
    return " and ".join(report.drift.on_top_of)


def _by_row(report: DriftReport, title: str, cell: Callable[[KeyFigures], str]) -> TextTable:
    rows = tuple(
        (name, *(cell(rows[k]) for rows in report.figures.values()))
        for k, (name, _) in enumerate(report.rows)
    )
    return TextTable(title, ("", *report.figures), rows)


def _spreads(report: DriftReport) -> TextTable:
    rows = [
        {
            "control": control if first else "",
            "figure": f"{meaning}, {unit}",
            "as identified": f"{spread.unchanged:.{digits}f}",
            "median": f"{spread.median:.{digits}f}",
            "95 %": f"{spread.high:.{digits}f}",
            "worst": f"{spread.worst:.{digits}f}",
            "in": spread.worst_in,
        }
        for control in report.figures
        for first, (_, meaning, unit, digits, figure) in zip(
            (True, *(False,) * len(SPREADS)), SPREADS, strict=False
        )
        for spread in (report.spread(control, figure),)
    ]
    return TextTable.of("Over the rows", rows)._replace(left=(0, 1, 6))
