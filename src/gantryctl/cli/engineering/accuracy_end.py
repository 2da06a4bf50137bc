"""The end of every accuracy command: report, table, verdict as exit code."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import directory

if TYPE_CHECKING:
    from gantryctl.engineering.accuracy.report.report import AccuracyReport
    from gantryctl.engineering.report.head import Made, MeasuredBy
    from gantryctl.machine import Machine


def finish(
    report: AccuracyReport,
    machine: Machine | None,
    made: Made,
    measured_by: MeasuredBy,
    out: Path,
    as_json: bool,
) -> int:
    """Write the page, print table or JSON; 1 when a criterion is not shown to be met.

    Args:
        machine: None where nothing tells which machine was measured.
    """
    from gantryctl.cli.report import head_of
    from gantryctl.engineering.accuracy.report.data import report_json
    from gantryctl.engineering.accuracy.report.page import write_report
    from gantryctl.engineering.accuracy.report.text import text_report

    origin = report.required.origin if report.required else ""
    head = replace(head_of(machine, made, measured_by), required_source=origin)
    page = write_report(report, head, directory(out))
    if as_json:
        click.echo(report_json(report), nl=False)
    else:
        click.echo(text_report(report))
        click.echo(f"\nreport: {page.resolve()}")
    return exit_code(report)


def exit_code(report: AccuracyReport) -> int:
    """1 when a criterion is not shown to be met."""
    from gantryctl.engineering.accuracy.verdict import Conformity

    # No verdict is no failure: motor-side readings end with 0. What the uncertainty leaves open is not shown to be met.
    failed = report.verdict.conformity in (Conformity.FAIL, Conformity.UNDECIDED)
    return int(failed or report.speed_passed is False)
