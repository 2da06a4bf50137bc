"""Digital inputs and outputs on a node of their own (CiA 401)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.mapping import Mapping, Pdo, Signal
from gantryctl.drives.canopen.nodes.bus_node import BusNode, NodeObject, communication_objects
from gantryctl.drives.canopen.settings import CanopenSettings, IoNodeSettings

_READ: Final = 0x6000
_WRITE: Final = 0x6200
_ALL: Final = 0xFF


def _bytes_for(bits: tuple[int | None, ...]) -> int:
    """Bytes, of eight inputs or outputs each, up to the highest bit in use."""
    used = [bit for bit in bits if bit is not None]
    return max(used) // 8 + 1 if used else 0


class IoNode:
    """I/O node: its inputs come with the answers to SYNC, its outputs act at the next SYNC.

    Its outputs fall to 0 when the controller's heartbeat is missing: 6206 and 6207 of every byte in use are written
    and read back, and a node without them is refused where an output must be safe (brake, watchdog, drive enable).

    Args:
        remote: the node, on the link of the drive.
        settings: of the axis.
        io: bits.
        in_time: whether the scan still waits for telegrams.

    Attributes:
        node: the connection.
    """

    def __init__(
        self, remote: RemoteNode, settings: CanopenSettings, io: IoNodeSettings, in_time: Callable[[], bool]
    ) -> None:
        self.settings, self._settings = io, settings
        # One byte of inputs at the least: its telegram shows that the node lives.
        read, write = max(1, _bytes_for(io.inputs)), _bytes_for(io.outputs)
        self._size = write
        tpdos = (Pdo(0, _signals(_READ, read)),)
        rpdos = (Pdo(0, _signals(_WRITE, write)),) if write else ()
        safe = self.holds_axis
        objects = communication_objects(settings, watches_controller=safe)
        if safe:
            deadline = round(settings.rpdo_deadline_s * 1e3)
            objects += (NodeObject(0x1400, 5, 2, deadline, "it watches for its telegrams, ms"),)
        for sub in range(1, read + 1):
            objects += (NodeObject(0x6002, sub, 1, 0, "inputs are not inverted"),)
        for sub in range(1, write + 1):
            objects += (
                NodeObject(0x6202, sub, 1, 0, "outputs are not inverted"),
                NodeObject(0x6206, sub, 1, _ALL, "outputs take their error values", safe),
                NodeObject(0x6207, sub, 1, 0, "the error value of every output is off", safe),
            )
        self.node = BusNode(remote, settings, "I/O", Mapping(rpdos, tpdos), objects, in_time)

    @property
    def holds_axis(self) -> bool:
        """Brake, watchdog relay or enable of the drive are worked by this node."""
        outputs = self.settings.outputs
        return any(bit is not None for bit in (outputs.brake_release, outputs.watchdog, outputs.drive_enable))

    def ask_silence_limit_s(self) -> float:
        """Longest time from the last sign of the controller until the outputs fall.

        Raises:
            DeviceError: the node does not answer.
        """
        settings, sdo = self._settings, self.node.remote.sdo
        by_telegram = sdo.optional(0x1400, 5) == round(settings.rpdo_deadline_s * 1e3)
        return settings.rpdo_deadline_s if by_telegram else settings.heartbeat_timeout_s

    @property
    def word(self) -> int | None:
        """Inputs of the last telegram, the first as bit 0; None before the first."""
        data = self.node.watch.data
        return None if data is None else int.from_bytes(data, "little")

    def send(self, word: int) -> None:
        """Send the outputs."""
        if self._size:
            self.node.send(word.to_bytes(self._size, "little"))


def _signals(index: int, count: int) -> tuple[Signal, ...]:
    return tuple(Signal(index, sub, 8, False) for sub in range(1, count + 1))
