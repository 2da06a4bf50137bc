"""What is on the SYNC of the axis beside its drive: an I/O node, an encoder on the ring."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.diagnostics import TpdoWatch
from gantryctl.drives.canopen.nodes.bus_node import BusNode
from gantryctl.drives.canopen.nodes.inputs import InputReader
from gantryctl.drives.canopen.nodes.io_node import IoNode
from gantryctl.drives.canopen.nodes.outputs import OutputWriter
from gantryctl.drives.canopen.nodes.ring_encoder import RingAngle, RingEncoder
from gantryctl.drives.canopen.process_image import ProcessImage
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.image import DigitalInputs, LinkFlag, NodeHealth, OutputImage

_BRIDGED_S: Final = 0.030


class Neighbours:
    """Nodes beside the drive, and the inputs, outputs and second reading of the axis, wherever they are.

    Args:
        drive: node of the drive: the others share its link.
        settings: of the axis.
        in_time: whether the scan still waits for telegrams.

    Attributes:
        inputs: digital inputs by name.
        outputs: words of the outputs.
    """

    def __init__(self, drive: RemoteNode, settings: CanopenSettings, in_time: Callable[[], bool]) -> None:
        self._settings, self._drive = settings, drive
        io, encoder = settings.io, settings.load_encoder
        self.io = None if io is None else IoNode(self._remote(drive, io.node), settings, io, in_time)
        self.encoder: RingEncoder | None = None
        self._ring: RingAngle | None = None
        if encoder is not None and encoder.node is not None:
            remote = self._remote(drive, encoder.node)
            self.encoder = RingEncoder(remote, settings, encoder, in_time)
        self.nodes: tuple[BusNode, ...] = tuple(
            part.node for part in (self.io, self.encoder) if part is not None
        )
        self.inputs = InputReader(settings.inputs, None if io is None else io.inputs)
        self.outputs = OutputWriter(settings)
        self._old_scans = max(3, int(_BRIDGED_S / settings.period_s + 1e-9))

    def _remote(self, drive: RemoteNode, node: int) -> RemoteNode:
        return RemoteNode(drive.link, node, drive.master_node, self._settings.sdo_timeout_s, beside=drive)

    def open(self) -> None:
        """Set all nodes up and start them.

        Raises:
            DeviceError: one of them cannot be used.
        """
        if self.io is not None:
            self.io.node.open()
        if self.encoder is not None:
            self.encoder.open()
            self._ring = self.encoder.angle
        elif (encoder := self._settings.load_encoder) is not None:
            self._ring = RingAngle(encoder, encoder.counts_per_turn, self._settings.period_s)
        self.outputs = OutputWriter(self._settings)

    def release(self) -> None:
        """Take all nodes out of operation: from now on a silent controller is no failure."""
        for node in self.nodes:
            node.release()

    @property
    def watches(self) -> tuple[TpdoWatch, ...]:
        """Telegrams of all nodes."""
        return tuple(node.watch for node in self.nodes)

    def health(self) -> tuple[NodeHealth, ...]:
        """Identity and telegrams of all nodes."""
        return tuple(
            NodeHealth(
                each.remote.node,
                each.identity.key,
                each.watch.received,
                each.watch.missed,
                each.watch.longest_age,
            )
            for each in self.nodes
            if each.identity is not None
        )

    @property
    def changed(self) -> bool:
        """Only a new set-up makes one of them usable again."""
        return any(node.changed for node in self.nodes)

    # --- the scan ------------------------------------------------------------------------------------------------

    def begin(self, periods: int) -> None:
        """SYNC goes out, `periods` after the one before."""
        for node in self.nodes:
            node.begin(periods)
        if self._ring is not None:
            self._ring.begin(periods)

    def resume(self) -> None:
        """Start all nodes again after an intended silence.

        Raises:
            DeviceError: one of them has restarted.
        """
        for node in self.nodes:
            node.resume()

    def check_answers(self) -> None:
        """Refuse a node that has not answered SYNC.

        Raises:
            DeviceError: its telegram is missing.
        """
        for node in self.nodes:
            node.check_answer()

    def flags(self, commanded: bool) -> LinkFlag:
        """Flags of the nodes in this scan."""
        flags = LinkFlag.NONE
        if self.io is not None and self.io.node.judge(commanded):
            flags |= LinkFlag.IO_LOST
        if self.encoder is not None and self.encoder.node.judge(commanded):
            flags |= LinkFlag.LOAD_ENCODER_LOST
        return flags

    def read_inputs(self, drive_word: int | None, *, keep: bool) -> DigitalInputs:
        """Digital inputs of this scan.

        Args:
            drive_word: 60FD; None where the drive has none.
            keep: the inputs of a lost node keep their last levels; else they show their safe state.
        """
        io = self.io
        word = None if io is None or (io.node.lost and not keep) else io.word
        return self.inputs.read(drive_word, word)

    def brake_contact(self) -> bool | None:
        """Level of the brake contact in this scan; None where it is not wired, or its node is lost."""
        io = self.io
        if io is not None and io.node.lost and io.settings.inputs.brake_open is not None:
            return None
        return self.inputs.brake_contact()

    def watchdog_contact(self) -> bool | None:
        """Contact of the watchdog relay in this scan; None where it is not wired."""
        return self.inputs.watchdog_contact()

    def ask_brake_contact(self) -> bool | None:
        """Level of the brake contact by SDO, where telegrams may be missing; None where it is not wired.

        Raises:
            DeviceError: it cannot be read.
        """
        return self._ask("brake_open")

    def ask_watchdog_contact(self) -> bool | None:
        """Contact of the watchdog relay by SDO; None where it is not wired.

        Raises:
            DeviceError: it cannot be read.
        """
        return self._ask("watchdog_closed")

    def _ask(self, name: str) -> bool | None:
        io = self.io
        bit: int | None = getattr(self._settings.inputs, name)
        at_node: int | None = None if io is None else getattr(io.settings.inputs, name)
        if io is not None and at_node is not None:
            group = io.node.remote.sdo.read(0x6000, at_node // 8 + 1)
            return bool(group[0] >> at_node % 8 & 1)
        word = None if bit is None else self._drive.sdo.optional(0x60FD)
        return None if bit is None or word is None else bool(word >> bit & 1)

    def ring_rad(self, process: ProcessImage) -> float:
        """Angle by the encoder on the ring; 0 without one, NaN for a reading that is not to be believed."""
        if self.encoder is not None:
            return self.encoder.angle_rad()
        if self._ring is None:
            return 0.0
        raw, age = process.ring
        angle = self._ring.read(raw, age)
        return math.nan if age >= self._old_scans else angle

    def send(self, output: OutputImage, brake_released: bool, well: bool) -> None:
        """Take the outputs of a scan and send those of the I/O node."""
        self.outputs.take(output, brake_released, well)
        if self.io is not None:
            self.io.send(self.outputs.node_word)
