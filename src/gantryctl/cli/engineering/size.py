"""`gantryctl size`: from a requirement sheet to motors that fit and to the limits of a machine file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import (
    PATH,
    config_option,
    directory,
    json_option,
    machine_of,
    out_option,
    print_json,
    write_text,
)
from gantryctl.cli.report import report_options
from gantryctl.cli.text import paragraph, print_table

if TYPE_CHECKING:
    from gantryctl.engineering.report.head import Made
    from gantryctl.engineering.sizing.checks import Fit
    from gantryctl.engineering.sizing.sheet import Sheet
    from gantryctl.machine import Machine


@click.command()
@click.argument("files", nargs=-1, type=PATH, metavar="[SHEET] [MOTOR]...")
@click.option("--motor", "motor_files", type=PATH, multiple=True, help="Motor file; may be repeated.")
@config_option
@click.option(
    "--limits", is_flag=True, help="Print the tables of a machine file that follow, and nothing else."
)
@click.option(
    "--write", "destination", type=PATH, help="Write a whole machine file: --config with these tables."
)
@out_option
@report_options
@json_option
def size(
    files: tuple[Path, ...],
    motor_files: tuple[Path, ...],
    config_file: Path | None,
    limits: bool,
    destination: Path | None,
    out: Path | None,
    as_json: bool,
    made: Made,
) -> int:
    """Size motors for the requirement sheet SHEET (default: the reference gantry's).

    The paper's equations (1) to (3), what they leave out, and which motors fit. Without --motor all delivered motors
    are tried; the complete figures are those of the first that fits. Further MOTOR files may follow --motor, as the
    shell expands `--motor motors/*.toml`. Exit code 1 when no motor fits.
    """
    from gantryctl.engineering.sizing.checks import fit
    from gantryctl.engineering.sizing.motors import load_motors

    sheet_path, motor_paths = _sorted_files(files, motor_files)
    sheet = _sheet(sheet_path)
    fits = [fit(sheet, motor) for motor in load_motors(motor_paths)]
    # The figures of a motor that fits, or of the first one to show what is missing.
    shown = next((fitted for fitted in fits if fitted.fits), fits[0])
    machine = machine_of(config_file)
    if destination is not None:
        _write(machine, shown, destination)
    if out is not None:
        from gantryctl.engineering.sizing.page import render_sizing

        page = write_text(directory(out) / "report.html", render_sizing(shown, fits, made))
        click.echo(f"report: {page.resolve()}", err=True)
    if limits:
        return _print_limits(machine, shown)
    if as_json:
        from gantryctl.engineering.sizing.data import sizing_data

        print_json(sizing_data(shown, fits, machine.drive.speed_loop))
    else:
        _show(sheet, shown, fits)
    return 0 if any(fitted.fits for fitted in fits) else 1


def _sorted_files(files: tuple[Path, ...], motor_files: tuple[Path, ...]) -> tuple[Path | None, list[Path]]:
    """The sheet and the motors among the arguments; a file with a [motor] table is a motor."""
    from gantryctl.engineering.sizing.motors import delivered_motors, is_motor_file
    from gantryctl.errors import UsageError

    motors = [path for given in motor_files for path in _expanded(given)]
    sheets: list[Path] = []
    for path in files:
        (motors if is_motor_file(path) else sheets).append(path)
    if len(sheets) > 1:
        raise UsageError(f"two requirement sheets: {sheets[0]} and {sheets[1]}; give one")
    return (sheets[0] if sheets else None), motors or delivered_motors()


def _expanded(path: Path) -> list[Path]:
    """A pattern that the shell did not expand."""
    import glob

    from gantryctl.errors import UsageError

    # Quoted patterns, and shells that expand none.
    if not glob.has_magic(str(path)) or path.exists():
        return [path]
    found = sorted(Path(name) for name in glob.glob(str(path)))
    if not found:
        raise UsageError(f"--motor {path}: no file has such a name")
    return found


def _sheet(path: Path | None) -> Sheet:
    from gantryctl.engineering.sizing.loading import default_sheet_path, load_sheet

    return load_sheet(path or default_sheet_path())


def _print_limits(machine: Machine, shown: Fit) -> int:
    from gantryctl.engineering.sizing.chain import as_tables, machine_values, sized_machine

    # Refuses what does not fit.
    sized_machine(machine, shown)
    sheet, motor = shown.train.sheet, shown.motor
    click.echo(f"# requirement sheet {sheet.sheet.name}, motor {motor.name} ({motor.identity.source})")
    click.echo(as_tables(machine_values(sheet, motor)), nl=False)
    return 0


def _write(machine: Machine, shown: Fit, path: Path) -> None:
    from gantryctl.engineering.sizing.chain import sized_machine
    from gantryctl.errors import UsageError
    from gantryctl.machine.effective import to_toml

    text = to_toml(sized_machine(machine, shown))
    head = f"# {machine.name} with requirement sheet {shown.train.sheet.sheet.name} and motor {shown.motor.name}\n"
    try:
        # Never over a file that exists: a machine file is a person's work.
        with path.open("x", encoding="utf-8") as file:
            file.write(head + text)
    except FileExistsError:
        raise UsageError(f"--write {path}: exists already; choose another name") from None
    except OSError as fault:
        raise UsageError(f"--write {path}: cannot be written: {fault.strerror or fault}") from None
    click.echo(f"wrote {path}; check it with `gantryctl config check {path}`", err=True)


def _show(sheet: Sheet, shown: Fit, fits: list[Fit]) -> None:
    from gantryctl.engineering.sizing import text

    click.echo(f"{sheet.sheet.name}: {sheet.sheet.description}")
    print_table(text.paper_table(sheet))
    print_table(text.complete_table(shown))
    print_table(text.angle_table(shown))
    print_table(text.further_table(shown))
    print_table(text.motors_table(fits))
    click.echo()
    for sentence in text.sentences(shown, fits):
        paragraph(sentence)
