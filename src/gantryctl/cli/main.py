"""The command `gantryctl`: sub-commands, imported when they are called; errors as messages and exit codes.

Exit codes: 0 done, 1 criterion not met, 2 usage or configuration, 3 device, 4 stopped by an alarm, 5 a fault of
gantryctl, and as of other tools 130 interrupted, 141 standard output was closed.
"""

from __future__ import annotations

import importlib
import os
import sys
from typing import Any, Final, NamedTuple

import click

from gantryctl.cli.report import ARGUMENTS
from gantryctl.errors import ConfigError, DeviceError, GantryctlError
from gantryctl.terminal import mute, tell

TRACEBACK_VARIABLE: Final = "GANTRYCTL_TRACEBACK"

INTERNAL: Final = 5
# What a shell reports of a tool that SIGINT or SIGPIPE has ended: 128 and the number of the signal.
INTERRUPTED: Final = 130
OUTPUT_CLOSED: Final = 141


class Entry(NamedTuple):
    """Module of a sub-command below `gantryctl.cli`, its name there, and its line in the help."""

    module: str
    name: str
    help: str


# The lines of the help stand here, so that `gantryctl --help` imports no command: click alone takes 40 ms to import,
# and what a command needs comes with it (decision 0002).
GROUPS: Final = {
    "Move and look": {
        "move": Entry("axis.move", "move", "Move to an angle, or by an angle."),
        "jog": Entry("axis.move", "jog", "Hold-to-run motion in one direction for a time."),
        "power": Entry("axis.power", "power", "Power at the running service: on, off."),
        "brake-test": Entry(
            "axis.brake_test", "brake_test", "Test torque against the closed brake, both ways."
        ),
        "arm": Entry("axis.brake_test", "arm", "Arm a brake test or a locked reset for somebody else."),
        "status": Entry("axis.state", "status", "Where the axis stands and whether it may move."),
        "alarms": Entry("axis.state", "alarms", "Alarms of the past, newest first."),
        "why": Entry("axis.why", "why", "Why the axis stopped last: sentences and a picture of the moment."),
        "explain": Entry("axis.state", "explain", "What an alarm code means and what to do."),
        "reset": Entry("axis.state", "reset", "Acknowledge the alarm that holds the axis. Never enables."),
        "encoder": Entry("axis.encoder", "encoder", "The absolute reference: show, set-zero."),
        "retain": Entry("axis.state", "retain", "The controller's retained memory: show."),
        "state": Entry("computer.state", "state", "Where the state of a machine lies: show, remove."),
        "sim": Entry("axis.state", "sim", "The simulated machine: reset."),
        "trace": Entry("trace", "trace", "Recordings: list, show, plot, compare, export."),
    },
    "Describe a machine": {
        "new": Entry("engineering.new", "new", "A new axis: sheet and machine file from a dozen answers."),
        "size": Entry(
            "engineering.size",
            "size",
            "Size motors for a requirement sheet; write a sheet, limits, a machine.",
        ),
        "config": Entry(
            "config", "config", "Machine files: init, check, show, set, schema, diff; export all settings."
        ),
        "eds": Entry("drive.eds", "eds", "EDS and DCF files of drives: check."),
    },
    "Study a machine": {
        "stops": Entry("engineering.stops", "stops", "What every stop costs: angle, time, torques, brake."),
        "speed-test": Entry(
            "engineering.accuracy",
            "speed_test",
            "The speed test: constant speeds both ways, motor side and load side.",
        ),
        "accuracy": Entry(
            "engineering.accuracy", "accuracy", "The chord test: run, measure, report, statistics of a table."
        ),
        "instrument": Entry(
            "engineering.instrument",
            "instrument",
            "Instruments at the load: read one, serve a simulated one.",
        ),
        "analyse": Entry(
            "engineering.analyse",
            "analyse",
            "Linear analysis: margins, modes, worst case, measured response.",
        ),
        "tune": Entry("engineering.tune", "tune", "Tune the loops: a proposal by trials or by margins."),
        "identify": Entry(
            "engineering.identify",
            "identify",
            "Measure friction, moment, stiffness and gear map of this machine.",
        ),
        "profile": Entry(
            "engineering.profile", "profile", "The fastest profile of a move for a permitted base motion."
        ),
        "compare": Entry("engineering.compare", "compare", "Two ways of control on one plant, side by side."),
        "campaign": Entry(
            "campaign",
            "campaign",
            "Figures of many plants: run, show, plot, compare, on one computer or a cluster.",
        ),
        "faults": Entry("faults.faults", "faults", "Faults on a simulated axis: list, show, run, campaigns."),
    },
    "Drives on a bus": {
        "can": Entry("drive.can", "can", "The CAN bus: who is on it, what was said on it."),
        "drive": Entry("drive.drive", "drive", "Drives on a bus: sim, status, objects, backup and restore."),
        "commission": Entry(
            "drive.commission", "commission", "Commission a CAN machine, step by step, each with its proof."
        ),
    },
    "Run as a service": {
        "serve": Entry("service.serve", "serve", "Run the controller with its operator page."),
        "console": Entry("service.console", "console", "Open the page as the console of this machine."),
        "user": Entry("service.user", "user", "Users of the page: add, list, remove, passwd."),
        "attach": Entry("axis.attach", "attach", "Send the commands of a machine to its running service."),
        "detach": Entry("axis.attach", "detach", "End that: commands run on their own."),
        "journal": Entry("service.journal", "journal", "The service's journal: show, verify, export."),
        "backup": Entry(
            "service.backup", "backup", "Configuration, state and journal as one file: create, show, restore."
        ),
    },
    "This computer": {
        "doctor": Entry(
            "computer.doctor", "doctor", "Is this computer good enough: lateness of the scan, in degrees."
        ),
        "bench": Entry(
            "computer.bench", "bench", "How fast this computer is, as ratios, beside its last run."
        ),
        "docs": Entry("computer.docs", "docs", "Open the documentation, without a network."),
        "completion": Entry("completion", "completion", "Shell completion for bash, zsh or fish."),
    },
}
COMMANDS: Final = {name: entry for group in GROUPS.values() for name, entry in group.items()}


class LazyGroup(click.Group):
    """A group whose sub-commands are imported when they are called."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the words of the command line: reports name the command that made them."""
        ctx.meta[ARGUMENTS] = tuple(args)
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as wrong:
            import difflib

            # click takes a word for near that shares a few letters: "--json" for "--version".
            if difflib.get_close_matches(wrong.option_name, ("--version", "--help"), 1, 0.8):
                raise
            raise click.UsageError(
                f"there is no option '{wrong.option_name}' before the command: options stand behind it, as in "
                f"`gantryctl status --json`.",
                ctx,
            ) from None

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the names in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one sub-command."""
        entry = COMMANDS.get(cmd_name)
        if entry is None:
            return None
        if entry.module.startswith("service.") or cmd_name == "attach":
            from gantryctl.cli.options import refuse_service_on_windows

            refuse_service_on_windows(click.Context(self, info_name=cmd_name), None, True)
        command = getattr(importlib.import_module(f"gantryctl.cli.{entry.module}"), entry.name)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of the help, by groups of what a person wants to do."""
        for title, commands in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name, entry.help) for name, entry in commands.items()])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Answer an unknown name with the nearest known one."""
        import difflib

        name = args[0] if args else ""
        if name and name not in COMMANDS and not name.startswith("-"):
            near = difflib.get_close_matches(name, COMMANDS, 1)
            hint = f"; did you mean '{near[0]}'?" if near else ""
            ctx.fail(f"there is no command '{name}'{hint}")
        return super().resolve_command(ctx, args)


def _version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted and not ctx.resilient_parsing:
        # Takes some 14 ms to import (python -X importtime), so only here.
        from importlib.metadata import version

        click.echo(f"gantryctl {version('gantryctl')}")
        ctx.exit()


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Print the version."
)
def cli() -> None:
    """Soft motion controller for big, slow, unbalanced rotary axes.

    Without --config the machine is the proton gantry of configs/hust_gantry.toml on the simulator. gantryctl is not a
    certified safety system: emergency stop, limit switches and safe torque off belong in hardware.
    """


def run(args: list[str] | None = None) -> int:
    """Run one command line; the exit code. Every `GantryctlError` becomes one message, never a traceback."""
    try:
        result: Any = cli.main(args=args, prog_name="gantryctl", standalone_mode=False)
    except click.exceptions.Exit as done:
        return done.exit_code
    # What click raises when a pipe is closed, as by `gantryctl ... | head -1`.
    except SystemExit:
        return OUTPUT_CLOSED
    except click.exceptions.NoArgsIsHelpError as wrong:
        wrong.show()
        return 2
    except click.ClickException as wrong:
        tell(f"error: {_one_line(wrong)}")
        return 2
    except click.Abort:
        tell("Interrupted.")
        return INTERRUPTED
    except ConfigError as wrong:
        for line in wrong.problems:
            tell(f"error: {line}")
        return wrong.exit_code
    except GantryctlError as wrong:
        tell(f"error: {wrong}")
        return wrong.exit_code
    # A full disk or a missing right is trouble of the computer, not a fault of the command.
    except OSError as fault:
        where = f"{fault.filename}: " if fault.filename else ""
        tell(f"error: {where}{fault.strerror or fault}")
        return DeviceError.exit_code
    # A traceback does not help at a machine; whoever reports the fault can have it.
    except Exception as bug:
        if os.environ.get(TRACEBACK_VARIABLE):
            raise
        return _ended_by(bug)
    return result if isinstance(result, int) else 0


def _ended_by(bug: Exception) -> int:
    """Say what an error of no kind of ours was: an import for want of an extra, or a fault of this program."""
    from gantryctl.extras import EXTRA_OF, ExtraMissing

    package = (bug.name or "").partition(".")[0] if isinstance(bug, ModuleNotFoundError) else ""
    if package in EXTRA_OF:
        absent = ExtraMissing(package)
        tell(f"error: {absent}")
        return absent.exit_code
    tell(
        f"error: internal: {type(bug).__name__}: {bug}; this is a fault of gantryctl, please report it "
        f"({TRACEBACK_VARIABLE}=1 shows where)"
    )
    return INTERNAL


def _one_line(wrong: click.ClickException) -> str:
    """The fault of a command line and its help, in one line."""
    message = " ".join(wrong.format_message().split())
    message = message if message[-1:] in (".", "?", ")") else f"{message}."
    context = wrong.ctx if isinstance(wrong, click.UsageError) else None
    return message if context is None else f"{message} See `{context.command_path} --help`."


def main() -> None:
    """Entry point of the installed command."""
    code = run()
    for stream in (sys.stdout, sys.stderr):
        try:
            # What is still buffered: Python would complain at its end, and end with a code of its own.
            if stream is not None:
                stream.flush()
        except OSError:
            mute(stream)
            code = code or OUTPUT_CLOSED
    sys.exit(code)
