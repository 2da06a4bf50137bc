"""`gantryctl size`: from a requirement sheet to motors that fit and to the limits of a machine file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.drafting import answer_options, check_name, sheet_of, show_guesses, write_new
from gantryctl.cli.options import (
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
from gantryctl.cli.values import INPUT, PATH
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.engineering.report.head import Made
    from gantryctl.engineering.sizing.checks import Fit
    from gantryctl.engineering.sizing.sheet import Sheet
    from gantryctl.machine import Machine


class SizeGroup(click.Group):
    """A group whose first word may be left out: `gantryctl size SHEET` is `gantryctl size motors SHEET`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the usual command in front where none is named."""
        named = bool(args) and (args[0] in self.commands or args[0] in ctx.help_option_names)
        return super().parse_args(ctx, args if named else ["motors", *args])


@click.group(cls=SizeGroup)
def size() -> None:
    """Size an axis: motors that fit a requirement sheet, and what follows from them.

    `gantryctl size SHEET ...` is short for `gantryctl size motors SHEET ...`.
    """


@size.command()
@click.argument("dest", type=PATH, default="sheet.toml")
@click.option("--template", "template_name", metavar="KIND", help="Kind of axis; see `gantryctl new`.")
@answer_options
@click.option("--force", is_flag=True, help="Overwrite DEST.")
@json_option
def init(
    dest: Path,
    template_name: str | None,
    answers_file: Path | None,
    options: tuple[str, ...],
    force: bool,
    as_json: bool,
) -> None:
    """Write a requirement sheet to DEST (default: sheet.toml), from a template and answers as in `gantryctl new`."""
    from gantryctl.engineering.drafting.sheets import drafted_sheet
    from gantryctl.engineering.drafting.writing import guess_lines, sheet_text

    if dest.is_dir():
        dest = dest / "sheet.toml"
    check_name(dest.stem, "DEST")
    answered, values = sheet_of(dest.stem, template_name, answers_file, options, as_json)
    drafted_sheet(values, str(dest))
    schemas = write_new({dest: sheet_text(values, answered.template.template.name)}, force)
    lines = guess_lines(values)
    if as_json:
        print_json({"written": [str(path) for path in (dest, *schemas)], "guesses": lines})
        return
    click.echo(f"wrote {dest}")
    show_guesses("sheet", lines)
    click.echo(f"\nnext: gantryctl size {dest}")


@size.command()
@click.argument("files", nargs=-1, type=INPUT, metavar="[SHEET] [MOTOR]...")
@click.option("--motor", "motor_files", type=INPUT, multiple=True, help="Motor file; may be repeated.")
@config_option
@click.option(
    "--limits", is_flag=True, help="Print the tables of a machine file that follow, and nothing else."
)
@click.option(
    "--write",
    "destination",
    type=PATH,
    help="Write a whole machine file: drafted from the sheet, or --config with these tables.",
)
@out_option
@report_options
@json_option
def motors(
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

    What the load inertia alone asks for, what that leaves out, and which motors fit. Without --motor all delivered
    motors are tried; the complete figures are those of the first that fits. Further MOTOR files may follow --motor, as
    the shell expands `--motor motors/*.toml`. Exit code 1 when no motor fits.
    """
    from gantryctl.engineering.sizing.checks import fit
    from gantryctl.engineering.sizing.motors import load_motors

    sheet_path, motor_paths = _sorted_files(files, motor_files)
    sheet = _sheet(sheet_path)
    fits = [fit(sheet, motor) for motor in load_motors(motor_paths)]
    # The figures of a motor that fits, or of the first one to show what is missing.
    shown = next((fitted for fitted in fits if fitted.fits), fits[0])
    # A sheet of its own is another machine than the reference gantry: nothing of that may come along.
    base = machine_of(config_file) if config_file is not None or sheet_path is None else None
    if destination is not None:
        _write(base, shown, destination)
    if out is not None:
        from gantryctl.engineering.sizing.page import render_sizing

        page = write_text(directory(out) / "report.html", render_sizing(shown, fits, made))
        click.echo(f"report: {page.resolve()}", err=as_json or limits)
    if limits:
        return _print_limits(base, shown, as_json=as_json)
    if as_json:
        from gantryctl.engineering.sizing.data import sizing_data

        print_json(sizing_data(shown, fits, base.drive.speed_loop if base is not None else None))
    else:
        _show(sheet, shown, fits)
    return 0 if any(fitted.fits for fitted in fits) else 1


def _followed(base: Machine | None, shown: Fit) -> Machine:
    """The machine that follows: the given one with the sheet's and the motor's values, or a draft."""
    if base is not None:
        from gantryctl.engineering.sizing.chain import sized_machine

        return sized_machine(base, shown)
    from gantryctl.engineering.drafting.draft import draft

    return draft(shown, shown.train.sheet.sheet.name).machine()


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


def _print_limits(base: Machine | None, shown: Fit, *, as_json: bool) -> int:
    from gantryctl.engineering.sizing.chain import as_tables, machine_values

    if not shown.fits or base is not None:
        # Refuses what does not fit, or contradicts the rest of the machine.
        _followed(base, shown)
    sheet, motor = shown.train.sheet, shown.motor
    if as_json:
        values = machine_values(sheet, motor)
        print_json({"sheet": sheet.sheet.name, "motor": motor.name, "machine_values": values})
        return 0
    click.echo(f"# requirement sheet {sheet.sheet.name}, motor {motor.name} ({motor.identity.source})")
    click.echo(as_tables(machine_values(sheet, motor)), nl=False)
    return 0


def _write(base: Machine | None, shown: Fit, path: Path) -> None:
    from gantryctl.errors import UsageError
    from gantryctl.machine.schema import MACHINE_LINE, put_schemas

    check_name(path.stem, "--write")
    if base is None:
        text = _drafted_text(shown, path.stem)
    else:
        from gantryctl.machine import with_values
        from gantryctl.machine.effective import to_toml

        # Under the name of its base it would share the state of that machine: zero, alarms, recordings.
        sized = with_values(_followed(base, shown), {"machine.name": path.stem})
        sheet = shown.train.sheet.sheet.name
        head = f"# {base.name} with requirement sheet {sheet} and motor {shown.motor.name}\n"
        text = MACHINE_LINE + head + to_toml(sized)
    try:
        # Never over a file that exists: a machine file is a person's work.
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UsageError(f"--write {path}: exists already; choose another name") from None
    except OSError as fault:
        raise UsageError(f"--write {path}: cannot be written: {fault.strerror or fault}") from None
    put_schemas([path])
    tell(f"wrote {path}; check it with `gantryctl config check {path}`")


def _drafted_text(shown: Fit, name: str) -> str:
    from gantryctl.engineering.drafting.draft import draft
    from gantryctl.engineering.drafting.writing import machine_text

    return machine_text(draft(shown, name))


def _show(sheet: Sheet, shown: Fit, fits: list[Fit]) -> None:
    from gantryctl.engineering.sizing import text

    click.echo(f"{sheet.sheet.name}: {sheet.sheet.description}")
    print_table(text.first_table(sheet))
    print_table(text.complete_table(shown))
    print_table(text.angle_table(shown))
    print_table(text.further_table(shown))
    print_table(text.motors_table(fits))
    click.echo()
    for sentence in text.sentences(shown, fits):
        paragraph(sentence)
