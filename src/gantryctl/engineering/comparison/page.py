"""The report of a comparison."""

from __future__ import annotations

from collections.abc import Sequence

from gantryctl.engineering.comparison.on_bus import BusComparison, bus_table
from gantryctl.engineering.comparison.report import CompareReport, judge_seen
from gantryctl.engineering.comparison.text import notes, tables
from gantryctl.engineering.report.head import Head, Required, Verdict, judged_as
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.machine import Requirement


def render_comparison(report: CompareReport, head: Head) -> str:
    """The page of a simulated comparison."""
    first, last = report.rows[0], report.rows[-1]
    return _render(
        head,
        [(name, row.a_measured_a) for name, row in (first, last)],
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
        [(name, figures.a_seen_deg) for name, figures in found.rows],
        found.required,
        title=" against ".join(name for name, _ in found.rows),
        sections=[Section("Figures", tables=[bus_table(found)])],
    )


def _render(
    head: Head,
    a_seen_deg: Sequence[tuple[str, float]],
    requirement: Requirement,
    *,
    title: str,
    sections: Sequence[Section],
) -> str:
    limit = requirement.limit
    required = [
        Required(
            f"A as measured, {name}", f"at most {limit:g} deg", f"{a_deg:.4f} deg", judged_as(a_deg <= limit)
        )
        for name, a_deg in a_seen_deg
    ]
    (_, before), (name, after) = a_seen_deg[0], a_seen_deg[-1]
    found = judge_seen(name, after, requirement)
    verdict = Verdict(
        found.conformity.value.upper(),
        judged_as(found.passed),
        f"{found.text}; {before:.4f} deg without the second way of control",
    )
    return render_sections(
        head, verdict, required, title=title, subtitle="Two ways of control on one plant", sections=sections
    )
