"""Identity of a report that a command writes: who ran it, who watched, when, with which command, on which machine."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from gantryctl.extras import need

if TYPE_CHECKING:
    from gantryctl.engineering.report.head import Head, Made, MeasuredBy
    from gantryctl.machine import Machine

# Where the group of all commands leaves the words of the command line.
ARGUMENTS: Final = "gantryctl.arguments"


def report_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that name people and date of a report; the command gets all of it as `made`."""

    @wraps(command)
    def with_made(*args: Any, operator: str, witness: str, date: str | None, **given: Any) -> Any:
        # Before the work that the report is about. Commands that write one without being asked do it themselves.
        if given.get("out") is not None:
            need("matplotlib")
        return command(*args, made=_made(operator, witness, date), **given)

    options = (
        click.option("--operator", default="", metavar="NAME", help="Who runs it, for the report."),
        click.option("--witness", default="", metavar="NAME", help="Who watches, for the report."),
        click.option("--date", metavar="TEXT", help="Date of the report; the computer's when not given."),
    )
    for option in reversed(options):
        with_made = option(with_made)
    return with_made


def _made(operator: str, witness: str, date: str | None) -> Made:
    from datetime import UTC, datetime
    from importlib.metadata import version

    from gantryctl.engineering.report.head import Made

    arguments: tuple[str, ...] = click.get_current_context().meta.get(ARGUMENTS, ())
    return Made(
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC") if date is None else date,
        version=version("gantryctl"),
        command=shlex.join(("gantryctl", *arguments)),
        operator=operator,
        witness=witness,
    )


def head_of(
    machine: Machine | None, made: Made, measured_by: MeasuredBy | None = None, directory: Path | None = None
) -> Head:
    """Head of a report on a machine, with the serial numbers that earlier runs and commissioning have left.

    Args:
        machine: None where nothing tells which machine it is.
        directory: of the retained state, where it is not the usual one.
    """
    from gantryctl.engineering.report.head import Head
    from gantryctl.engineering.report.machine_facts import known_serials, machine_facts
    from gantryctl.operation.store import state_root

    if machine is None:
        return Head("machine not named", (("Machine", "not named"),), made, measured_by)
    serials = known_serials(machine, directory or state_root() / machine.name)
    return Head(machine.name, machine_facts(machine, serials), made, measured_by, machine.required.source)
