"""`gantryctl drive`: drives on a bus. Every command but `sim` and `restore` only reads, `save` lets the drive store."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.drive.drive_sim import sim
from gantryctl.cli.drive.field import field
from gantryctl.cli.drive.gains import gains
from gantryctl.cli.drive.node import drive_node
from gantryctl.cli.drive.profiles import profiles
from gantryctl.cli.drive.saving import save
from gantryctl.cli.options import bus_log_option, config_option, confirm, json_option, print_json, write_text
from gantryctl.cli.values import INPUT, PATH

if TYPE_CHECKING:
    from gantryctl.drives.od.model import DeviceDescription
    from gantryctl.machine import Machine


@click.group()
def drive() -> None:
    """Drives on a CANopen bus."""


drive.add_command(sim)
drive.add_command(field)
drive.add_command(profiles)
drive.add_command(gains)
drive.add_command(save)


@drive.command()
@bus_log_option
@config_option
@json_option
def status(config_file: Path | None, as_json: bool) -> int:
    """Show identity, state, mode, error and position of the drive, and the telegrams of its last run."""
    from gantryctl.drives.canopen.cia402 import decode_statusword
    from gantryctl.drives.canopen.emergency import emergency_text
    from gantryctl.operation.store import last_bus

    with drive_node(config_file) as (node, settings, machine):
        who, sdo = node.identity(), node.sdo
        word = sdo.number(0x6041)
        # 603F and 6061 are not in every drive: None then.
        error = sdo.optional(0x603F)
        found = {
            "node": settings.node,
            "name": who.name,
            "software": who.software,
            "key": who.key,
            "state": decode_statusword(word).name,
            "statusword": word,
            "mode": sdo.optional(0x6061),
            "error_code": error,
            "error": emergency_text(error) if error else "",
            "position_increments": sdo.number(0x6064),
        }
    # No telegrams are exchanged here: what the last run has counted is kept with the machine's state.
    last = last_bus(machine)
    found["last_run"] = None if last is None else last._asdict()
    if as_json:
        print_json(found)
        return 0
    click.echo(f"node {settings.node}: {who.text} ({who.key})")
    click.echo(
        f"  state     {decode_statusword(word).name.lower().replace('_', ' ')} (statusword {word:04X}h)"
    )
    mode = f"{found['mode']} (9 = cyclic synchronous velocity)"
    click.echo(f"  mode      {'unknown: the drive does not give 6061' if found['mode'] is None else mode}")
    click.echo(f"  error     {found['error'] or '-'}")
    click.echo(f"  position  {found['position_increments']} increments")
    for line in () if last is None else (f"until {last.ended}", *last.lines):
        click.echo(f"  last run  {line}")
    return 0


@drive.command()
@bus_log_option
@config_option
@json_option
def diff(config_file: Path | None, as_json: bool) -> int:
    """Compare the parameters that decide what happens when something breaks: want, have, verdict; only reads.

    Exit code 1 when one of them differs. Before it enables, the controller writes them itself.
    """
    from gantryctl.drives.canopen.setup.opening import facts_as_found, parameter_rows

    # The same table by which a controller refuses to enable a drive (CFG-CAN-01).
    with drive_node(config_file) as (node, settings, _):
        rows = parameter_rows(settings, facts_as_found(node, settings)[1])
    if as_json:
        print_json([{**row._asdict(), "verdict": row.verdict.value} for row in rows])
    else:
        for row in rows:
            mark = "  " if not row.verdict.refuses else "! "
            click.echo(
                f"{mark}{row.place}  {row.name:32} want {row.want:18} have {row.have:18} {row.verdict.value}"
            )
    return int(any(row.verdict.refuses for row in rows))


@drive.command()
@bus_log_option
@config_option
@click.option("--eds", "eds_file", type=INPUT, help="Which objects there are; [can] eds when not given.")
@json_option
def objects(config_file: Path | None, eds_file: Path | None, as_json: bool) -> int:
    """Read the objects of an EDS from the drive; without one, those of a CSV axis."""
    from gantryctl.drives.canopen.setup.parameters import read_objects

    with drive_node(config_file) as (node, _, machine):
        found = read_objects(node.sdo, _entries(machine, eds_file))
    if as_json:
        print_json([value._asdict() for value in found])
    else:
        for value in found:
            click.echo(f"{value.obj:04X}:{value.sub:02X}  {value.name:40} {value.shown}")
    return 0


@drive.command()
@bus_log_option
@config_option
@click.option("--eds", "eds_file", type=INPUT, help="Which objects there are; [can] eds when not given.")
@click.argument("file", type=PATH)
def backup(config_file: Path | None, eds_file: Path | None, file: Path) -> int:
    """Read every writable object from the drive into FILE (JSON)."""
    from gantryctl.drives.canopen.setup.parameters import backup as read_all

    with drive_node(config_file) as (node, _, machine):
        kept = read_all(node, _entries(machine, eds_file))
    write_text(file, json.dumps(kept, indent=1) + "\n")
    click.echo(f"wrote {file}: {len(kept['values'])} values of {kept['drive']}")
    return 0


@drive.command()
@bus_log_option
@config_option
@click.option("--yes", is_flag=True, help="Do not ask.")
@click.argument("file", type=INPUT)
def restore(config_file: Path | None, yes: bool, file: Path) -> int:
    """Write the values of a backup to the drive and read them back; refused while it is enabled.

    Values that the drive refuses are listed, with exit code 1. The drive forgets them at power off: see `save`.
    """
    from gantryctl.drives.canopen.setup.parameters import restore as write_all

    # Read before the question: a file that is no backup is refused without one.
    kept = _backup_file(file)
    if not yes:
        confirm(f"write {len(kept['values'])} values of {kept['drive']} to the drive?", "nothing is written")
    with drive_node(config_file) as (node, _, _machine):
        failed = write_all(node, kept)
    for line in failed:
        click.echo(f"! {line}")
    click.echo(f"{len(kept['values']) - len(failed)} of {len(kept['values'])} values are in the drive")
    return int(bool(failed))


def _entries(machine: Machine, eds_file: Path | None) -> DeviceDescription | None:
    from gantryctl.drives.od.reading import read_eds

    path = eds_file or (Path(machine.can.eds) if machine.can.eds else None)
    return None if path is None else read_eds(path, machine.can.node)


def _backup_file(file: Path) -> dict[str, Any]:
    from gantryctl.drives.canopen.setup.parameters import check_backup
    from gantryctl.errors import UsageError

    try:
        return check_backup(json.loads(file.read_text(encoding="utf-8-sig")))
    except OSError as fault:
        raise UsageError(f"{file}: cannot be read: {fault.strerror or fault}") from None
    except (ValueError, RecursionError) as fault:
        raise UsageError(f"{file}: is no backup of a drive: {fault}") from None
