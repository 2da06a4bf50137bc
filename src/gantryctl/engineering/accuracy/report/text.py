"""The report for a terminal: plain text, no colours, at most 100 columns for two tables beside each other."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from gantryctl.engineering.accuracy.budget import budget_text
from gantryctl.engineering.accuracy.iso230 import IsoFigures
from gantryctl.engineering.accuracy.noise import Distribution
from gantryctl.engineering.accuracy.report.report import AccuracyReport, Beside, SpeedRun
from gantryctl.engineering.accuracy.statistics import TableStatistics, statistics
from gantryctl.engineering.accuracy.table import Direction, ErrorTable
from gantryctl.engineering.accuracy.uncertainty import COVERAGE_K
from gantryctl.units import SIGNED, Dial

# Another table fits beside: twice four columns of errors.
WIDTH = 100

# Attribute of `IsoFigures`, symbol, name; in the order of the standard.
ISO_NAMES = (
    ("reversal_deg", "B", "reversal"),
    ("mean_reversal_deg", "B mean", "mean reversal"),
    ("repeatability_up_deg", "R up", "repeatability, ccw"),
    ("repeatability_down_deg", "R down", "repeatability, cw"),
    ("repeatability_deg", "R", "repeatability, both ways"),
    ("systematic_up_deg", "E up", "systematic deviation, ccw"),
    ("systematic_down_deg", "E down", "systematic deviation, cw"),
    ("systematic_deg", "E", "systematic deviation, both ways"),
    ("mean_bidirectional_deg", "M", "mean deviation, both ways"),
    ("accuracy_up_deg", "A up", "accuracy, ccw"),
    ("accuracy_down_deg", "A down", "accuracy, cw"),
    ("accuracy_deg", "A (ISO)", "accuracy, both ways"),
)

NOT_JUDGED = "motor side not judged: compensations move the motor off the set-point on purpose"

# Rows under the table: name and attribute of `TableStatistics`.
STATISTICS = (("X", "mean_deg"), ("3 S", "three_s_deg"), ("X + 3 S", "upper_deg"), ("X - 3 S", "lower_deg"))


def angle_text(value_deg: float) -> str:
    """An error with sign and four decimals, as the paper prints; no minus sign before zero."""
    text = f"{value_deg:+.4f}"
    return text.replace("+", " ").replace("-", " ") if float(text) == 0.0 else text


def iso_text(attribute: str, figures: IsoFigures) -> str:
    """One ISO figure; only the mean reversal has a sign, the others are widths."""
    value: float = getattr(figures, attribute)
    return angle_text(value).strip() if attribute == "mean_reversal_deg" else f"{value:.4f}"


def text_table(
    table: ErrorTable, beside: Beside | None = None, title: str = "here", dial: Dial = SIGNED
) -> str:
    """The errors and their statistics, with another table beside them if there is one, deg.

    Repeated series are shown as the mean of their runs; the statistics are those of all rows. Rows of
    the other table appear where base and direction are the same, and its columns only when the displacements are.
    """
    same = beside is not None and beside.table.displacements_deg == table.displacements_deg
    name, reference = (
        (beside.name, beside.table.mean_of_runs()) if beside is not None and same else ("", None)
    )
    others: dict[tuple[float, Direction], list[float]] = {}
    if reference is not None:
        others = dict(zip([row[:2] for row in reference.rows], reference.errors_deg.tolist(), strict=True))
    shown = table.mean_of_runs()
    title += f" (mean of {table.runs})" if table.runs > 1 else ""
    head = _cells([f"{d:g}" for d in table.displacements_deg[1:]])
    lines = [f"{'error, deg':<12}{title:<{len(head)}}" + (f"   {name}" if reference else "")]
    lines.append(f"{'base, way':<12}{head}" + (f"   {head}" if reference else ""))
    for row, errors in zip(shown.rows, shown.errors_deg.tolist(), strict=True):
        way = f"{dial.text(row.base_deg)} {row.direction.value}"
        lines.append(f"{way:<12}{_angles(errors)}{_beside(others.get(row[:2]))}")
    if len(table.rows) > 1:
        lines += [
            "-" * max(len(line) for line in lines),
            *_statistics_lines(statistics(table), beside.table if beside is not None and same else None),
        ]
    return "\n".join(line.rstrip() for line in lines)


def text_report(report: AccuracyReport) -> str:
    """The whole result in words and tables."""
    blocks = [
        text_table(report.table, report.beside, _table_title(report), report.dial),
        _headline(report),
        "" if report.budget is None else budget_text(report.budget),
        _iso_lines(report),
        speed_lines(report.speed),
        "\n".join(_wrapped(f"warning: {warning}") for warning in report.warnings),
    ]
    return "\n\n".join(block for block in blocks if block)


def distribution_text(distribution: Distribution) -> str:
    """Median and 5..95 %, deg."""
    low, high = distribution.low_deg, distribution.high_deg
    return f"{distribution.median_deg:.4f} deg, 5..95 % {low:.4f} .. {high:.4f}"


def _wrapped(text: str) -> str:
    return textwrap.fill(text, WIDTH, subsequent_indent="  ")


def _table_title(report: AccuracyReport) -> str:
    return report.origin.value if report.true is None else f"{report.origin.value}, noise off"


def _headline(report: AccuracyReport) -> str:
    figures = report.statistics
    lines = [_wrapped(f"readings: {report.origin}, {report.source}")]
    lines.append(
        f"A = {figures.a_deg:.4f} deg, largest X + 3 S minus smallest X - 3 S, {figures.n} rows pooled"
    )
    if report.a_measured is not None:
        lines.append(
            f"A as measured, median of {report.a_measured.draws}: {distribution_text(report.a_measured)}"
        )
    if report.a_floor is not None:
        lines.append(f"A of the instrument's noise alone: {distribution_text(report.a_floor)}")
    if report.uncertainty is not None:
        known = report.uncertainty
        lines.append(
            f"expanded uncertainty, k = {COVERAGE_K:g}: of A {COVERAGE_K * known.a_deg:.4f} deg, of a chord error "
            f"up to {COVERAGE_K * known.largest_chord_deg:.4f} deg"
        )
        lines.append(f"A of the instrument's uncertainty alone: {distribution_text(known.floor)}")
    if figures.a_by_direction_deg is not None:
        lines.append(f"with the directions kept apart, 3s: {figures.a_by_direction_deg:.4f} deg")
    rms = ", ".join(f"{report.dial.text(base)} deg {value:.4f}" for base, value in figures.rms_deg.items())
    lines.append(f"rms by base: {rms}")
    if report.ensemble is not None:
        gears = report.ensemble
        lines.append(
            f"A over {len(gears.a_deg)} gears with random phases: median "
            f"{gears.distribution.median_deg:.4f} deg, {min(gears.a_deg):.4f} .. {max(gears.a_deg):.4f}"
        )
    lines.append(_wrapped(f"{report.verdict.conformity.value.upper()}: {report.verdict.text}"))
    if report.comparison:
        lines.append(_wrapped(report.comparison))
    return "\n".join(lines)


def _iso_lines(report: AccuracyReport) -> str:
    iso, measured = report.iso, report.iso_measured
    if iso.not_computable is not None:
        return f"ISO 230-2:2014: {iso.not_computable}"
    two = report.true is not None
    lines = [f"ISO 230-2:2014, {iso.runs} runs in each direction, k = 2, deg"]
    if two:
        lines.append(f"  {'':<8}{'true':>9}{'measured':>10}")
    for attribute, symbol, name in ISO_NAMES:
        values = f"{iso_text(attribute, iso):>9}" + (f"{iso_text(attribute, measured):>10}" if two else "")
        lines.append(f"  {symbol:<8}{values}  {name}")
    return "\n".join(lines)


def speed_lines(runs: Sequence[SpeedRun]) -> str:
    """One line per run of the speed test; empty without runs."""
    if not runs:
        return ""
    lines = [
        f"speed test, {runs[0].origin}; load {runs[0].load_by}",
        "              asked   reached   motor side   load side   (largest speed error, deg/s)",
    ]
    for run in runs:
        load = f"{run.load_error_deg_s:9.4f}" if run.load_error_deg_s is not None else "        -"
        lines.append(
            f"{'pass' if run.passed else 'FAIL':<6}{run.direction.value:>5}{run.speed_deg_s:8.3f}"
            f"{run.reached_deg_s:10.3f}{run.motor_error_deg_s:13.4f}   {load}"
            + ("   stick-slip" if run.stick_slip else "")
        )
    required = runs[0].required
    lines.append(f"motor side: at most {required.limit:g} deg/s, required by {required.origin}")
    if not all(run.motor_judged for run in runs):
        lines.append(NOT_JUDGED)
    return "\n".join(lines)


def _statistics_lines(figures: TableStatistics, beside: ErrorTable | None) -> list[str]:
    other = statistics(beside) if beside is not None else None
    lines = []
    for name, attribute in STATISTICS:
        theirs = getattr(other, attribute) if other is not None else None
        line = f"{name:<12}{_angles(getattr(figures, attribute))}{_beside(theirs)}"
        lines.append(line.replace("+", " ") if name == "3 S" else line)
    a = f"{'A':<12}{figures.a_deg:7.4f}"
    width = 12 + len(_angles(figures.mean_deg))
    # The paper's rows give its printed A, 0.0113, to the last digit.
    return [*lines, f"{a:<{width}}" + (f"   {other.a_deg:7.4f}" if other is not None else "")]


def _cells(texts: Sequence[str]) -> str:
    return "".join(f"{text:>9}" for text in texts)[2:]


def _angles(values_deg: Sequence[float]) -> str:
    """All columns but the zero column."""
    return _cells([angle_text(value) for value in values_deg[1:]])


def _beside(values_deg: Sequence[float] | None) -> str:
    return "" if values_deg is None else "   " + _angles(values_deg)
