"""`gantryctl campaign`: figures of many plants that differ at random."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import directory, json_option, number_option, print_json, write_text
from gantryctl.cli.report import report_options
from gantryctl.cli.text import paragraph, print_table
from gantryctl.cli.values import INPUT, PATH, Whole
from gantryctl.cli.workers import ended_in_order, pool_of
from gantryctl.extras import need
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.engineering.campaign.statistics import Population
    from gantryctl.engineering.report.head import Made

_RESULTS = click.argument("results", type=PATH, nargs=-1, required=True)
_BY = click.option("--by", "by", help="Split by the values of a key, such as plant.gear_error.scale.")


@click.group()
def campaign() -> None:
    """Figures of many plants: run, show, plot, compare, plan.

    A campaign file (TOML) says what varies, how plants are drawn and what is measured. It runs on threads, on processes
    or on a Dask cluster, with the same result, and goes on where it was interrupted.
    """


@campaign.command()
@click.argument("file", type=INPUT)
@click.option("--out", "out", type=PATH, help="Folder of the result; NAME.result when not given.")
@click.option("--threads", type=Whole(1, 1024), help="Threads; one per processor when not given.")
@click.option("--workers", type=Whole(1, 1024), help="Processes instead of threads.")
@click.option("--cluster", help="Dask scheduler instead, such as tcp://10.0.0.1:8786.")
@json_option
def run(
    file: Path, out: Path | None, threads: int | None, workers: int | None, cluster: str | None, as_json: bool
) -> int:
    """Compute the rows of a campaign that its result does not have yet.

    FILE is a campaign file or the name of a shipped one. Ctrl-C ends it when the chunks under way are done, a second
    one at once; the same command goes on. Exit code 1 when rows are missing at the end.
    """
    from gantryctl.engineering.campaign.reading import load_campaign
    from gantryctl.engineering.campaign.run import run_campaign, survey

    need("scipy", *(["distributed"] if cluster else []))
    order = load_campaign(file)
    folder = out or Path(f"{order.name}.result")
    pool = pool_of(threads, workers, cluster)
    tried, refused = survey(order)
    for name, count in refused.most_common():
        tell(f"of the first {tried} plants the checks of the machine refuse {count}: {name}")
    with ended_in_order() as stopped:
        end = run_campaign(order, folder, pool, say=tell, now_s=time.monotonic, stopped=stopped)
    if as_json:
        print_json(
            {**end._asdict(), "complete": end.complete, "refused_first": dict(refused), "result": str(folder)}
        )
    elif end.complete:
        click.echo(f"{folder}: all {end.rows} rows are there; gantryctl campaign show {folder}")
    else:
        click.echo(f"{folder}: {end.there} of {end.rows} rows are there; the same command goes on")
    return int(not end.complete)


@campaign.command()
@click.argument("result", type=PATH)
@_BY
@json_option
def show(result: Path, by: str | None, as_json: bool) -> None:
    """Show quantiles, probabilities of keeping the limits, and Sobol indices of a result."""
    from gantryctl.engineering.campaign.report.data import population_data
    from gantryctl.engineering.campaign.report.text import lines, tables

    parts = _populations((result,), by)
    if as_json:
        data = [population_data(found) for _, found in parts]
        print_json(data if by else data[0])
        return
    for table in tables(parts):
        print_table(table)
    click.echo()
    for line in lines(parts[0][1]):
        paragraph(line)


@campaign.command()
@_RESULTS
@_BY
@click.option("--out", "out", type=PATH, default=Path(), help="Folder for the page.")
@report_options
@json_option
def plot(results: tuple[Path, ...], by: str | None, out: Path, as_json: bool, made: Made) -> None:
    """Write one HTML page with the figures of one result, or of several beside each other."""
    from gantryctl.engineering.campaign.report.page import render_populations

    page = write_text(directory(out) / "campaign.html", render_populations(_populations(results, by), made))
    if as_json:
        print_json({"written": [str(page)]})
    else:
        click.echo(f"wrote {page}")


@campaign.command()
@_RESULTS
@json_option
def compare(results: tuple[Path, ...], as_json: bool) -> None:
    """Show quantiles and probabilities of several results below each other."""
    from gantryctl.engineering.campaign.report.data import population_data
    from gantryctl.engineering.campaign.report.text import lines, tables

    populations = _populations(results, None)
    if as_json:
        print_json({"results": {name: population_data(found) for name, found in populations}})
        return
    for table in tables(populations):
        print_table(table)
    click.echo()
    for _, found in populations:
        for line in lines(found):
            paragraph(line)


@campaign.command()
@click.argument("file", type=INPUT)
@click.option(
    "--plants", type=Whole(1), default=100_000_000, show_default=True, help="Plants to reckon with."
)
@click.option("--cores", type=Whole(1), default=320, show_default=True, help="Cores of the cluster.")
@number_option(("--price",), 0.04, "Price of a core for an hour.")
@number_option(("--measure",), 5.0, "Seconds of computing that the rate is measured with.")
@json_option
def plan(file: Path, plants: int, cores: int, price: float, measure: float, as_json: bool) -> None:
    """Reckon time, bytes and cost of a large campaign from rows that are computed here, on one core."""
    from gantryctl.engineering.campaign.plan import plan_campaign
    from gantryctl.engineering.campaign.reading import load_campaign

    found = plan_campaign(load_campaign(file), plants, cores, price, measure)
    if as_json:
        print_json(found._asdict())
        return
    click.echo(f"one plant     {1e3 * found.row_s:.1f} ms of one core here, by {found.rows_measured} plants")
    click.echo(f"{found.plants:.3g} plants  {found.core_hours:.0f} core hours, cost {found.cost:.0f}")
    click.echo(f"{found.cores} cores     {found.time_s / 3600.0:.1f} h, if each is as fast as this one")
    click.echo(f"result        {found.bytes / 1e9:.2f} GB in {found.files} files")
    click.echo(f"tasks         {found.chunks}, {100.0 * found.overhead:.2f} % of the time")


def _populations(paths: tuple[Path, ...], by: str | None) -> list[tuple[str, Population]]:
    """Results with their names, or the parts of one."""
    from gantryctl.engineering.campaign.result import ResultFolder
    from gantryctl.engineering.campaign.statistics import parts_of, population_of
    from gantryctl.errors import UsageError

    if by is None:
        return [(str(path), population_of(ResultFolder(path))) for path in paths]
    if len(paths) > 1:
        raise UsageError("--by: splits one result; give one, or leave --by out")
    return parts_of(ResultFolder(paths[0]), by)
