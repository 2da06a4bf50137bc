"""The report of a comparison."""

from __future__ import annotations

from collections.abc import Sequence

from gantryctl.engineering.accuracy.verdict import (
    AccuracyVerdict,
    ChordFigures,
    conformity_of,
    judge_chords,
    plus_minus,
)
from gantryctl.engineering.comparison.on_bus import BusComparison, bus_table
from gantryctl.engineering.comparison.report import CompareReport
from gantryctl.engineering.comparison.text import notes, tables
from gantryctl.engineering.report.head import Head, Required, Verdict, judged_as
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.machine import Requirement


def render_comparison(report: CompareReport, head: Head) -> str:
    """The page of a simulated comparison."""
    first, last = report.rows[0], report.rows[-1]
    return _render(
        head,
        [(name, row.judged_by) for name, row in (first, last)],
        report.required,
        title=f"{report.first} against {report.second}",
        sections=[
            Section("Figures", tables=tables(report)),
            Section("How to read them", notes(report)),
        ],
    )


def render_bus_comparison(found: BusComparison, head: Head) -> str:
    """The page of a comparison on a bus."""
    return _render(
        head,
        [(name, figures.judged_by) for name, figures in found.rows],
        found.required,
        title=" against ".join(name for name, _ in found.rows),
        sections=[Section("Figures", tables=[bus_table(found)])],
    )


def required_rows(verdicts: Sequence[AccuracyVerdict], limit_deg: float) -> list[Required]:
    """The figures of verdicts beside the limit that they keep or miss."""
    return [
        Required(
            figure,
            f"at most {limit_deg:g} deg",
            f"{value:.4f} {plus_minus(verdict.uncertainties_deg.get(figure))}deg",
            judged_as(conformity_of(value, verdict.uncertainties_deg.get(figure, 0.0), limit_deg).passed),
        )
        for verdict in verdicts
        for figure, value in verdict.figures_deg.items()
    ]


def _render(
    head: Head,
    seen: Sequence[tuple[str, ChordFigures]],
    requirement: Requirement,
    *,
    title: str,
    sections: Sequence[Section],
) -> str:
    judged = [(name, judge_chords(chords, requirement, of=name)) for name, chords in seen]
    required = required_rows([verdict for _, verdict in judged], requirement.limit)
    (_, before), (_, found) = seen[0], judged[-1]
    verdict = Verdict(
        found.conformity.value.upper(),
        judged_as(found.passed),
        f"{found.text}; A is {before.a_deg:.4f} deg without the second way of control",
    )
    return render_sections(
        head, verdict, required, title=title, subtitle="Two ways of control on one plant", sections=sections
    )
