"""The end of every accuracy command: report, table, verdict as exit code."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import directory

if TYPE_CHECKING:
    from gantryctl.engineering.accuracy.report.report import AccuracyReport


def stamp() -> tuple[str, str]:
    """Version and date of the page."""
    from datetime import UTC, datetime
    from importlib.metadata import version

    return version("gantryctl"), datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")


def finish(report: AccuracyReport, out: Path, as_json: bool) -> int:
    """Write the page, print table or JSON; 1 when a criterion is not shown to be met."""
    from gantryctl.engineering.accuracy.report.data import report_json
    from gantryctl.engineering.accuracy.report.page import write_report
    from gantryctl.engineering.accuracy.report.text import text_report
    from gantryctl.engineering.accuracy.verdict import Conformity

    page = write_report(report, directory(out))
    if as_json:
        click.echo(report_json(report), nl=False)
    else:
        click.echo(text_report(report))
        click.echo(f"\nreport: {page.resolve()}")
    # No verdict is no failure: motor-side readings end with 0. What the uncertainty leaves open is not shown to be met.
    failed = report.verdict.conformity in (Conformity.FAIL, Conformity.UNDECIDED)
    return int(failed or report.speed_passed is False)
