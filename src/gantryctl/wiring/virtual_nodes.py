"""Machine file to the virtual nodes beside a virtual drive, and to what is wired to them."""

from __future__ import annotations

from collections.abc import Callable

from gantryctl.drives.virtual.axis.hardware import LoadEncoder
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.encoder_node import EncoderNode
from gantryctl.drives.virtual.nodes.group import Neighbours
from gantryctl.drives.virtual.nodes.io_node import IoNode
from gantryctl.machine import Machine
from gantryctl.machine.tables.fields import Table
from gantryctl.wiring.simulator import ring_encoder


def wired(bits: Table) -> dict[str, int]:
    """Inputs or outputs that are wired, with their bits."""
    return {name: bit for name, bit in bits.model_dump().items() if bit >= 0}


def watchdog_s(machine: Machine) -> float:
    """Time of the watchdog relay; 0 where no output works one."""
    return machine.can.watchdog_ms * 1e-3 if machine.can.output_place("watchdog") else 0.0


def load_encoder(machine: Machine) -> LoadEncoder | None:
    """Encoder on the virtual ring, where the machine file names one on the bus."""
    named = machine.can.load_encoder
    if named.source == "none":
        return None
    offset = -named.zero_counts if named.inverted else named.zero_counts
    return LoadEncoder(*ring_encoder(machine), named.counts_per_turn, offset, named.inverted)


def virtual_neighbours(
    machine: Machine,
    drive: DriveNode,
    send: Callable[[int, bytes], None],
    *,
    io: bool = True,
    encoder: bool = True,
) -> Neighbours:
    """Nodes that the machine file names beside a virtual drive, wired to its axis.

    Args:
        send: takes their frames.
        io, encoder: make this one, where the file names it.
    """
    can, plant = machine.can, drive.plant
    first = second = None
    if io and can.io.node:
        first = IoNode(
            can.io.node, send, plant.cabinet, drive.wires, wired(can.io.inputs), wired(can.io.outputs),
            stepped=drive.stepped,
        )  # fmt: skip
    ring = drive.hardware.load_encoder
    if encoder and can.load_encoder.source == "node" and ring is not None:
        second = EncoderNode(
            can.load_encoder.node, send, plant.ring_counts, ring.counts, stepped=drive.stepped
        )
    return Neighbours(first, second)
