"""`gantryctl serve`: the controller as a service."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import click

from gantryctl.cli.options import config_option, proven_machine
from gantryctl.cli.values import PATH, LogPath, Whole, check_lasting
from gantryctl.extras import need

Command: TypeAlias = Callable[..., Any]


def _megabytes(name: str, default: int, text: str) -> Callable[[Command], Command]:
    whole = Whole(0, 10_000_000)
    return click.option(name, type=whole, default=default, show_default=True, metavar="MB", help=text)


@click.command()
@config_option
@click.option(
    "--listen",
    default="127.0.0.1:8650",
    show_default=True,
    metavar="HOST:PORT",
    help="Address of the page; port 0 for a free one.",
)
@click.option("--tls-cert", type=PATH, help="Certificate (PEM), needed for another host than loopback.")
@click.option("--tls-key", type=PATH, help="Its private key (PEM).")
@click.option(
    "--name", "names", multiple=True, help="Host name under which browsers reach the page; may be repeated."
)
@click.option("--opcua", metavar="HOST:PORT", help="OPC UA for looking only; needs gantryctl[opcua].")
@click.option(
    "--second-person",
    is_flag=True,
    help="Brake test and reset of locked alarms: one person arms, another one executes.",
)
@_megabytes("--journal-size", 500, "The oldest events are taken out beyond this.")
@click.option(
    "--journal-days",
    type=Whole(0, 36_500),
    default=0,
    metavar="DAYS",
    help="Events older than this are taken out; without it none is too old.",
)
@_megabytes("--traces-size", 5000, "The oldest recordings are removed beyond this.")
@_megabytes("--reserve", 64, "With less free on the disk nothing is recorded.")
@_megabytes("--event-reserve", 16, "With less free no new motion begins.")
@click.option(
    "--bus-log",
    "bus_log",
    type=LogPath(),
    help="Log of all frames of the bus: .log (candump), .asc, .blf ...",
)
@click.option(
    "--bus-log-size",
    type=Whole(1, 10_000_000),
    default=500,
    show_default=True,
    metavar="MB",
    help="A larger file of it is followed by the next one: NAME-2.log, NAME-3.log ...",
)
@click.option(
    "--bus-log-files",
    type=Whole(1, 10_000),
    default=8,
    show_default=True,
    help="How many of them are kept; the oldest are removed.",
)
@click.option("--no-page", is_flag=True, help="Only the controller, the journal and the local socket.")
def serve(
    config_file: Path | None,
    listen: str,
    tls_cert: Path | None,
    tls_key: Path | None,
    names: tuple[str, ...],
    opcua: str | None,
    second_person: bool,
    journal_size: int,
    journal_days: int,
    traces_size: int,
    reserve: int,
    event_reserve: int,
    bus_log: Path | None,
    bus_log_size: int,
    bus_log_files: int,
    no_page: bool,
) -> int:
    """Run the controller with its operator page until Ctrl-C.

    Virtual gantry by default. Only this machine can reach the page unless --listen names another address, which needs
    TLS and users (`gantryctl user add`). Ctrl-C brings the axis to rest, closes the brake and closes the journal.
    """
    if opcua:
        need("asyncua")
    from gantryctl.cli.service.serving import Listen, run_service
    from gantryctl.service.recorder.retention import RetentionPolicy

    check_lasting(config_file, "serve")
    # A quick stop that motor or reducer cannot give is found before anything runs, not when it is needed.
    machine = proven_machine(config_file)
    # Loopback unless another address is named: then TLS and users are asked for (docs/explanation/security.md).
    page = None if no_page else Listen(listen, tls_cert, tls_key, names)
    keeping = RetentionPolicy(
        journal_size, journal_days, traces_size, reserve, event_reserve, bus_log_size, bus_log_files
    )
    return run_service(
        machine, config_file, page, opcua, keeping=keeping, second_person=second_person, bus_log=bus_log
    )
