"""`gantryctl faults campaign|replay|shrink|report`: many scenarios with faults, and one of them again."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import json_option, print_json, write_text
from gantryctl.cli.values import FINITE, INPUT, PATH, Whole
from gantryctl.cli.workers import ended_in_order, pool_of
from gantryctl.extras import need
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from collections.abc import Callable

    from gantryctl.engineering.fault_campaign.kinds import FaultCampaign
    from gantryctl.engineering.fault_campaign.scenario import Scenario
    from gantryctl.engineering.faults.run import DriveKind

_SEEDS = Whole(0, 2**40)


def _campaign_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options that say which campaign."""
    for option in (
        click.option(
            "--drive",
            type=click.Choice(("sim", "bus")),
            help="Leave out the runs on the other drive: simulated in process, or virtual behind a bus; both when not "
            "given. With `axes` and `axis-pairs` the drive of all runs, the simulated one when not given.",
        ),
        click.option(
            "--scan",
            type=FINITE,
            help="Scan period in ms, of every scenario, or of the cells of the matrix that are wanted; drawn, or all, "
            "when not given.",
        ),
        click.option(
            "--series", type=_SEEDS, default=1, show_default=True, help="Other scenarios of the kind."
        ),
        click.option(
            "--kind",
            type=click.Choice(("random", "pairs", "wide", "axes", "axis-pairs", "matrix")),
            default="random",
            show_default=True,
            help="Drawn scenarios, forced pairs of faults, drawn ones on gantries further away or on other axes, "
            "forced pairs at a moment of a motion on other axes, or each fault in each phase.",
        ),
    ):
        command = option(command)
    return command


def _campaign(kind: str, series: int, scan: float | None, drive: DriveKind | None) -> FaultCampaign:
    from gantryctl.engineering.fault_campaign.kinds import campaign_of

    return campaign_of(kind, series, scan, drive)


@click.command()
@_campaign_options
@click.option("--first", type=_SEEDS, default=0, show_default=True, help="First seed.")
@click.option("--count", type=Whole(1, 2**40), default=5000, show_default=True, help="Number of seeds.")
@click.option("--out", "out", type=PATH, help="Folder of the result; faults_KIND.result when not given.")
@click.option("--workers", type=Whole(1, 1024), help="Processes; one per processor when not given.")
@click.option("--cluster", help="Dask scheduler instead, such as tcp://10.0.0.1:8786.")
@json_option
def campaign(
    kind: str,
    series: int,
    scan: float | None,
    drive: DriveKind | None,
    first: int,
    count: int,
    out: Path | None,
    workers: int | None,
    cluster: str | None,
    as_json: bool,
) -> int:
    """Play many scenarios with faults, each judged by the true plant, and keep a row of each.

    Goes on where it was ended: a seed that is in the folder is not played again. Exit code 1 when something broke, now
    or in an earlier call, or seeds are missing at the end; `gantryctl faults replay SEED` tells what happened in one.
    """
    import os
    from datetime import UTC, datetime

    from gantryctl.engineering.fault_campaign.run import run_fault_campaign
    from gantryctl.engineering.scheduler.job import Chunk

    need(*(["distributed"] if cluster else []))
    folder = out or Path(f"faults_{kind}.result")
    processes = workers or os.cpu_count() or 1
    # Work of Python: threads would wait for each other, and the oracle is of a process. One needs no other process.
    alone = processes == 1 and cluster is None
    pool = pool_of(1 if alone else None, None if alone or cluster else processes, cluster)
    with ended_in_order() as stopped:
        end = run_fault_campaign(
            _campaign(kind, series, scan, drive),
            folder,
            Chunk(first, count),
            pool,
            say=_nothing if as_json else tell,
            now_s=time.monotonic,
            today=lambda: datetime.now(UTC),
            stopped=stopped,
        )
    if as_json:
        print_json({**end._asdict(), "complete": end.complete, "result": str(folder)})
    else:
        what = "all" if end.complete else f"{end.there} of"
        click.echo(
            f"{folder}: {what} {end.asked} runs are there, broken {end.broken_there}; played now {end.played}, broken "
            f"{end.broken}"
        )
    return int(not end.complete or end.broken_there > 0)


@click.command()
@click.argument("seed", type=_SEEDS, required=False)
@_campaign_options
@click.option("--file", "file", type=INPUT, help="Scenario of a TOML file instead.")
@click.option("--out", "out", type=PATH, help="Picture from the first fault on, .png or .svg.")
@click.option("--toml", "as_toml", is_flag=True, help="Print the scenario as a file instead of playing it.")
@json_option
def replay(
    seed: int | None,
    kind: str,
    series: int,
    scan: float | None,
    drive: DriveKind | None,
    file: Path | None,
    out: Path | None,
    as_toml: bool,
    as_json: bool,
) -> int:
    """Play one scenario, or one cell of the matrix, again, and tell what happened.

    The same seed, or the same file, gives the same trace bit by bit: its hash is printed. Exit code 1 when something
    broke.
    """
    from gantryctl.engineering.fault_campaign.play import play
    from gantryctl.engineering.fault_campaign.scenario import scenario_toml
    from gantryctl.engineering.fault_campaign.text import played_data, played_lines, scenario_words, watched
    from gantryctl.errors import UsageError
    from gantryctl.files import check_place

    if kind == "matrix" and file is None and seed is not None:
        if as_toml or out is not None:
            raise UsageError(
                "a cell of the matrix has no scenario file and no picture: leave out --toml and --out"
            )
        return _replay_cell(seed, as_json)
    if out is not None:
        need("matplotlib")
        check_place(out)
    scenario = _scenario(seed, kind, series, scan, drive, file)
    if as_toml:
        click.echo(scenario_toml(scenario), nl=False)
        return 0
    played = play(scenario, record=out is not None)
    if out is not None and not played.refused:
        from gantryctl.engineering.faults.figure import draw_fault

        draw_fault(watched(played), f"{scenario.label} - {scenario_words(scenario)}", out)
    if as_json:
        print_json(played_data(played))
    else:
        click.echo("\n".join(played_lines(played)))
        if out is not None:
            click.echo(f"picture: {out}")
    return int(not played.ok)


def _replay_cell(number: int, as_json: bool) -> int:
    from gantryctl.engineering.fault_campaign.matrix import cell, run_cell
    from gantryctl.engineering.fault_campaign.text import cell_data, cell_lines

    at = cell(number)
    row = run_cell(at)
    if as_json:
        print_json(cell_data(at, row))
    else:
        click.echo("\n".join(cell_lines(at, row)))
    return int(bool(row["violations"]))


@click.command()
@click.argument("seed", type=_SEEDS, required=False)
@_campaign_options
@click.option("--file", "file", type=INPUT, help="Scenario of a TOML file instead.")
@click.option(
    "--trials", type=Whole(1, 100_000), default=300, show_default=True, help="Scenarios to play at most."
)
@json_option
def shrink(
    seed: int | None,
    kind: str,
    series: int,
    scan: float | None,
    drive: DriveKind | None,
    file: Path | None,
    trials: int,
    as_json: bool,
) -> None:
    """Make a scenario that broke something as small as it gets, and print it as a file.

    Faults, deeds of the person, digits and whatever else can go is left out as long as the same invariant breaks.
    `gantryctl faults replay --file` plays what is left.
    """
    from gantryctl.engineering.fault_campaign.scenario import scenario_toml
    from gantryctl.engineering.fault_campaign.shrink import shrink as make_small
    from gantryctl.engineering.fault_campaign.text import played_data

    found = make_small(
        _scenario(seed, kind, series, scan, drive, file), _nothing if as_json else tell, trials
    )
    if as_json:
        print_json({"invariant": found.invariant, "trials": found.trials, **played_data(found.played)})
        return
    for violation in found.played.violations:
        click.echo(f"# {violation}")
    click.echo(scenario_toml(found.played.scenario), nl=False)


@click.command()
@click.argument("results", type=PATH, nargs=-1, required=True)
@click.option("--page", type=PATH, help="Write the page (Markdown) there.")
@click.option(
    "--evidence",
    type=PATH,
    default=Path("docs/evidence"),
    show_default=True,
    help="Folder with mutation.json and branch_coverage.json.",
)
@click.option("--replay", "again", is_flag=True, help="Play what broke once more: does it still break?")
@json_option
def report(results: tuple[Path, ...], page: Path | None, evidence: Path, again: bool, as_json: bool) -> None:
    """Count what campaigns have shown: runs, worst way of each fault, nuisances, planted bugs, branches."""
    from gantryctl.engineering.fault_campaign.report import replayed, report_data, report_page, tally
    from gantryctl.engineering.fault_campaign.result import FaultResult

    tallies = [tally(FaultResult.read(folder)) for folder in results]
    if again:
        for each in tallies:
            replayed(each, _nothing if as_json else tell)
    text = report_page(tallies, evidence)
    written = None if page is None else write_text(page, text)
    if as_json:
        print_json({"campaigns": report_data(tallies), "written": [] if written is None else [str(written)]})
    else:
        click.echo(text if written is None else f"wrote {written}", nl=written is not None)


def _nothing(line: str) -> None:
    """A program that reads JSON wants no progress."""


def _scenario(
    seed: int | None, kind: str, series: int, scan: float | None, drive: DriveKind | None, file: Path | None
) -> Scenario:
    """The scenario that was asked for.

    Raises:
        UsageError: neither seed nor file, or both; a cell of the matrix, which is no scenario; or a seed that the other
            options leave out.
    """
    from gantryctl.engineering.fault_campaign.scenario import load_scenario
    from gantryctl.errors import UsageError

    if (seed is None) is (file is None):
        raise UsageError("give a seed or --file, one of the two")
    if file is not None:
        return load_scenario(file)
    assert seed is not None
    if kind == "matrix":
        raise UsageError(
            "a cell of the matrix is one run of a row, with nothing to leave out: gantryctl faults replay"
        )
    campaign = _campaign(kind, series, scan, drive)
    scenario = campaign.scenario(seed)
    if reason := campaign.left_out(scenario.drive, scenario.scan_ms):
        raise UsageError(f"seed {seed} is on drive {scenario.drive}, {reason}: leave out --drive")
    return scenario
