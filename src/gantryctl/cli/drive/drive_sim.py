"""`gantryctl drive sim`: a CiA 402 servo drive on a CAN bus with the whole axis behind it, as its own process."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import config_option, machine_of, stop_signals, write_text
from gantryctl.cli.values import FINITE, PATH, Whole

if TYPE_CHECKING:
    import threading

    import can

    from gantryctl.drives.virtual.loop import DriveLoop
    from gantryctl.drives.virtual.node import DriveNode
    from gantryctl.drives.virtual.personality import Personality


@click.command("sim")
@config_option
@click.option("--can", "interface", help="python-can interface: socketcan, udp_multicast, slcan, pcan ...")
@click.option("--channel", help="Channel of the interface: can0, a multicast address, a serial port ...")
@click.option("--bitrate", type=Whole(10_000, 1_000_000), help="Bit rate, where the interface sets it.")
@click.option("--node", "node_id", type=Whole(1, 127), default=2, show_default=True, help="Node id.")
@click.option(
    "--personality", "names", multiple=True, help="Quirk of a drive model; may be repeated. See --list."
)
@click.option(
    "--objects",
    "table_file",
    type=PATH,
    help="EDS, DCF or object table (CSV) of a drive model: the bus sees what it has, with its access and limits.",
)
@click.option(
    "--drive", "model", default="", help="Which drive of a table with several: how its name begins."
)
@click.option("--with-io", is_flag=True, help="The I/O node of [can.io] too, wired to the axis.")
@click.option("--with-encoder", is_flag=True, help="The encoder node of [can.load_encoder] too, on the ring.")
@click.option("--stepped", is_flag=True, help="Virtual time: each SYNC steps the drive by the SYNC period.")
@click.option("--angle", type=FINITE, help="Angle of the axis at the start, deg; else that of a new machine.")
@click.option("--control", type=PATH, help="Unix socket of the side channel: faults in, truth out.")
@click.option("--store", type=PATH, help="File of stored parameters (1010, 1011); in memory when not given.")
@click.option("--write-eds", "eds_file", type=PATH, help="Write the drive's EDS to this file and end.")
@click.option("--list", "list_them", is_flag=True, help="List the personalities and end.")
def sim(interface: str | None, eds_file: Path | None, list_them: bool, **given: Any) -> int:
    """A CiA 402 servo drive with the whole axis behind it, on a CAN bus, until Ctrl-C or SIGTERM.

    Two terminals: `gantryctl drive sim --can udp_multicast`, and a master on the same interface.
    """
    from gantryctl.errors import UsageError

    if list_them:
        _list()
        return 0
    kind = _kind(given)
    if eds_file is not None:
        _write_eds(eds_file, given["config_file"], kind)
        return 0
    if interface is None:
        raise UsageError(
            "--can is missing: which python-can interface (socketcan, udp_multicast, slcan ...)?"
        )
    from gantryctl.drives.canopen.bus.link import open_bus

    bus = open_bus(interface, given["channel"], given["bitrate"])
    try:
        _serve(bus, interface, kind, given)
    finally:
        bus.shutdown()
    return 0


def _kind(given: dict[str, Any]) -> Personality:
    from gantryctl.drives.od.object_table import read_objects_of
    from gantryctl.drives.virtual.personality import personality
    from gantryctl.wiring.virtual import as_in_table

    kind = personality(given["names"])
    if given["table_file"] is None:
        return kind
    # What the maker's tool sets, and no dictionary tells, is in the machine file.
    machine = machine_of(given["config_file"])
    return as_in_table(kind, read_objects_of(given["table_file"], given["model"]), machine)


def _list() -> None:
    from gantryctl.drives.virtual.personality import PERSONALITIES

    width = max(map(len, PERSONALITIES))
    for name, kind in PERSONALITIES.items():
        click.echo(f"{name:{width}}  {kind.summary}")


def _write_eds(file: Path, config_file: Path | None, kind: Personality) -> None:
    from gantryctl.drives.od.writing import write_eds
    from gantryctl.drives.virtual.communication.objects import device_tables
    from gantryctl.wiring.virtual import drive_hardware

    # The table that the drive answers from is what is written: behaviour and file cannot differ (decision 0008).
    _, visible = device_tables(drive_hardware(machine_of(config_file)), kind)
    write_text(file, write_eds(visible))
    click.echo(f"wrote {file}: {len(visible.objects)} objects, personality {kind.name}")


def _serve(bus: can.BusABC, interface: str, kind: Personality, given: dict[str, Any]) -> None:
    import threading
    from contextlib import nullcontext

    from gantryctl.drives.virtual.communication.parameters import ParameterStore
    from gantryctl.drives.virtual.loop import DriveLoop, FrameSender
    from gantryctl.drives.virtual.node import DriveNode
    from gantryctl.drives.virtual.nodes.group import group_of
    from gantryctl.drives.virtual.side_channel.control import ControlServer
    from gantryctl.drives.virtual.side_channel.requests import Requests
    from gantryctl.errors import UsageError
    from gantryctl.wiring.virtual import drive_hardware
    from gantryctl.wiring.virtual_nodes import virtual_neighbours

    machine = machine_of(given["config_file"])
    if given["with_io"] and not machine.can.io.node:
        raise UsageError("--with-io: [can.io] node is 0, the machine has no such node")
    if given["with_encoder"] and machine.can.load_encoder.source != "node":
        raise UsageError('--with-encoder: [can.load_encoder] source is not "node"')
    angle = None if given["angle"] is None else machine.axis.meant_deg(given["angle"])
    hardware = drive_hardware(machine, angle)
    link = FrameSender(bus)
    store = ParameterStore(given["store"])
    node = DriveNode(hardware, given["node_id"], link.send, kind=kind, store=store, stepped=given["stepped"])
    beside = virtual_neighbours(
        machine, node, link.send, io=given["with_io"], encoder=given["with_encoder"]
    )  # fmt: skip
    loop = DriveLoop(group_of(node, beside), link)
    stop, path = threading.Event(), given["control"]
    control = nullcontext() if path is None else ControlServer(path, Requests(node, beside).answer, loop.lock)
    with stop_signals(stop.set), control:
        _run(loop, node, stop, interface, given)


def _run(
    loop: DriveLoop, node: DriveNode, stop: threading.Event, interface: str, given: dict[str, Any]
) -> None:
    from contextlib import nullcontext

    from gantryctl.drives.virtual.nodes.group import NodeGroup
    from gantryctl.runtime import keeps_time

    how = "stepped by SYNC" if node.stepped else "in real time"
    where = interface if given["channel"] is None else f"{interface} {given['channel']}"
    click.echo(f"virtual drive: node {node.node_id} on {where}, {how}, personality {node.kind.name}")
    if isinstance(loop.node, NodeGroup):
        click.echo(f"beside it: node {', '.join(map(str, loop.node.node_ids[1:]))}")
    if given["control"] is not None:
        click.echo(f"side channel: {given['control']}")
    # The side channel answers in a thread of its own: the lock keeps the node whole.
    with loop.lock:
        loop.node.boot()
    # Stepped, every SYNC is a period: the clock of the computer has no part in it.
    with nullcontext() if node.stepped else keeps_time():
        loop.run(stop)
    lost = f"; {loop.lost_us / 1000:.0f} ms lost to a slow computer" if loop.lost_us else ""
    refused = f"; {loop.link.refused} frames refused by the bus" if loop.link.refused else ""
    click.echo(f"virtual drive: stopped after {node.time_us * 1e-6:.3f} s of its own time{lost}{refused}")
