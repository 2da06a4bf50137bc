"""A comparison as tables and sentences."""

from __future__ import annotations

from gantryctl.engineering.comparison.key_figures import KEY_FIGURES
from gantryctl.engineering.comparison.report import CompareReport
from gantryctl.engineering.identification.text import truth_table
from gantryctl.engineering.report.text import TextTable, decimals


def tables(report: CompareReport) -> list[TextTable]:
    """Rows, identified values, profiles, ensemble."""
    found = [_rows(report)]
    if report.identified:
        found.append(
            truth_table("What the compensations know, and the truth", "known", report.identified, digits=5)
        )
    found.append(_profiles(report))
    if report.ensemble is not None:
        found += [_quantiles(report, name) for name in report.ensemble.rows]
    return found


def notes(report: CompareReport) -> list[str]:
    """Limits of the figures for the reader."""
    return [
        "A, deg: largest X + 3 S minus smallest X - 3 S of the chord test. Seen: median of 500 draws of the tracker's "
        "noise.",
        f"The short move goes from {report.dial.span(*report.short_deg)} deg, the long one from "
        f"{report.dial.span(*report.long_deg)} deg; speed errors, base and settling are those of the short one.",
        "With wind-up and maps compensated the motor leaves the set-point on purpose: judge the load side.",
        "Base: motion at the ring radius without gravity's part; after: 0.2 to 2.2 s after the profile. Settled: time "
        "after the profile until the load stays within 0.001 deg.",
        f"What is identified comes from runs of {report.second} with everything off, never from [plant]; the tracker "
        "of those runs has noise but no errors of its own.",
    ]


def _rows(report: CompareReport) -> TextTable:
    shown = {name: figure for name, figure in KEY_FIGURES.items() if figure.head}
    places = {
        name: decimals([getattr(row, name) for _, row in report.rows], figure.digits)
        for name, figure in shown.items()
    }
    rows = tuple(
        (row_name, *(f"{getattr(row, name):.{digits}f}" for name, digits in places.items()))
        for row_name, row in report.rows
    )
    heads = ("", *(figure.head for figure in shown.values()))
    return TextTable(f"{report.first} against {report.second}", heads, rows)


def _profiles(report: CompareReport) -> TextTable:
    base = decimals([row.move.base_um for row in report.profiles], 0)
    rows = [
        {
            "profile": row.name,
            "acceleration\ndeg/s2": f"{row.acc_deg_s2:.3f}",
            "short\ns": f"{row.move.time_s:.2f}",
            "base\num p-p": f"{row.move.base_um:.{base}f}",
            "after\num": f"{row.move.residual_um:.1f}",
            "load\ndeg/s": f"{row.move.load_error_deg_s:.4f}",
            "": "" if row.kept else "shakes more",
        }
        for row in report.profiles
    ]
    return TextTable.of(f"The short move at the base motion of {report.first}", rows)


def _quantiles(report: CompareReport, name: str) -> TextTable:
    assert report.ensemble is not None
    quantiles = report.ensemble.quantiles(name)
    rows = tuple(
        (figure.meaning, figure.unit, *(f"{value:.{figure.digits}f}" for value in quantiles[key]))
        for key, figure in KEY_FIGURES.items()
    )
    title = f"{name} on {len(report.ensemble.seeds)} random gears and plants"
    return TextTable(title, ("", "", "5 %", "median", "95 %"), rows)
