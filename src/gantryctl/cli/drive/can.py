"""`gantryctl can scan`: who is on the bus."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import PATH, bus_log_option, config_option, json_option, machine_of, print_json

if TYPE_CHECKING:
    from gantryctl.drives.canopen.setup.survey import Found


@click.group()
def can() -> None:
    """The CAN bus."""


@can.command()
@bus_log_option
@config_option
@click.option(
    "--can", "interface", help="python-can interface; [can] interface of the machine file when not given."
)
@click.option("--channel", help="Channel of the interface; [can] channel when not given.")
@click.option("--bitrate", type=click.IntRange(10_000, 1_000_000), help="Where the interface sets it.")
@click.option("--eds", "eds_file", type=PATH, help="Compare vendor and product with this EDS.")
@json_option
def scan(
    config_file: Path | None,
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    eds_file: Path | None,
    as_json: bool,
) -> int:
    """List every node that answers: identity, versions, modes, state, and dangers; only reads.

    Exit code 1 when no node answers.
    """
    from gantryctl.drives.canopen.setup.survey import survey
    from gantryctl.machine import with_values
    from gantryctl.wiring.canopen import can_link

    machine = machine_of(config_file)
    # Over the machine file, so that a bus can be scanned before there is one for it.
    given = {"can.interface": interface, "can.channel": channel, "can.bitrate": bitrate}
    machine = with_values(machine, {path: value for path, value in given.items() if value is not None})
    eds_path = eds_file or (Path(machine.can.eds) if machine.can.eds else None)
    link = can_link(machine)
    try:
        found = survey(link)
    finally:
        link.close()
    promised = _promised(eds_path)
    if as_json:
        print_json([_data(node, promised) for node in found])
    else:
        for node in found:
            _print(node, promised)
        if not found:
            click.echo("no node answers: supply, cable, terminators, bit rate?")
    return int(not found)


def _promised(eds_file: Path | None) -> tuple[int | None, int | None] | None:
    """Vendor and product number of an EDS."""
    if eds_file is None:
        return None
    from gantryctl.drives.od.reading import read_eds

    info = read_eds(eds_file).info
    return info.vendor_number, info.product_number


def _match(node: Found, promised: tuple[int | None, int | None] | None) -> str | None:
    if promised is None or node.identity is None:
        return None
    # Object 1018, sub-indices 1 and 2.
    same = promised == (node.identity.vendor, node.identity.product)
    return "EDS belongs to it" if same else "EDS is of another device"


def _print(node: Found, promised: tuple[int | None, int | None] | None) -> None:
    who = node.identity
    click.echo(
        f"node {node.node}: {who.text if who else 'does not answer'} · NMT {node.nmt.lower().replace('_', '-')}"
    )
    if who is not None:
        click.echo(
            f"  identity    vendor {who.vendor:08X}h, product {who.product:08X}h, revision {who.revision:08X}h"
        )
    if node.state is not None:
        # Object 6502, supported drive modes: bit 8 is cyclic synchronous velocity (IEC 61800-7-201).
        modes = (
            "not said"
            if node.modes is None
            else f"{node.modes:X}h{', CSV' if node.modes & 0x100 else ', no CSV'}"
        )
        click.echo(f"  drive       {node.state.name.lower().replace('_', ' ')}, modes {modes}")
    match = _match(node, promised)
    if match is not None:
        click.echo(f"  EDS         {match}")
    for remark in node.remarks:
        click.echo(f"  ! {remark}")


def _data(node: Found, promised: tuple[int | None, int | None] | None) -> dict[str, Any]:
    return {
        "node": node.node,
        "nmt": node.nmt,
        "identity": None if node.identity is None else node.identity._asdict(),
        "modes": node.modes,
        "state": None if node.state is None else node.state.name,
        "eds": _match(node, promised),
        "remarks": list(node.remarks),
    }
