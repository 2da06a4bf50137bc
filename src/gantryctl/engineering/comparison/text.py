"""A comparison as tables and sentences."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.comparison.key_figures import KEY_FIGURES
from gantryctl.engineering.comparison.report import CompareReport
from gantryctl.engineering.identification.text import truth_table
from gantryctl.engineering.report.text import TextTable

_HEADS: Final = {
    "a_true_a": "A true\nproc. A", "a_true_b": "A true\nproc. B", "a_measured_a": "A seen\nproc. A",
    "a_measured_b": "A seen\nproc. B", "load_error_deg_s": "load\ndeg/s", "motor_error_deg_s": "motor\ndeg/s",
    "time_90_s": "90 deg\ns", "time_180_s": "180 deg\ns", "base_um": "base\num p-p", "residual_um": "after\num",
    "settling_s": "settled\ns", "reducer_knm": "reducer\nkN m",
}  # fmt: skip
_DIGITS: Final = {
    "time_90_s": 2, "time_180_s": 2, "base_um": 0, "residual_um": 1, "settling_s": 2, "reducer_knm": 2,
    "base_180_um": 0,
}  # fmt: skip


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
        "A by eq. (6), deg. Seen: median of 500 draws of the tracker's noise, which alone gives 0.0024 (A).",
        "Speed errors are the largest of a move from 0 to 90 deg. With wind-up and maps compensated the motor leaves "
        "the set-point on purpose: judge the load side.",
        "Base: motion at the ring radius without gravity's part; after: 0.2 to 2.2 s after the profile. Settled: time "
        "after the profile until the load stays within 0.001 deg.",
        f"What is identified comes from runs of {report.improved} with everything off, never from [plant]; the tracker "
        "of those runs has noise but no errors of its own.",
    ]


def _text(name: str, value: float) -> str:
    return f"{value:.{_DIGITS.get(name, 4)}f}"


def _rows(report: CompareReport) -> TextTable:
    rows = tuple((name, *(_text(key, getattr(row, key)) for key in _HEADS)) for name, row in report.rows)
    return TextTable(f"{report.paper} against {report.improved}", ("", *_HEADS.values()), rows)


def _profiles(report: CompareReport) -> TextTable:
    rows = tuple(
        (
            row.name,
            f"{row.acc_deg_s2:.3f}",
            f"{row.move.time_s:.2f}",
            f"{row.move.base_um:.0f}",
            f"{row.move.residual_um:.1f}",
            f"{row.move.load_error_deg_s:.4f}",
        )
        for row in report.profiles
    )
    heads = ("", "acceleration\ndeg/s2", "90 deg\ns", "base\num p-p", "after\num", "load\ndeg/s")
    return TextTable(f"Profiles at the base motion of {report.paper}, no compensation", heads, rows)


def _quantiles(report: CompareReport, name: str) -> TextTable:
    assert report.ensemble is not None
    quantiles = report.ensemble.quantiles(name)
    rows = tuple(
        (what, unit, *(_text(key, value) for value in quantiles[key]))
        for key, (what, unit) in KEY_FIGURES.items()
    )
    title = f"{name} on {len(report.ensemble.seeds)} random gears and plants"
    return TextTable(title, ("", "", "5 %", "median", "95 %"), rows)
