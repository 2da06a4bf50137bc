"""Shared parts of commands: options under one name each, the machine they are about, stop signals, questions, JSON."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from gantryctl.cli.values import FINITE, INPUT, PATH, LogPath, Whole
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.machine import Machine


Option = Callable[[Callable[..., Any]], Callable[..., Any]]


config_option = click.option(
    "--config", "config_file", type=INPUT, help="Machine file; the reference gantry when not given."
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON and nothing else.")
out_option = click.option("--out", "out", type=PATH, help="Directory for files that the command writes.")
seed_option = click.option(
    "--seed", type=Whole(0, 2**63 - 1), default=0, show_default=True, help="Seed of all noise."
)


def refuse_service_on_windows(ctx: click.Context, param: click.Parameter | None, wanted: bool) -> bool:
    """Say that there is no service where its local socket, shared memory and rights do not exist.

    Raises:
        UsageError: this is Windows.
    """
    from gantryctl.errors import UsageError

    if wanted and sys.platform == "win32":
        name = ctx.info_name if param is None else param.opts[0]
        raise UsageError(f"{name}: the service runs on Linux only; here every command drives the axis itself")
    return wanted


service_option = click.option(
    "--service",
    "service",
    is_flag=True,
    callback=refuse_service_on_windows,
    help="Ask the running service; see `attach`.",
)
real_time_option = click.option(
    "--real-time", is_flag=True, help="Run on the real clock instead of virtual time."
)
take_over_option = click.option(
    "--take-over", is_flag=True, help="With the service: take control from whoever has it."
)
fresh_option = click.option(
    "--fresh", is_flag=True, help="Start from a new machine at 0 deg; read and write no retained state."
)


def choice_option(name: str, choices: Sequence[str], help: str) -> Option:
    """An option with a few words as values, of which the first is the default."""
    return click.option(name, type=click.Choice(choices), default=choices[0], show_default=True, help=help)


def number_option(names: Sequence[str], default: float, help: str) -> Option:
    """An option with a finite number as value, and a default that the help shows."""
    return click.option(*names, type=FINITE, default=default, show_default=True, help=help)


class SignedCommand(click.Command):
    """A command whose arguments may begin with a minus (`move -90`), and which still refuses a wrong option."""

    ignore_unknown_options = True

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse, and refuse what looks like a long option and is not one."""
        known = {name for parameter in self.get_params(ctx) for name in parameter.opts}
        for argument in args[: args.index("--") if "--" in args else None]:
            name = argument.partition("=")[0]
            if name.startswith("--") and name not in known:
                raise click.NoSuchOption(name, possibilities=get_close_matches(name, known), ctx=ctx)
        return super().parse_args(ctx, args)


def bus_log_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--bus-log` to a command that may open a bus, and keep the frames around its alarms."""

    @wraps(command)
    def logged(*args: Any, bus_log: Path | None, **given: Any) -> Any:
        if bus_log is None and given.get("service"):
            # The service keeps the frames of its bus: this command opens none.
            return command(*args, **given)
        from gantryctl.operation.bus_log import logged_bus

        with logged_bus(bus_log) as log:
            try:
                return command(*args, **given)
            finally:
                log.close()
                # On standard error: what a command prints as JSON is one document.
                for path in log.frozen:
                    tell(f"frames of the bus around it: gantryctl can log {path}")
                for fault in log.faults:
                    tell(f"warning: {fault}")
                if bus_log is not None and not log.opened:
                    tell(
                        f"warning: --bus-log {bus_log}: this command opened no bus, nothing was written; a service "
                        "has a log of its own (serve --bus-log)",
                    )

    return click.option(
        "--bus-log", "bus_log", type=LogPath(), help="Log of all frames: .log (candump), .asc, .blf ..."
    )(logged)


def machine_of(config_file: Path | None) -> Machine:
    """Load the machine file that was asked for, or the reference gantry."""
    from gantryctl.machine import default_machine_path, load_machine

    return load_machine(config_file or default_machine_path())


def simulated_machine(config_file: Path | None, what: str) -> Machine:
    """A machine with a plant to study.

    Raises:
        UsageError: its drive is not the simulated one.
    """
    from gantryctl.errors import UsageError

    machine = machine_of(config_file)
    if machine.drive.kind != "sim":
        raise UsageError(
            f'{what} needs [drive] kind = "sim", {machine.name} has "{machine.drive.kind}": use "sim"'
        )
    return machine


# A file of this name in the state directory of a machine sends its commands to the running service.
ATTACHED = "attached"


def to_service(service: bool, config_file: Path | None) -> bool:
    """A command goes to the running service: asked for, or attached."""
    from gantryctl.operation.store import state_root

    # Without any attached machine the machine file need not be read to know.
    if service or not any(state_root().glob(f"*/{ATTACHED}")):
        return service
    return (state_root() / machine_of(config_file).name / ATTACHED).exists()


def proven_machine(config_file: Path | None) -> Machine:
    """Load a machine file whose quick stop the full plant can give: for every command that moves.

    What the file asks for and then ends in an alarm is told on standard error.

    Raises:
        ConfigError: fields, rules, or a quick stop that motor or reducer cannot give.
    """
    # Rules of the machine file are static (decision 0004); what a stop costs needs the plant: compliance, reducer.
    from gantryctl.engineering.stops import check_quick_stop
    from gantryctl.machine import warnings_of

    machine = machine_of(config_file)
    check_quick_stop(machine, propose=True)
    for line in warnings_of(machine):
        click.echo(f"warning: {machine.name}: {line}", err=True)
    return machine


def print_done(done: str, as_json: bool, **values: object) -> None:
    """Print what was done: as JSON the values, or a sentence."""
    if as_json:
        print_json(values)
    else:
        click.echo(done)


def print_json(value: object) -> None:
    """Print one JSON document on standard output."""
    # NaN is no JSON: a number that is not finite is a fault of the command, found by its test.
    click.echo(json.dumps(value, indent=2, allow_nan=False))


def write_json(path: Path, value: object) -> Path:
    """One JSON document in a file, whose path is returned."""
    return write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> Path:
    """A file that the user asked for; its path is returned.

    Raises:
        UsageError: there is no place of this name. DeviceError: the disk does not take it.
    """
    from gantryctl.files import unwritable

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as fault:
        raise unwritable(path, fault) from None
    return path


def directory(path: Path) -> Path:
    """Make sure that a directory exists.

    Raises:
        UsageError: it cannot be made.
    """
    from gantryctl.errors import UsageError

    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise UsageError(f"--out {path}: cannot be made: {fault.strerror or fault}") from None
    return path


# The service has its own program, recordings, clock and state; seed may be anything, it is not used.
_LOCAL_ONLY: Final = ("program_name", "out", "fresh", "real_time", "no_trace", "seed")


def refuse_local_options(given: dict[str, Any]) -> None:
    """Refuse an option that a running service cannot follow.

    Raises:
        UsageError: with its name.
    """
    from gantryctl.errors import UsageError

    for name in _LOCAL_ONLY:
        if given.get(name):
            option = name.removesuffix("_name").replace("_", "-")
            raise UsageError(
                f"--{option} does not go with a running service; gantryctl detach, or leave it out"
            )


@contextmanager
def stop_signals(stop: Callable[[], object], hung_up: Callable[[], object] | None = None) -> Iterator[None]:
    """Call `stop` on Ctrl-C, on SIGTERM and when the terminal is lost, instead of ending the process.

    Args:
        hung_up: called in place of it when the terminal is lost.
    """
    calls = {"SIGINT": stop, "SIGTERM": stop, "SIGHUP": hung_up or stop}
    # A lost terminal sends SIGHUP; Windows has none.
    known = {getattr(signal, name): call for name, call in calls.items() if hasattr(signal, name)}
    before = {number: signal.signal(number, lambda *_, call=call: call()) for number, call in known.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def asking() -> Iterator[None]:
    """Ctrl-C answers a question to a person, also within `stop_signals`: nothing moves meanwhile."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def confirm(question: str, otherwise: str) -> None:
    """Ask a person on standard error; Ctrl-C means no.

    Args:
        otherwise: what follows from a no, for the refusal.

    Raises:
        CommandRefused: the answer is no.
    """
    from gantryctl.errors import CommandRefused

    try:
        with asking():
            agreed = click.confirm(question, err=True)
    except click.Abort:
        agreed = False
    if not agreed:
        raise CommandRefused(f"not confirmed: {otherwise}")
