"""`gantryctl compare`: two ways of control on one plant."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import (
    PATH,
    directory,
    json_option,
    out_option,
    print_json,
    seed_option,
    write_json,
)
from gantryctl.cli.text import paragraph, print_table

if TYPE_CHECKING:
    from gantryctl.engineering.comparison.report import CompareReport
    from gantryctl.machine import Machine


@click.command()
@click.argument("first", type=PATH, default=Path("paper"))
@click.argument("second", type=PATH, default=Path("improved"))
@click.option(
    "--ensemble", "plants", type=click.IntRange(0, 100_000), default=0, show_default=True,
    help="Random gears and +-20 % plants to compare on as well, each identified anew; 0 or at least 2.",
)  # fmt: skip
@click.option(
    "--threads", type=click.IntRange(1, 1024), help="Default: all processors; no effect on the result."
)
@seed_option
@out_option
@json_option
def compare(
    first: Path, second: Path, plants: int, threads: int | None, seed: int, out: Path | None, as_json: bool
) -> int:
    """Compare two ways of control on one plant: accuracy, speed error, times, base motion, reducer torque.

    FIRST and SECOND are machine files, or the words `paper` (hust_gantry.toml) and `improved` (hust_improved.toml).
    Every compensation of the second is shown alone and all together. Takes about half a minute, and ten seconds a plant
    and processor for the ensemble.
    """
    from gantryctl.engineering.comparison.data import comparison_data
    from gantryctl.engineering.comparison.report import compare_report
    from gantryctl.errors import UsageError

    # Before half a minute of runs, not after it.
    if plants == 1:
        raise UsageError("--ensemble 1: quantiles need at least 2 plants; 0 leaves the ensemble out")
    # Before the runs: an ensemble may take hours.
    folder = None if out is None else directory(out)
    report = compare_report(
        _machine(first),
        _machine(second),
        plants=plants,
        seed=seed,
        threads=threads,
        progress=_progress(plants),
    )
    data = comparison_data(report)
    if as_json:
        print_json(data)
    else:
        _show(report)
    if folder is not None:
        path = write_json(folder / "compare.json", data)
        if not as_json:
            click.echo(f"wrote {path}")
    return 0


def _progress(plants: int) -> Callable[[int], None] | None:
    """Progress of the ensemble on a terminal: it may take hours."""
    # In a log file the counting lines would only stand between the results.
    if not sys.stderr.isatty():
        return None
    return lambda done: click.echo(f"plant {done} of {plants}", err=True) if done % 10 == 0 else None


def _machine(name: Path) -> Machine:
    from gantryctl.machine import default_machine_path, load_machine

    # The two machines that are shipped, for a first look without files.
    packaged = {"paper": "hust_gantry.toml", "improved": "hust_improved.toml"}
    if str(name) in packaged:
        return load_machine(default_machine_path().with_name(packaged[str(name)]))
    return load_machine(name)


def _show(report: CompareReport) -> None:
    from gantryctl.engineering.comparison.text import notes, tables

    for table in tables(report):
        print_table(table)
    click.echo()
    for note in notes(report):
        paragraph(note)
