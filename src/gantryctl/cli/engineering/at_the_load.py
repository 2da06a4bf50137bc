"""The instrument at the load that a command line names: behind a port, read by a person, or simulated."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import click

from gantryctl.cli.options import Option
from gantryctl.cli.values import FINITE, number_of

if TYPE_CHECKING:
    from gantryctl.engineering.instruments import Instrument
    from gantryctl.operation.run import AxisRun

BY_HAND: Final = "hand"
SIMULATED: Final = "simulated"
LOAD_ENCODER: Final = "load-encoder"


# Readings of a model come from no instrument that could have one.
SIMULATED_CERTIFICATE: Final = "none: simulated"
certificate_option = click.option(
    "--certificate",
    default="",
    metavar="TEXT",
    help="Certificate of the instrument's calibration, for the report.",
)


def certificate_of(place: str | None, stated: str) -> str:
    """The certificate for the report, of the instrument that was named."""
    return SIMULATED_CERTIFICATE if place == SIMULATED else stated


def instrument_options(default: str | None) -> Option:
    """The options that name the instrument at the load, and its certificate."""

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        told = click.option(
            "--uncertainty-deg",
            type=FINITE,
            help="Standard uncertainty (k = 1) of a reading by hand or of the load encoder, deg.",
        )
        named = click.option(
            "--instrument",
            "place",
            default=default,
            show_default=True,
            help="At the load: tcp:HOST:PORT, serial:DEVICE:BAUD, hand (a person types the readings), load-encoder "
            "(on the ring, on the bus), or simulated.",
        )
        return named(told(certificate_option(command)))

    return add


def open_instrument(run: AxisRun, place: str, uncertainty_deg: float | None, seed: int) -> Instrument:
    """The instrument that was named; one behind a port has answered.

    Args:
        seed: of a simulated one.

    Raises:
        UsageError: not the name of an instrument, or its uncertainty is missing. InstrumentError: nobody answers.
    """
    from gantryctl.engineering.accuracy.attended.report import simulated_tracker
    from gantryctl.engineering.instruments import ByHand, LinePort, RingEncoder, parse_address
    from gantryctl.errors import UsageError
    from gantryctl.operation.state import operator_name
    from gantryctl.units import deg

    if place == SIMULATED:
        return simulated_tracker(run.machine, run.drive.truth_source, seed)
    if place == LOAD_ENCODER:
        source = run.machine.can.load_encoder.source if run.machine.on_bus else "none"
        if source == "none":
            raise UsageError(f"{run.machine.name}: no encoder on the ring: [can.load_encoder] source")
        name = f"ring encoder of the machine ({source})"
        return RingEncoder(
            name, _stated(place, uncertainty_deg), lambda: deg(run.engine.image.drive.pos_ring_rad)
        )
    if place == BY_HAND:
        return ByHand(operator_name(), _stated(place, uncertainty_deg), Typed().number)
    port = LinePort(parse_address(place))
    port.identify()
    return port


def _stated(place: str, uncertainty_deg: float | None) -> float:
    """Uncertainty of an instrument that does not say its own."""
    from gantryctl.errors import UsageError

    if uncertainty_deg is None:
        raise UsageError(
            f"--uncertainty-deg is missing: the standard uncertainty of a reading by {place}, deg"
        )
    return uncertainty_deg


class Typed:
    """Numbers that a person types."""

    def __init__(self) -> None:
        self._text = ""

    def number(self) -> float:
        """The next one.

        Raises:
            InstrumentError: not a number, or the input has ended.
        """
        from gantryctl.errors import InstrumentError

        click.echo("reading, deg: ", nl=False, err=True)
        line = self._line()
        if not line:
            raise InstrumentError("no reading: the input has ended")
        try:
            return number_of(line.strip().replace(",", "."))
        except ValueError:
            raise InstrumentError(f"{line.strip()[:40]!r} is no angle in deg") from None

    def _line(self) -> str:
        # None: closed before the start.
        while "\n" not in self._text and sys.stdin is not None:
            try:
                # Not through the buffer of sys.stdin: its lock would hold up the end of the process while this waits.
                more = os.read(sys.stdin.fileno(), 4096).decode(errors="replace")
            except (OSError, ValueError):  # a standard input without a file, as under a test
                more = sys.stdin.readline()
            if not more:
                break
            self._text += more
        line, end, self._text = self._text.partition("\n")
        return line + end
