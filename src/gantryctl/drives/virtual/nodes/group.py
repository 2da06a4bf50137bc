"""Several virtual nodes on one bus, in the place of one."""

from __future__ import annotations

from typing import Final, NamedTuple, Protocol

from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.encoder_node import EncoderNode
from gantryctl.drives.virtual.nodes.io_node import IoNode
from gantryctl.drives.virtual.nodes.slave import Slave
from gantryctl.errors import UsageError


class Neighbour(Protocol):
    """Node beside the drive.

    Attributes:
        slave: its CANopen side.
    """

    slave: Slave

    def boot(self) -> None:
        """Power on."""
        ...


class Neighbours(NamedTuple):
    """Nodes beside a drive; None for one that the machine has not."""

    io: IoNode | None = None
    encoder: EncoderNode | None = None


SLAVE_FAULTS: Final = ("silent", "heartbeat_deaf", "mapping_ignored")
IO_FAULTS: Final = (*SLAVE_FAULTS, "inputs_stuck", "outputs_dead", "error_values_ignored")
ENCODER_FAULTS: Final = (*SLAVE_FAULTS, "frozen", "alarm", "jump")
_JUMP_MAX: Final = 1 << 32


def spoil(node: IoNode | EncoderNode, fault: str, value: object) -> None:
    """Set a standing fault of a node beside the drive; False, or 0 for a jump, ends it.

    Raises:
        UsageError: it has no such fault, or the value cannot be.
    """
    known = IO_FAULTS if isinstance(node, IoNode) else ENCODER_FAULTS
    if fault not in known:
        raise UsageError(f"node {node.slave.node_id} has no fault '{fault}'; it has: {', '.join(known)}")
    if fault == "jump":
        if not isinstance(value, int) or isinstance(value, bool) or abs(value) > _JUMP_MAX:
            raise UsageError(f"a jump is a whole number of steps up to {_JUMP_MAX}, got {value!r}")
    elif not isinstance(value, bool):
        raise UsageError(f"fault '{fault}' is true or false, got {value!r}")
    setattr(node.slave if fault in SLAVE_FAULTS else node, fault, value)


class NodeGroup:
    """Drive and the nodes beside it: every frame reaches all, and time goes on for all.

    Args:
        drive: first of them: at SYNC the others sample what the drive's plant has become.
        neighbours: the others.
    """

    def __init__(self, drive: DriveNode, neighbours: tuple[Neighbour, ...]) -> None:
        self.drive, self.neighbours = drive, neighbours

    @property
    def node_ids(self) -> tuple[int, ...]:
        """Node ids of all."""
        return (self.drive.node_id, *(node.slave.node_id for node in self.neighbours))

    @property
    def time_us(self) -> int:
        """Time of the drive."""
        return self.drive.time_us

    @property
    def stepped(self) -> bool:
        """Time goes on by SYNC only."""
        return self.drive.stepped

    def boot(self) -> None:
        """Power on."""
        self.drive.boot()
        for node in self.neighbours:
            node.boot()

    def advance(self, us: int) -> None:
        """Advance every node's time."""
        self.drive.advance(us)
        for node in self.neighbours:
            node.slave.advance(us)

    def on_frame(self, can_id: int, data: bytes) -> None:
        """Hand a frame to every node."""
        self.drive.on_frame(can_id, data)
        for node in self.neighbours:
            node.slave.on_frame(can_id, data)


def group_of(drive: DriveNode, neighbours: Neighbours) -> DriveNode | NodeGroup:
    """What is at the other end of the bus: the drive alone, or with the nodes beside it."""
    beside = tuple(node for node in neighbours if node is not None)
    return NodeGroup(drive, beside) if beside else drive
