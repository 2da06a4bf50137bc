"""`gantryctl can`: who is on the bus, and what was said on it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from gantryctl.cli.options import bus_log_option, config_option, json_option, machine_of, print_json
from gantryctl.cli.values import FINITE, INPUT, PATH, Whole

if TYPE_CHECKING:
    from gantryctl.drives.canopen.decoding.decoder import DecodedFrame
    from gantryctl.drives.canopen.setup.survey import Found

# Stand here so that the help imports nothing of the bus; `drives.canopen.decoding` has the same.
KINDS: Final = ("nmt", "sync", "emcy", "tpdo", "rpdo", "sdo", "heartbeat", "other")


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
@click.option("--bitrate", type=Whole(10_000, 1_000_000), help="Where the interface sets it.")
@click.option("--eds", "eds_file", type=INPUT, help="Compare vendor and product with this EDS.")
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


@can.command()
@click.argument("file", type=PATH, required=False)
@click.option("--last", is_flag=True, help="The newest frames around an alarm; so too without FILE.")
@config_option
@click.option(
    "--eds",
    "eds_file",
    type=PATH,
    help="EDS or DCF of the drive: objects of telegrams that the log does not tell.",
)
@click.option("--node", "nodes", type=Whole(1, 127), multiple=True, help="Only this node; may be repeated.")
@click.option(
    "--kind", "kinds", type=click.Choice(KINDS), multiple=True, help="Only these frames; may be repeated."
)
@click.option("--from", "start_s", type=FINITE, help="From this time on, s.")
@click.option("--to", "end_s", type=FINITE, help="Up to this time, s.")
@json_option
def log(
    file: Path | None,
    last: bool,
    config_file: Path | None,
    eds_file: Path | None,
    nodes: tuple[int, ...],
    kinds: tuple[str, ...],
    start_s: float | None,
    end_s: float | None,
    as_json: bool,
) -> int:
    """Show the frames of FILE in words: what each is, the objects in it, their names and units.

    FILE is a log of this or another program: .log (candump), .asc, .blf, .trc, .csv, also with .gz. Without it, the
    newest frames around an alarm. Times count from the alarm, in another log from its first frame. What the telegrams
    hold and in which units is learnt from the log; --config and --eds tell what a log does not.
    """
    from gantryctl.errors import UsageError
    from gantryctl.operation.bus_log import last_frozen
    from gantryctl.trace.frames.files import read_alarms

    if last and file is not None:
        raise UsageError(f"--last and {file}: give one of them")
    start, end = (-math.inf if start_s is None else start_s), (math.inf if end_s is None else end_s)
    if not start <= end:
        raise UsageError(f"--from {start:g} s --to {end:g} s: the end must not be before the start")
    path = last_frozen() if file is None else file
    alarms = read_alarms(path)
    shown = (
        (time_s, each)
        for time_s, each in _decoded(path, alarms, config_file, eds_file)
        if start <= time_s <= end
        and (not nodes or each.node in nodes)
        and (not kinds or each.kind.value in kinds)
    )
    if as_json:
        zero_s = alarms[0][1] if alarms else 0.0
        print_json(
            {
                "file": str(path),
                "alarms": [{"code": code, "time_s": round(at_s - zero_s, 6)} for code, at_s in alarms],
                "frames": [_frame_data(time_s, each) for time_s, each in shown],
            }
        )
        return 0
    # Before anything is printed: a file that is no log is found at its first frame.
    first = next(shown, None)
    click.echo(str(path))
    for code, at_s in alarms:
        click.echo(f"{at_s - alarms[0][1]:+12.4f}  {code}")
    for time_s, each in () if first is None else chain((first,), shown):
        way = "sent" if each.frame.sent else "got"
        who = "" if each.node is None else f"node {each.node}"
        click.echo(
            f"{time_s:+12.4f}  {way:<4}  {each.frame.can_id:03X}  {each.frame.data.hex(' '):<23}  "
            f"{each.kind.value:<9}  {who:<8}  {each}".rstrip()
        )
    return 0


def _decoded(
    path: Path, alarms: list[tuple[str, float]], config_file: Path | None, eds_file: Path | None
) -> Iterator[tuple[float, DecodedFrame]]:
    """Frames of a log in words, each with its time from the first alarm, else from the first frame."""
    from gantryctl.drives.canopen.decoding.decoder import FrameDecoder
    from gantryctl.drives.od.reading import read_eds
    from gantryctl.trace.frames.files import read_frames
    from gantryctl.wiring.canopen import canopen_settings

    settings = None if config_file is None else canopen_settings(machine_of(config_file))
    values: dict[tuple[int, int], int] = {}
    for entry in read_eds(eds_file).entries() if eds_file is not None else ():
        value = entry.default if entry.value is None else entry.value
        if isinstance(value, int):
            values[entry.index, entry.sub] = value
    decoder, zero_s = FrameDecoder(settings, values), alarms[0][1] if alarms else None
    for frame in read_frames(path):
        zero_s = frame.time_s if zero_s is None else zero_s
        yield frame.time_s - zero_s, decoder.decode(frame)


def _frame_data(time_s: float, decoded: DecodedFrame) -> dict[str, Any]:
    return {
        "time_s": round(time_s, 6),
        "sent": decoded.frame.sent,
        "can_id": decoded.frame.can_id,
        "data": decoded.frame.data.hex(),
        "kind": decoded.kind.value,
        "node": decoded.node,
        "text": decoded.text,
        "objects": [
            {"object": each.place, "name": each.name, "value": each.value, "text": each.text}
            for each in decoded.objects
        ],
    }
