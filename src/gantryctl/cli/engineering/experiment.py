"""What experiments on a machine have in common: which machine, which plan, who agrees, which instrument."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from gantryctl.cli.engineering.at_the_load import BY_HAND, LOAD_ENCODER, SIMULATED, open_instrument
from gantryctl.cli.options import confirm, stop_signals
from gantryctl.cli.progress import metered
from gantryctl.cli.values import FINITE
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.engineering.instruments import Instrument
    from gantryctl.machine import Machine
    from gantryctl.operation.run import AxisRun

_OTHERWISE: Final = "may be repeated. [accuracy] {key}, or the travel's own, when not given."

speeds_option = click.option(
    "--speed",
    "speeds_deg_s",
    type=FINITE,
    multiple=True,
    help="Speed of the speed test, deg/s; may be repeated. [accuracy] speeds_deg_s, or lowest setting, half of the "
    "highest and the highest, when not given.",
)


yes_option = click.option("--yes", is_flag=True, help="On a real machine: move without asking.")


def machine_under_test(config_file: Path | None, what: str, *, calibrated: bool = True) -> Machine:
    """A machine with something to measure: simulated in this process, or with a drive on a bus.

    Args:
        calibrated: with the calibration file that it names; without, it may be missing or of another version.

    Raises:
        UsageError: its drive is ideal. ConfigError: its file, or a quick stop that motor or reducer cannot give.
    """
    from gantryctl.engineering.stops import check_quick_stop
    from gantryctl.errors import UsageError
    from gantryctl.machine import default_machine_path, load_machine, load_uncalibrated

    machine = (load_machine if calibrated else load_uncalibrated)(config_file or default_machine_path())
    if machine.drive.kind == "ideal":
        raise UsageError(
            f'{what} needs a drive with an axis behind it, {machine.name} has [drive] kind = "ideal": use "sim" or '
            '"canopen"'
        )
    if machine.on_bus:
        check_quick_stop(machine)
    return machine


def plan_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--base` and `--displacement`: the command gets `bases_deg` and `displacements_deg`, empty if not given."""
    options = (
        click.option(
            "--base", "bases_deg", type=FINITE, multiple=True,
            help=f"Base of the chord test, deg; {_OTHERWISE.format(key='bases_deg')}",
        ),
        click.option(
            "--displacement", "displacements_deg", type=FINITE, multiple=True,
            help=f"Chord from every base, deg; {_OTHERWISE.format(key='displacements_deg')}",
        ),
    )  # fmt: skip
    for option in reversed(options):
        command = option(command)
    return command


@contextmanager
def asking(machine: Machine, moves: str, *, yes: bool) -> Iterator[Callable[[AxisRun], None]]:
    """What asks a person before a real gantry moves, and refuses without a yes.

    From then on Ctrl-C, SIGTERM and a lost terminal stop the run, until it has closed: it may hold the load then.

    Args:
        moves: what will move, for the question.
    """
    from gantryctl.operation.client import Stop

    runs: list[AxisRun] = []

    def agree(run: AxisRun) -> None:
        if run.must_ask and not yes:
            tell(
                f"{machine.name}: {moves}; now at {machine.axis.dial.text(run.angle_deg, '.2f')} deg",
            )
            confirm("Begin?", "nothing moved")
        if runs:  # asked as the run before closed
            run.stop = runs[0].stop
        runs[:] = [run]

    def stop() -> None:
        if not runs:  # nothing is powered yet
            raise KeyboardInterrupt
        runs[0].stop = Stop(min(runs[0].stop + 1, Stop.QUICK))

    with stop_signals(stop):
        yield agree


@contextmanager
def bus_experiment(
    machine: Machine,
    moves: str,
    *,
    takes_s: float,
    yes: bool,
    quiet: bool,
    controlled_as: Machine | None = None,
    needs_torque: bool = True,
) -> Iterator[AxisRun]:
    """A machine on a bus under power, after somebody has agreed; Ctrl-C stops it.

    Args:
        moves: what will move, for the question.
        takes_s: axis time that it takes, about, for the progress. quiet: show none.
    """
    from gantryctl.engineering.analysis.measured.on_engine import experiment

    with (
        asking(machine, moves, yes=yes) as agree,
        experiment(machine, controlled_as=controlled_as, agree=agree, needs_torque=needs_torque) as run,
        metered(takes_s, quiet=quiet) as meter,
    ):
        run.observe(meter.observer())
        yield run


def instrument_at(place: str, run: AxisRun, seed: int) -> Instrument:
    """What watches the load while it moves: simulated, or behind a port.

    Raises:
        UsageError: it cannot watch a moving load. InstrumentError: the instrument does not answer.
    """
    from gantryctl.errors import UsageError

    # A person is too slow, and the ring encoder, which is recorded beside, is what the instrument is to correct.
    if place in (BY_HAND, LOAD_ENCODER):
        raise UsageError(
            f"--instrument {place}: on a bus it must see the moving load in space: {SIMULATED}, tcp:HOST:PORT or "
            "serial:DEVICE:BAUD"
        )
    return open_instrument(run, place, None, seed)
