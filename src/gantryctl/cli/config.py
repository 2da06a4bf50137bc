"""`gantryctl config`: write, check, show and compare machine files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.drafting import check_name, drafted, gears_option, motor_option, report, write_new
from gantryctl.cli.editing import check_whole, set_value
from gantryctl.cli.options import json_option, print_json
from gantryctl.cli.values import INPUT, PATH, Whole

if TYPE_CHECKING:
    from gantryctl.machine import Machine
    from gantryctl.operation.ledger import LedgerRow

DEFAULT_DEST = "machine.toml"


@click.group()
def config() -> None:
    """Write, check, show, change and compare machine files."""


config.add_command(set_value)


@config.command()
@click.argument("dest", type=PATH, default=DEFAULT_DEST)
@click.option("--force", is_flag=True, help="Overwrite DEST.")
@click.option(
    "--improved",
    is_flag=True,
    help="The same machine under better control, with its calibration file beside it.",
)
@click.option(
    "--can",
    "interface",
    metavar="INTERFACE",
    help="The same machine behind a CANopen drive on this interface of python-can: socketcan, pcan, udp_multicast ...",
)
@click.option("--channel", default="", help="With --can: can0, PCAN_USBBUS1 ...")
@click.option("--node", type=Whole(1, 127), default=2, show_default=True, help="With --can: node id.")
@click.option(
    "--sheet", "sheet_path", type=INPUT, help="A machine of your own, drafted from this requirement sheet."
)
@motor_option
@gears_option
@json_option
def init(
    dest: Path,
    force: bool,
    improved: bool,
    interface: str | None,
    channel: str,
    node: int,
    sheet_path: Path | None,
    motor_files: tuple[Path, ...],
    gears: int,
    as_json: bool,
) -> None:
    """Write the reference machine's file to DEST, to edit from there (default: machine.toml); its name is DEST's.

    With --sheet a whole machine file that follows from the sheet and the smallest motor that fits it; every value that
    is still a guess is listed, and what 95 % of --gears random gears of the sheet's grade keep beside what is required.
    `gantryctl new` asks for what a sheet needs.
    """
    from gantryctl.errors import UsageError
    from gantryctl.machine import default_machine_path

    if sheet_path is not None:
        if improved or interface is not None:
            raise UsageError(
                "--sheet: goes with neither --improved nor --can; those are the reference machine's"
            )
        _draft(dest, sheet_path, motor_files, gears, force, as_json)
        return
    if motor_files:
        raise UsageError("--motor: goes with --sheet only; the reference machine has its motor")
    if improved and interface is not None:
        raise UsageError(
            "--improved and --can: one of them; a CAN machine is improved after it is commissioned"
        )
    source = default_machine_path()
    if interface is not None:
        _write_can(dest, force, {"interface": f'"{interface}"', "channel": f'"{channel}"', "node": str(node)})
        _print_written([dest], f"next: gantryctl can scan --config {dest}", as_json)
        return
    if improved:
        source = source.with_name("hust_improved.toml")
    if dest.is_dir():
        dest = dest / source.name
    written = [dest]
    if improved:
        calibration = source.with_name("hust_improved.calibration.toml")
        written.append(dest.with_name(calibration.name))
        _copy(calibration, written[-1], force)
    _write(_named(source.read_text(encoding="utf-8"), dest), dest, force)
    _print_written(written, f"check it with `gantryctl config check {dest}`", as_json)


def _print_written(written: list[Path], then: str, as_json: bool) -> None:
    from gantryctl.machine.schema import put_schemas

    schemas = put_schemas(written)
    if as_json:
        print_json({"written": [str(path) for path in (*written, *schemas)]})
        return
    click.echo(f"wrote {written[0]}; {then}")


def _draft(
    dest: Path, sheet_path: Path, motor_files: tuple[Path, ...], gears: int, force: bool, as_json: bool
) -> None:
    """Machine file from a sheet; its name is that of the file."""
    from gantryctl.engineering.drafting.open_items import gears_of_grade
    from gantryctl.engineering.drafting.writing import machine_text
    from gantryctl.engineering.sizing.loading import load_sheet
    from gantryctl.engineering.sizing.motors import is_motor_file
    from gantryctl.errors import UsageError

    if dest.is_dir():
        dest = dest / DEFAULT_DEST
    check_name(dest.stem, "DEST")
    if is_motor_file(sheet_path):
        raise UsageError(f"--sheet {sheet_path}: is a motor file; a requirement sheet is wanted")
    made = drafted(load_sheet(sheet_path), motor_files, dest.stem)
    schemas = write_new({dest: machine_text(made)}, force)
    report(made, gears_of_grade(made, gears) if gears else None, [dest], schemas, None, as_json)


def _write_can(dest: Path, force: bool, values: dict[str, str]) -> None:
    """The CAN machine with other values in [can], its comments kept."""
    from gantryctl.errors import UsageError
    from gantryctl.machine import default_machine_path

    text = default_machine_path().with_name("hust_can.toml").read_text(encoding="utf-8")
    for key, value in values.items():
        if not value.isprintable() or value.count('"') not in (0, 2) or "\\" in value:
            raise UsageError(
                f"--{'can' if key == 'interface' else key} {value}: no name of an interface or channel"
            )
        text = _with_line(text, rf"^{key} = [^#\n]*?( *)(#.*)?$", rf"{key} = {value}\1\2")
    _write(_named(text, dest), dest, force)


def _named(text: str, dest: Path) -> bytes:
    """A delivered machine under the name of its new file: state is kept by name, and two machines need two."""
    check_name(dest.stem, "DEST")
    return _with_line(text, r'^name = "[^"]*"$', f'name = "{dest.stem}"').encode()


def _with_line(text: str, pattern: str, line: str) -> str:
    """The text of a delivered machine with the one line that fits replaced."""
    import re

    replaced, found = re.subn(f"(?m){pattern}", line, text)
    if found != 1:
        raise LookupError(f"{pattern} fits {found} lines of a delivered machine, not one")
    return replaced


def _copy(source: Path, dest: Path, force: bool) -> None:
    _write(source.read_bytes(), dest, force)


def _write(data: bytes, dest: Path, force: bool) -> None:
    from gantryctl.errors import UsageError
    from gantryctl.files import unwritable

    try:
        # Exclusive creation: nothing between a look and the writing can be overwritten.
        with dest.open("wb" if force else "xb") as file:
            file.write(data)
    except FileExistsError:
        raise UsageError(f"{dest}: exists already; --force overwrites it") from None
    except OSError as fault:
        raise unwritable(dest, fault) from None


@config.command()
@click.argument("file", type=INPUT, required=False)
@click.option("--config", "option", type=INPUT, help="The machine file, as in other commands.")
@json_option
def check(file: Path | None, option: Path | None, as_json: bool) -> None:
    """Check FILE (default: the reference machine); every problem is one line, exit code 2.

    Fields, rules between keys, calibration, and the quick stop on the full plant: what is ok here, `move` takes. What
    it takes and then ends in an alarm is a line of its own, a warning.
    """
    from gantryctl.errors import ConfigError
    from gantryctl.machine import RULES, load_machine, origins, short_hash, warnings_of

    path = _chosen(file, option)
    try:
        machine = load_machine(path)
        check_whole(machine)
    except ConfigError as error:
        if as_json:
            print_json({"file": str(path), "ok": False, "problems": error.problems})
        raise
    warnings = warnings_of(machine)
    if as_json:
        print_json(
            {
                "file": str(path),
                "ok": True,
                "name": machine.name,
                "hash": _hash(machine),
                "problems": [],
                "warnings": warnings,
            }
        )
        return
    # What was not given is a default: the machine itself (travel, ratios, motor, encoder) has none (decision 0004).
    origin = list(origins(machine).values())
    guesses = f" ({origin.count('guess')} guesses)" if "guess" in origin else ""
    click.echo(
        f"{path}: ok: {machine.name}, {len(origin) - origin.count('default')} keys given{guesses}, "
        f"{origin.count('default')} by default, {len(RULES)} rules between keys, hash {short_hash(machine)}"
    )
    for line in warnings:
        click.echo(f"warning: {line}")


@config.command()
@click.argument("file", type=INPUT, required=False)
@click.option("--config", "option", type=INPUT, help="The machine file, as in other commands.")
@json_option
@click.option("--derived/--no-derived", "with_derived", default=True, help="What follows from the values.")
def show(file: Path | None, option: Path | None, as_json: bool, with_derived: bool) -> None:
    """Show the values in force with unit and origin, then what follows from them."""
    from gantryctl.machine import load_machine

    path = _chosen(file, option)
    machine = load_machine(path)
    if as_json:
        print_json(_show_data(machine, path, with_derived))
        return
    _show_values(machine, path)
    if with_derived:
        _show_derived(machine)
    rows = _ledger(machine)
    if rows:
        click.echo("\n# Safety ledger: what gives each property, or who has accepted that nothing does.")
        for row in rows:
            click.echo(row.text)


@config.command()
@click.option("--sheet", is_flag=True, help="That of a requirement sheet.")
def schema(sheet: bool) -> None:
    """Print the JSON schema of a machine file, for an editor.

    It lies beside every file that gantryctl writes, as machine.schema.json, and the file names it in its first line,
    `#:schema ./machine.schema.json`: so editors that read this line complete keys and mark what is wrong. Rules
    between keys are in `config check` only.
    """
    from gantryctl.machine.schema import json_schema

    if sheet:
        from gantryctl.engineering.sizing.sheet import Sheet

        print_json(json_schema(Sheet, "requirement sheet"))
        return
    print_json(json_schema())


@config.command()
@click.argument("first", metavar="A", type=INPUT)
@click.argument("second", metavar="[B]", type=INPUT, required=False)
@json_option
def diff(first: Path, second: Path | None, as_json: bool) -> None:
    """Compare the values in force of two machine files, defaults included; A alone: with the reference gantry."""
    from gantryctl.machine import default_machine_path, diff_machines, field_specs, load_machine, show_value

    # One file is compared with the reference gantry, from which `config init` made it.
    if second is None:
        first, second = default_machine_path(), first
    # Defaults count: two files may differ in text and mean the same machine.
    differences = diff_machines(load_machine(first), load_machine(second))
    if as_json:
        print_json([difference._asdict() for difference in differences])
        return
    for difference in differences:
        spec = field_specs()[difference.path]
        a, b = show_value(difference.first), show_value(difference.second)
        click.echo(f"{spec.place}: {a} -> {b}{spec.unit_text}")
    if not differences:
        click.echo("the values in force are the same")


@config.command()
@click.option("--config", "option", type=INPUT, help="Machine file; the reference gantry when not given.")
@json_option
def export(option: Path | None, as_json: bool) -> None:
    """Print all settings as one document: machine file in force, service, operator, encoder, accounts.

    The service may run. Nothing secret is in it.
    """
    from gantryctl.machine import load_machine
    from gantryctl.operation.store import state_root
    from gantryctl.service.backup.settings import settings_of

    path = _chosen(None, option)
    machine = load_machine(path)
    found = settings_of(machine, state_root())
    if as_json:
        print_json({**found, "ledger": [row.in_english for row in _ledger(machine)]})
        return
    click.echo(f"# All settings of {machine.name}, {found['exported']}, gantryctl {found['version']}.")
    _show_values(machine, path)
    for section in ("service", "operator", "encoder"):
        click.echo(f"\n[{section}]")
        for name, value in found[section].items():
            click.echo(f"{name:<34} {'-' if value in (None, '') else value}")
    click.echo("\n[opcua]")
    for name in ("opcua_trusted", "opcua_revoked"):
        click.echo(f"{name:<34} {', '.join(found[name]) or '-'}")
    click.echo("\n[accounts]")
    for user in found["accounts"]:
        click.echo(f"{user['name']:<34} {user['role']}, person {user['person']}, password of {user['since']}")
    rows = _ledger(machine)
    if rows:
        click.echo("\n[ledger]")
        for row in rows:
            click.echo(row.text)


def _chosen(file: Path | None, option: Path | None) -> Path:
    """The file to work on: the argument, the option, or the reference machine."""
    from gantryctl.errors import UsageError
    from gantryctl.machine import default_machine_path

    if file is not None and option is not None and file != option:
        raise UsageError(f"two machine files: {file} and --config {option}; give one")
    return file or option or default_machine_path()


def _hash(machine: Machine) -> str:
    from gantryctl.machine import config_hash

    return config_hash(machine)


def _show_data(machine: Machine, path: Path, with_derived: bool) -> dict[str, Any]:
    from gantryctl.machine import effective_values, field_specs, origins
    from gantryctl.machine.derived import derived

    origin = origins(machine)
    values = {
        key: {"value": value, "unit": field_specs()[key].unit, "origin": origin[key]}
        for key, value in effective_values(machine).items()
    }
    data: dict[str, Any] = {
        "file": str(path),
        "name": machine.name,
        "hash": _hash(machine),
        "values": values,
    }
    data["ledger"] = [row.in_english for row in _ledger(machine)]
    if with_derived:
        data["derived"] = [figure._asdict() for figure in derived(machine)]
    return data


def _ledger(machine: Machine) -> tuple[LedgerRow, ...]:
    """Rows of a machine with a real drive; () for any other."""
    from gantryctl.operation.proofs import must_be_proven, read_ledger
    from gantryctl.operation.store import state_root

    return read_ledger(machine, state_root() / machine.name) if must_be_proven(machine) else ()


def _show_values(machine: Machine, path: Path) -> None:
    from gantryctl.machine import effective_values, field_specs, origins, short_hash, show_value

    click.echo(f"# {machine.name}: {path}, hash {short_hash(machine)}")
    origin = origins(machine)
    table = ""
    for key, value in effective_values(machine).items():
        spec = field_specs()[key]
        if spec.table != table:
            table = spec.table
            click.echo(f"\n[{table}]")
        unit = "" if spec.unit == "-" else spec.unit
        where = f"default, {spec.source}" if origin[key] == "default" else origin[key]
        click.echo(f"{spec.key:<34} {show_value(value, None):>20}  {unit:<10} {where}")


def _show_derived(machine: Machine) -> None:
    from gantryctl.machine.derived import derived

    click.echo(
        "\n# What follows from them: rigid body and name plates; `gantryctl stops` has the full plant."
    )
    for figure in derived(machine):
        unit = "" if figure.unit == "-" else figure.unit
        click.echo(f"{figure.name:<38} {figure.value:>16.7g}  {unit:<10} {figure.formula}")
