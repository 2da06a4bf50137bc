"""`gantryctl instrument`: try an instrument at the load, or serve a simulated one."""

from __future__ import annotations

from pathlib import Path

import click

from gantryctl.cli.options import (
    choice_option,
    config_option,
    json_option,
    machine_of,
    print_json,
    seed_option,
    stop_signals,
)
from gantryctl.cli.values import PATH, Whole


@click.group()
def instrument() -> None:
    """Instruments that measure the angle of the load (docs/reference/instrument-port.md)."""


@instrument.command()
@click.argument("address")
@json_option
def read(address: str, as_json: bool) -> int:
    """Take one reading of the instrument at ADDRESS: tcp:HOST:PORT or serial:DEVICE:BAUD."""
    from contextlib import closing

    from gantryctl.engineering.instruments import LinePort, parse_address

    with closing(LinePort(parse_address(address))) as port:
        reading = port.read(0.0)
    if as_json:
        print_json({"instrument": port.name, **reading._asdict()})
    else:
        click.echo(
            f"{port.name}: {reading.angle_deg:.6f} deg, standard uncertainty {reading.uncertainty_deg:.6f} deg"
        )
    return 0


@instrument.command()
@config_option
@click.option(
    "--control", type=PATH, required=True, help="Side channel of the virtual drive: drive sim --control."
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=Whole(0, 65535), default=4711, show_default=True, help="0 takes a free one.")
@choice_option(
    "--kind",
    ("tracker", "level", "autocollimator", "ring-encoder", "ring-encoder-2-heads"),
    "What it is: the errors of its data sheet.",
)
@seed_option
def sim(config_file: Path | None, control: Path, host: str, port: int, kind: str, seed: int) -> int:
    """A simulated instrument that watches the load of a virtual drive, until Ctrl-C or SIGTERM.

    Radius and noise of a tracker are those of [accuracy]. What is systematic is drawn once by the seed, the rest at
    every reading; a stand drifts between them.
    """
    import threading

    from gantryctl.drives.virtual.side_channel.control import ControlClient
    from gantryctl.engineering.instruments.line_server import LineServer
    from gantryctl.engineering.instruments.sources import SimulatedInstrument, sources_of
    from gantryctl.units import deg

    accuracy = machine_of(config_file).accuracy
    sources = sources_of(kind, accuracy.chord_radius_m, accuracy.tracker_noise_um)
    stop = threading.Event()
    with ControlClient(control) as drive:
        watching = SimulatedInstrument(
            kind, lambda _: deg(float(drive.ask("truth")["pos_load_rad"])), sources, seed
        )
        with LineServer(watching, lambda: float(drive.ask("truth")["time_s"]), host, port) as server:
            click.echo(f"{watching.name}: tcp:{host}:{server.port}")
            with stop_signals(stop.set):
                stop.wait()
    return 0
