"""What `new`, `config init --sheet` and `size` share: answers, names, files that are never overwritten, guesses."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import print_json, write_text
from gantryctl.cli.values import INPUT, Whole
from gantryctl.terminal import is_terminal, tell

if TYPE_CHECKING:
    from gantryctl.engineering.drafting.draft import Draft
    from gantryctl.engineering.drafting.open_items import GearsOfGrade
    from gantryctl.engineering.drafting.origin import Values
    from gantryctl.engineering.drafting.sheets import Answered
    from gantryctl.engineering.drafting.templates import Template
    from gantryctl.engineering.sizing.sheet import Sheet

motor_option = click.option(
    "--motor",
    "motor_files",
    type=INPUT,
    multiple=True,
    help="Motor file to choose from; may be repeated. All delivered motors when not given.",
)
gears_option = click.option(
    "--gears",
    type=Whole(0, 10_000),
    default=32,
    show_default=True,
    help="Random gears of the grade that the draft is tried with, some seconds; 0 leaves it out.",
)


def answer_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that answer questions."""
    for add in (
        click.option(
            "--set", "options", multiple=True, metavar="KEY=VALUE", help="One answer; may be repeated."
        ),
        click.option(
            "--answers",
            "answers_file",
            type=INPUT,
            metavar="FILE",
            help="Answers, a line each: key = value; - reads standard input.",
        ),
    ):
        command = add(command)
    return command


def check_name(name: str, what: str) -> None:
    """Refuse a name that a machine cannot have.

    Raises:
        UsageError: with what a name is made of.
    """
    import re

    from gantryctl.errors import UsageError
    from gantryctl.machine.reading import printable

    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}", name):
        raise UsageError(
            f"{what} {printable(name)}: a name of a machine has 1 to 64 letters, digits, '_', '-' or '.', and begins "
            "with a letter or a digit"
        )


def sheet_of(
    name: str, template_name: str | None, answers_file: Path | None, options: tuple[str, ...], quiet: bool
) -> tuple[Answered, Values]:
    """Template, answers and every value of the sheet that follows from them.

    Args:
        name: of the sheet. template_name, answers_file, options: as on the command line; a person at a terminal is
            asked when there are no answers. quiet: ask nobody.

    Raises:
        UsageError, ConfigError: what is wrong with them.
    """
    from gantryctl.engineering.drafting.sheets import Answered, sheet_values
    from gantryctl.engineering.drafting.templates import load_template

    asks = answers_file is None and not options and not quiet and _at_a_terminal()
    template = load_template(template_name if template_name is not None else _template(asks))
    answered = _asked(template) if asks else Answered.of(template, _given(answers_file, options))
    return answered, sheet_values(answered, name)


def _at_a_terminal() -> bool:
    return is_terminal(sys.stdin)


def _template(asks: bool) -> str:
    from gantryctl.engineering.drafting.templates import template_names
    from gantryctl.errors import UsageError

    names = template_names()
    if not asks:
        raise UsageError(f"--template: is missing; choose {', '.join(names)}")
    return str(click.prompt("Kind of axis", type=click.Choice(names)))


def _given(answers_file: Path | None, options: tuple[str, ...]) -> dict[str, Any]:
    """Answers of the file, then those of the options, which win."""
    from gantryctl.engineering.drafting.questions import answered, answered_by_options
    from gantryctl.machine.reading import read_text

    given: dict[str, Any] = {}
    if answers_file is not None:
        given |= answered(read_text(answers_file, ""), str(answers_file))
    return given | answered_by_options(options)


def _asked(template: Template) -> Answered:
    """Ask question by question; an answer that is refused is asked for again."""
    from gantryctl.engineering.drafting.questions import one_answer, questions
    from gantryctl.engineering.drafting.sheets import Answered
    from gantryctl.errors import ConfigError

    given: dict[str, Any] = {}
    click.echo("Enter keeps the usual value in brackets; it stays a guess.")
    for key, spec in questions().items():
        usual = getattr(template.answers, key)
        while True:
            unit = f" ({spec.unit})" if spec.unit != "-" else ""
            shown = f"{usual:g}" if isinstance(usual, float) else usual
            text = str(click.prompt(f"{spec.meaning.rstrip('.')}{unit}", default=shown))
            if text == shown:
                break
            try:
                given[key] = one_answer(key, text)
            except ConfigError as wrong:
                tell("\n".join(wrong.problems))
                continue
            break
    return Answered.of(template, given)


def drafted(sheet: Sheet, motor_files: tuple[Path, ...], name: str) -> Draft:
    """A draft with the smallest motor of the files, or of all that are delivered."""
    from gantryctl.engineering.drafting.choice import draft_with
    from gantryctl.engineering.sizing.motors import delivered_motors, is_motor_file, load_motors
    from gantryctl.errors import UsageError

    for path in motor_files:
        if not is_motor_file(path):
            raise UsageError(f"--motor {path}: is no motor file: it has no table [motor]")
    return draft_with(sheet, load_motors(list(motor_files) or delivered_motors()), name)


def write_new(texts: dict[Path, str], force: bool) -> list[Path]:
    """Write files that are new, or all of them anew with `force`; none when one of them exists.

    Returns:
        The schemas for editors that lie beside them.

    Raises:
        UsageError: one exists, or cannot be written.
    """
    from gantryctl.errors import UsageError
    from gantryctl.machine.schema import put_schemas

    for path in texts:
        if path.exists() and not force:
            raise UsageError(f"{path}: exists already; --force overwrites it")
    for path, text in texts.items():
        write_text(path, text)
    return put_schemas(texts)


def report(
    made: Draft,
    gears: GearsOfGrade | None,
    written: list[Path],
    schemas: list[Path],
    sheet: Values | None,
    as_json: bool,
) -> None:
    """Print what was written, the motor, every guess with its rule, what gears give, and what is left open."""
    from gantryctl.engineering.drafting.open_items import brake_overload
    from gantryctl.engineering.drafting.writing import guess_lines

    overload = brake_overload(made.machine())
    found = {"sheet": guess_lines(sheet) if sheet else [], "machine": guess_lines(made.values)}
    if as_json:
        print_json(
            {
                "written": [str(path) for path in (*written, *schemas)],
                "motor": made.fit.motor.name,
                "guesses": found,
                "gears": None if gears is None else _gears_data(gears),
                "brake_overload": None if overload is None else overload._asdict(),
                "soft_loop": None if made.soft_loop is None else made.soft_loop._asdict(),
            }
        )
        return
    click.echo(f"wrote {' and '.join(str(path) for path in written)}: motor {made.fit.motor.name}")
    for what, lines in found.items():
        show_guesses(what, lines)
    if gears is not None:
        click.echo(f"\n{'' if gears.kept else 'open: '}{gears.text}")
    if overload is not None:
        click.echo(f"\nopen: {overload.text}")
    if made.soft_loop is not None:
        click.echo(f"\nopen: {made.soft_loop.text}")
    click.echo(f"\nnext: gantryctl config check {written[-1]}")


def _gears_data(gears: GearsOfGrade) -> dict[str, Any]:
    enough = gears.enough
    return {
        **gears._asdict(),
        "drafted": gears.drafted._asdict(),
        "enough": None if enough is None else enough._asdict(),
    }


def show_guesses(what: str, lines: Sequence[str]) -> None:
    """Print the guesses of a file."""
    if lines:
        click.echo(f"\n{len(lines)} values of the {what} are guesses; replace them by what you know:")
        for line in lines:
            click.echo(f"  {line}")
