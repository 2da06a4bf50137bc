"""`gantryctl compare`: two ways of control on one plant."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.engineering.at_the_load import (
    SIMULATED,
    SIMULATED_CERTIFICATE,
    certificate_of,
    certificate_option,
)
from gantryctl.cli.engineering.experiment import asking, instrument_at, yes_option
from gantryctl.cli.options import (
    bus_log_option,
    directory,
    json_option,
    out_option,
    print_json,
    seed_option,
    write_json,
    write_text,
)
from gantryctl.cli.progress import metered
from gantryctl.cli.report import head_of, report_options
from gantryctl.cli.text import paragraph, print_table
from gantryctl.cli.values import PATH, Whole
from gantryctl.extras import need
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.engineering.accuracy.verdict import AccuracyVerdict
    from gantryctl.engineering.comparison.report import CompareReport
    from gantryctl.engineering.report.head import Made
    from gantryctl.machine import Machine


@click.command()
@bus_log_option
@click.argument("first", type=PATH, default=Path("paper"))
@click.argument("second", type=PATH, default=Path("improved"))
@click.option(
    "--ensemble", "plants", type=Whole(0, 100_000), default=0, show_default=True,
    help="Random gears and +-20 % plants to compare on as well, each identified anew; 0 or at least 2.",
)  # fmt: skip
@click.option(
    "--drift",
    type=PATH,
    help="Run both on plants that change as this file says, with the calibration of before; `hust` is delivered.",
)
@click.option(
    "--on-top", "on_top_of", metavar="ROW", multiple=True,
    help="With --drift: every row has the changes of this row of the file too; may be given again.",
)  # fmt: skip
@click.option("--identify", is_flag=True, help="With --drift: identify the plant of SECOND first.")
@click.option(
    "--stale-days", "stale_days", type=Whole(0, 100_000), default=0, metavar="N",
    help="Instead: N days of use of SECOND, sound or, with --drift, with its rows: is a calibration that is old named?",
)  # fmt: skip
@click.option("--threads", type=Whole(1, 1024), help="Default: all processors; no effect on the result.")
@click.option(
    "--instrument",
    default=SIMULATED,
    show_default=True,
    help="On a bus, what watches the load: simulated (a tracker), tcp:HOST:PORT or serial:DEVICE:BAUD.",
)
@certificate_option
@yes_option
@seed_option
@out_option
@report_options
@json_option
def compare(
    first: Path,
    second: Path,
    plants: int,
    drift: Path | None,
    on_top_of: tuple[str, ...],
    identify: bool,
    stale_days: int,
    threads: int | None,
    instrument: str,
    certificate: str,
    yes: bool,
    seed: int,
    out: Path | None,
    as_json: bool,
    made: Made,
) -> int:
    """Compare two ways of control on one plant: accuracy, speed error, times, base motion, reducer torque.

    FIRST and SECOND are machine files, or the words `paper` (hust_gantry.toml) and `improved` (hust_improved.toml).
    Every compensation of the second is shown alone and all together. Takes about half a minute, and a second a plant
    and processor for the ensemble.

    Two machines with the same drive on a bus are run on it, one after the other: 20 minutes of axis time, chord test
    and moves, by what the drive and an instrument at the load say.

    With --drift the machine changes after it was identified: rows of the file (more eccentric moment, backlash,
    friction ...), each on the paper's loop, on the second without its load encoder and as it is; median, 95 % and worst
    over them.

    With --stale-days SECOND is used day by day, 60 moves each, with its load encoder and without: does the warning that
    its calibration no longer fits come where something has changed, and nowhere else? With --out the days are
    kept in stale_days.jsonl, and a run that was ended goes on there.

    Exit code 1 when the second is not shown to have the required accuracy, with --drift in its worst row; with
    --stale-days when a sound machine was warned of.
    """
    from gantryctl.engineering.comparison.data import comparison_data
    from gantryctl.engineering.comparison.report import compare_report
    from gantryctl.engineering.comparison.variants import variants
    from gantryctl.engineering.report.head import MeasuredBy
    from gantryctl.errors import UsageError

    _check_options(plants, drift, on_top_of, identify=identify, stale_days=stale_days)
    folder = None if out is None else directory(out)
    paper, improved = _machine(first), _machine(second)
    if paper.on_bus or improved.on_bus:
        for option, given in (("--ensemble", plants), ("--drift", drift), ("--stale-days", stale_days)):
            if given:
                raise UsageError(f"{option}: its plants are simulated, a machine on a bus is the one it is")
        stated = certificate_of(instrument, certificate)
        return _on_bus(paper, improved, instrument, stated, seed, folder, made, yes=yes, as_json=as_json)
    for option, named in (("--instrument", instrument != SIMULATED), ("--certificate", certificate)):
        if named:
            raise UsageError(f"{option}: is for a machine on a bus; simulated ones have a simulated tracker")
    if stale_days:
        return _in_use(improved, stale_days, drift, on_top_of, folder, as_json=as_json)
    if drift is not None:
        return _on_drift(
            paper, improved, drift, on_top_of, identify, seed, threads, folder, made, as_json=as_json
        )
    rows = len(variants(paper, improved)) + plants
    with metered(rows, quiet=as_json) as meter:
        report = compare_report(
            paper, improved, plants=plants, seed=seed, threads=threads, progress=meter.reach
        )
    data = comparison_data(report)
    if as_json:
        print_json(data)
    else:
        _show(report)
    if folder is not None:
        from gantryctl.engineering.comparison.page import render_comparison

        head = head_of(improved, made, MeasuredBy("simulated tracker", SIMULATED_CERTIFICATE))
        _write(folder / "compare.json", data, render_comparison(report, head), quiet=as_json)
    return int(report.verdict.passed is not True)


def _check_options(
    plants: int, drift: Path | None, on_top_of: tuple[str, ...], *, identify: bool, stale_days: int
) -> None:
    """Refuse options that do not go together: before the runs, not after them."""
    from gantryctl.errors import UsageError

    if plants == 1:
        raise UsageError("--ensemble 1: quantiles need at least 2 plants; 0 leaves the ensemble out")
    if plants and drift is not None:
        raise UsageError("--ensemble and --drift: one at a time; random plants that drift are a campaign")
    if on_top_of and drift is None:
        raise UsageError("--on-top: is for --drift; its rows are those of the drift file")
    if stale_days and (plants or identify):
        raise UsageError(
            "--stale-days: watches the calibration that there is; leave --ensemble and --identify out"
        )
    if identify and drift is None:
        raise UsageError("--identify: is for --drift; an ensemble identifies each of its plants in any case")
    # An ensemble may take hours, and each of its plants is identified.
    if plants or identify:
        need("scipy")


def _on_drift(
    paper: Machine,
    improved: Machine,
    file: Path,
    on_top_of: tuple[str, ...],
    identify: bool,
    seed: int,
    threads: int | None,
    folder: Path | None,
    made: Made,
    *,
    as_json: bool,
) -> int:
    from gantryctl.engineering.comparison.drift_file import load_drift
    from gantryctl.engineering.comparison.drift_report import drift_report, runs_of
    from gantryctl.engineering.comparison.drift_text import drift_data, notes, render_drift, tables
    from gantryctl.engineering.report.head import MeasuredBy

    drift = load_drift(file, improved).on_top(on_top_of)
    with metered(runs_of(paper, improved, drift), quiet=as_json) as meter:
        report = drift_report(
            paper, improved, drift, identify=identify, seed=seed, threads=threads, progress=meter.reach
        )
    data = drift_data(report)
    if as_json:
        print_json(data)
    else:
        for table in tables(report):
            print_table(table)
        click.echo()
        for note in notes(report):
            paragraph(note)
        _say_verdict(report.verdict)
    if folder is not None:
        head = head_of(improved, made, MeasuredBy("simulated tracker", SIMULATED_CERTIFICATE))
        _write(folder / "drift.json", data, render_drift(report, head), quiet=as_json)
    return int(report.verdict.passed is not True)


def _in_use(
    machine: Machine,
    days: int,
    file: Path | None,
    on_top_of: tuple[str, ...],
    folder: Path | None,
    *,
    as_json: bool,
) -> int:
    from gantryctl.engineering.comparison.drift_file import load_drift
    from gantryctl.engineering.comparison.stale_report import (
        FILE,
        days_of,
        stale_data,
        stale_report,
        stale_table,
    )

    drift = None if file is None else load_drift(file, machine).on_top(on_top_of)
    with metered(days_of(machine, days, drift), quiet=as_json) as meter:
        report = stale_report(machine, days, drift, folder=folder, progress=meter.reach)
    data = stale_data(report)
    if as_json:
        print_json(data)
    else:
        print_table(stale_table(report))
    if folder is not None:
        path = write_json(folder / "stale_days.json", data)
        if not as_json:
            click.echo(f"wrote {path}, {folder / FILE}")
    return int(not report.passed)


def _on_bus(
    paper: Machine,
    improved: Machine,
    place: str,
    certificate: str,
    seed: int,
    folder: Path | None,
    made: Made,
    *,
    yes: bool,
    as_json: bool,
) -> int:
    from gantryctl.engineering.accuracy.report.data import verdict_data
    from gantryctl.engineering.comparison.on_bus import bus_table, compare_on_bus, moves_text
    from gantryctl.engineering.report.head import MeasuredBy
    from gantryctl.engineering.stops import check_quick_stop

    for machine in (paper, improved):
        check_quick_stop(machine)
    with asking(improved, moves_text(improved), yes=yes) as agree:
        found = compare_on_bus(
            paper,
            improved,
            lambda run: instrument_at(place, run, seed),
            agree=agree,
            progress=None if as_json else tell,
        )
    data = {
        "instrument": found.instrument,
        "verdict": verdict_data(found.verdict),
        "rows": {name: figures._asdict() for name, figures in found.rows},
    }
    if as_json:
        print_json(data)
    else:
        print_table(bus_table(found))
        _say_verdict(found.verdict)
    if folder is not None:
        from gantryctl.engineering.comparison.page import render_bus_comparison

        head = head_of(improved, made, MeasuredBy(found.instrument, certificate))
        _write(folder / "compare.json", data, render_bus_comparison(found, head), quiet=as_json)
    return int(found.verdict.passed is not True)


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
    _say_verdict(report.verdict)


def _write(file: Path, data: object, page: str, *, quiet: bool) -> None:
    """The figures as JSON, and the report beside them."""
    path, report = write_json(file, data), write_text(file.with_name("report.html"), page)
    if not quiet:
        click.echo(f"wrote {path}, {report}")


def _say_verdict(verdict: AccuracyVerdict) -> None:
    click.echo()
    paragraph(f"{verdict.conformity.value.upper()}: {verdict.text}")
