"""`gantryctl stops`: every stop class on the full plant."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import (
    config_option,
    directory,
    json_option,
    machine_of,
    out_option,
    print_json,
    write_text,
)
from gantryctl.cli.report import head_of, report_options
from gantryctl.cli.text import paragraph, print_table
from gantryctl.cli.values import FINITE

if TYPE_CHECKING:
    from gantryctl.engineering.report.head import Made
    from gantryctl.machine import Machine


@click.command()
@config_option
@click.option("--speed", "speeds", type=FINITE, multiple=True, help="Speed in deg/s; may be repeated.")
@click.option(
    "--find-quick", is_flag=True, help="Find the largest quick-stop deceleration instead, and certify one."
)
@out_option
@report_options
@json_option
def stops(
    config_file: Path | None,
    speeds: tuple[float, ...],
    find_quick: bool,
    out: Path | None,
    as_json: bool,
    made: Made,
) -> int:
    """Show what every stop costs: normal ramp, jog release, quick stop, torque off + brake.

    With the compensations of the machine. --find-quick finds the largest quick stop of the machine file's plant, how
    heavy the load may be for the quick stop of the file, and certifies one, with its highest speed, over
    [plant.uncertainty].

    With --out a report as well. Exit code 1 when a stop class is worse than the machine file permits.
    """
    from gantryctl.errors import UsageError

    machine = machine_of(config_file)
    # Speeds above the setting are no stops of this machine.
    for speed in speeds:
        if not 0.0 < speed <= machine.speed.setting_max_deg_s:
            raise UsageError(
                f"--speed {speed:g}: must be above 0 and at most {machine.speed.setting_max_deg_s:g} deg/s "
                "([speed] setting_max_deg_s)"
            )
    if find_quick and speeds:
        raise UsageError("--find-quick finds the highest speed itself: leave out --speed")
    if find_quick and out is not None:
        raise UsageError("--find-quick finds one value and writes no report: leave out --out")
    return _find(machine, as_json) if find_quick else _table(machine, speeds, out, as_json, made)


def _find(machine: Machine, as_json: bool) -> int:
    from gantryctl.engineering.stops.certify import find_quick_stops
    from gantryctl.engineering.stops.data import quick_stops_data
    from gantryctl.engineering.stops.text import certificate_lines

    found = find_quick_stops(machine)
    if as_json:
        print_json(quick_stops_data(machine, found))
        return 0
    for line in certificate_lines(machine, found):
        click.echo(line)
    return 0


def _table(machine: Machine, speeds: tuple[float, ...], out: Path | None, as_json: bool, made: Made) -> int:
    from gantryctl.engineering.stops import stop_table
    from gantryctl.engineering.stops.data import stops_data
    from gantryctl.engineering.stops.measured import measured_stops
    from gantryctl.engineering.stops.page import quick_within, render_stops
    from gantryctl.engineering.stops.text import key_lines, stops_notes, stops_text, watch_lines
    from gantryctl.operation.store import state_root

    rows = stop_table(machine, speeds or None)
    measured = measured_stops(machine, state_root() / machine.name) if machine.on_bus else None
    if as_json:
        print_json(stops_data(machine, rows, measured))
    else:
        print_table(stops_text(rows))
        for line in (*stops_notes(machine, measured), *key_lines(machine, rows), *watch_lines(machine, rows)):
            paragraph(line)
    if out is not None:
        page = write_text(
            directory(out) / "report.html", render_stops(machine, rows, measured, head_of(machine, made))
        )
        click.echo(f"report: {page.resolve()}", err=as_json)
    return int(not quick_within(machine, rows))
