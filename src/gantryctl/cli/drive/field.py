"""`gantryctl drive field`: how many drives, as they are sold, this controller can commission."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import config_option, json_option, machine_of, print_json
from gantryctl.cli.values import INPUT, Whole

if TYPE_CHECKING:
    from gantryctl.commissioning.field import FieldDrive


@click.command("field")
@config_option
@click.option(
    "--objects",
    "file",
    type=INPUT,
    help="EDS, DCF or object table (CSV); the delivered table when not given.",
)
@click.option("--drive", "model", default="", help="Only the drive whose name begins so.")
@click.option("--short", is_flag=True, help="Without the steps that need the whole travel; then none counts.")
@click.option(
    "--least", type=Whole(0), default=0, help="Exit code 1 when fewer can be commissioned as they are."
)
@json_option
def field(
    config_file: Path | None, file: Path | None, model: str, short: bool, least: int, as_json: bool
) -> int:
    """Commission virtual drives with the object dictionaries of real ones, in virtual time, and count them.

    Each drive has the axis of --config behind it. A drive that is refused is told with the missing object and why
    nothing makes up for it; one that is refused only because it does not watch its controller is tried again with a
    node beside it that holds its hardware enable, and counted on its own. About a minute for each drive.
    """
    from gantryctl.commissioning.field import commission_field_drive
    from gantryctl.drives.od.object_table import chosen, read_object_tables, read_objects_of
    from gantryctl.machine import default_machine_path
    from gantryctl.wiring.virtual import shipped_objects

    base = machine_of(config_file or default_machine_path().parent / "hust_can.toml")
    path = file or shipped_objects()
    if path.suffix.lower() != ".csv":
        only = read_objects_of(path)
        known = {only.drive: only}
    else:
        known = read_object_tables(path)
    tables = [chosen(known, model, path)] if model else list(known.values())
    found = []
    for table in tables:
        if not as_json:
            click.echo(f"{table.drive}: {'short' if short else 'whole'} commissioning")
        say = (lambda line: None) if as_json else click.echo
        for watchdog in (False, True):
            tried = commission_field_drive(
                base, table, str(file or ""), say, whole=not short, watchdog=watchdog
            )
            found.append((tried, watchdog))
            if not as_json:
                _print(tried, short)
            if not tried.needs_watchdog:
                break
            if not as_json:
                click.echo(f"{table.drive}: with a watchdog node")
    alone = sum(drive.commissioned for drive, watchdog in found if not watchdog)
    beside = sum(drive.commissioned for drive, watchdog in found if watchdog)
    if as_json:
        drives = [{**_data(drive), "watchdog_node": watchdog} for drive, watchdog in found]
        print_json({"commissioned": alone, "with_watchdog_node": beside, "drives": drives})
    elif short:
        passed = sum(not drive.refused for drive, _ in found)
        click.echo(f"\n{passed} of {len(tables)} drives pass the steps that need no whole turn")
    else:
        click.echo(
            f"\n{alone} of {len(tables)} drives can be commissioned, {beside} more with a watchdog node beside them"
        )
    return int(alone < least)


def _print(drive: FieldDrive, short: bool) -> None:
    if drive.refused:
        click.echo("  REFUSED")
        for reason in drive.refused:
            click.echo(f"    {reason}")
        return
    click.echo("  what was done has passed" if short else "  COMMISSIONED")
    for row in drive.made_up:
        click.echo(f"    {row.text}")
    for row in drive.to_accept:
        click.echo(f"    to be accepted by name: {row.what} ({row.detail})")


def _data(drive: FieldDrive) -> dict[str, object]:
    return {
        "drive": drive.drive,
        "profile": drive.profile,
        "commissioned": drive.commissioned,
        "steps": {key: outcome.value for key, outcome in drive.steps},
        "refused": list(drive.refused),
        "made_up": [row.text for row in drive.made_up],
        "to_accept": [row.what for row in drive.to_accept],
    }
