"""`gantryctl faults`: the fault catalogue, and one fault on a simulated axis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.faults.campaign import campaign, replay, report, shrink
from gantryctl.cli.options import config_option, json_option, machine_of, print_json
from gantryctl.cli.text import print_table
from gantryctl.cli.values import FINITE, INPUT, PATH
from gantryctl.extras import need

if TYPE_CHECKING:
    from gantryctl.engineering.faults.case import FaultCase


@click.group()
def faults() -> None:
    """Inject faults into a simulated axis: list, show, run; campaign, replay, shrink, report.

    Nothing of this is loaded by a controller: on a real bus there is no injection.
    """


for command in (campaign, replay, shrink, report):
    faults.add_command(command)


@faults.command("list")
@click.option("--kinds", is_flag=True, help="List the kinds that a file of injections may have instead.")
@json_option
def list_command(kinds: bool, as_json: bool) -> None:
    """List the fault catalogue."""
    from gantryctl.engineering.faults.seams import KINDS
    from gantryctl.engineering.faults.table.table import ROWS
    from gantryctl.engineering.faults.text import catalogue_text, kinds_text, row_data

    if as_json and kinds:
        print_json(
            [
                {"where": row.place.value, "kind": row.name, "args": list(row.arguments), "words": row.words}
                for row in KINDS.values()
            ]
        )
    elif as_json:
        print_json([row_data(row) for row in ROWS.values()])
    else:
        print_table(kinds_text() if kinds else catalogue_text())


@faults.command()
@click.argument("number")
@json_option
def show(number: str, as_json: bool) -> None:
    """Show one fault of the catalogue: how it is injected, what must happen, and the tests that do it.

    As JSON: the whole row, with its variants.
    """
    from gantryctl.engineering.faults.catalogue import fault_row
    from gantryctl.engineering.faults.text import fault_lines, row_data

    if as_json:
        print_json(row_data(fault_row(number)))
    else:
        click.echo("\n".join(fault_lines(number)))


@faults.command()
@config_option
@click.option("--fault", "number", help="Number of the catalogue, e.g. A2.")
@click.option("--file", "file", type=INPUT, help="Injections of a TOML or JSON file instead.")
@click.option(
    "--speed",
    type=FINITE,
    help="Speed in deg/s; a minus turns the other way. The highest setting when not given.",
)
@click.option(
    "--angle",
    type=FINITE,
    help="Angle in deg at which the fault begins. Where the eccentric moment is largest when not given.",
)
@click.option("--scan", type=FINITE, help="Scan period in ms. That of the machine when not given.")
@click.option("--moment", type=FINITE, help="Eccentric moment in kN m. That of the machine when not given.")
@click.option("--bus", is_flag=True, help="Use the virtual drive behind a CANopen bus.")
@click.option(
    "--brake-owner",
    type=click.Choice(("drive", "object_60FE")),
    default="drive",
    show_default=True,
    help="Who closes the brake of a drive on a bus; beside an I/O node it is an output of that.",
)
@click.option("--out", "out", type=PATH, help="Picture of the run, .png or .svg.")
@json_option
def run(
    config_file: Path | None,
    number: str | None,
    file: Path | None,
    speed: float | None,
    angle: float | None,
    scan: float | None,
    moment: float | None,
    bus: bool,
    brake_owner: str,
    out: Path | None,
    as_json: bool,
) -> int:
    """Run one fault in virtual time, and judge way, alarm and words by the true plant.

    Exit code 1 when something is not as it must be.
    """
    from gantryctl.engineering.faults.run import FaultRun, run_fault
    from gantryctl.engineering.faults.text import result_data, result_lines
    from gantryctl.files import check_place

    if out is not None:
        need("matplotlib")
        check_place(out)
    case = _case(number, file)
    result = run_fault(
        FaultRun(
            case,
            machine=None if config_file is None else machine_of(config_file),
            kind="bus" if bus else "sim",
            brake_owner="object_60FE" if brake_owner == "object_60FE" else "drive",
            speed_deg_s=speed,
            angle_deg=angle,
            scan_ms=scan,
            eccentric_knm=moment,
        )
    )
    title = f"{case.number}: {case.title}"
    if out is not None:
        from gantryctl.engineering.faults.figure import draw_fault

        drive = f"bus, brake by {result.brake_owner}" if bus else "simulated drive"
        run_at = f"{result.speed_deg_s:g} deg/s at {result.angle_deg:g} deg, scan {result.scan_ms:g} ms"
        draw_fault(result, f"{title} - {run_at}, {drive}", out)
    if as_json:
        print_json(result_data(result))
    else:
        click.echo("\n".join((title, *result_lines(result))))
        if out is not None:
            click.echo(f"picture: {out}")
    return int(not result.ok)


def _case(number: str | None, file: Path | None) -> FaultCase:
    """The row that was asked for, or one around the injections of a file, of which nothing is demanded.

    Raises:
        UsageError: neither or both, an unknown number, or a wrong file.
    """
    from gantryctl.engineering.faults.case import FaultCase, ReactionClass
    from gantryctl.engineering.faults.catalogue import fault_case
    from gantryctl.engineering.faults.injection import load_injections
    from gantryctl.errors import UsageError

    if (number is None) is (file is None):
        raise UsageError("give --fault or --file, one of the two")
    if number is not None:
        return fault_case(number)
    assert file is not None
    return FaultCase(
        number="file",
        title=file.name,
        detected_by="-",
        reaction=ReactionClass.NONE,
        injections=load_injections(file),
        judged=False,
    )
