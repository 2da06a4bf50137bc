"""Remote node on the bus: NMT, heartbeat, boot-up, emergency messages, SDO, and the flags of its connection."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from functools import partial
from typing import Final, NamedTuple

from gantryctl.drives.canopen.bus.link import BusLink, Frame
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError
from gantryctl.drives.canopen.emergency import EmergencyLog
from gantryctl.errors import DeviceError
from gantryctl.image import LinkFlag

# Pre-defined connection set of CiA 301; EMCY, SDO and heartbeat (NMT error control) plus the node id.
NMT: Final = 0x000
SYNC: Final = 0x080
_EMCY: Final = 0x080
_HEARTBEAT: Final = 0x700
_SDO_REQUEST: Final = 0x600
_LISTEN_S: Final = 0.02


# NMT of CiA 301 stands here and again in the virtual drive: two readings of the text share no mistake (decision 0008).
class NmtCommand(IntEnum):
    """Command specifiers of the NMT message, identifier 0."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """NMT state in a heartbeat."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


_LEAVES_OPERATIONAL: Final[dict[int, NmtState]] = {
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_COMMUNICATION: NmtState.PRE_OPERATIONAL,
}


class NodeIdentity(NamedTuple):
    """Objects 1000, 1008 to 100A and 1018, recorded by the commissioning."""

    vendor: int
    product: int
    revision: int
    serial: int
    device_type: int
    name: str
    hardware: str
    software: str

    @property
    def text(self) -> str:
        """Name, software version and serial number for people."""
        name = self.name or "drive without a name"
        return f"{name}, software {self.software or '?'}, serial {self.serial}"

    @property
    def key(self) -> str:
        """Vendor, product and serial number: distinguishes one drive from another."""
        return f"{self.vendor:08X}-{self.product:08X}-{self.serial}"


class RemoteNode:
    """Remote node on a link.

    Args:
        link: the bus.
        node: its node id.
        master_node: node id of our own heartbeat.
        sdo_timeout_s: for one answer.
        beside: another node on the same link; either takes the frames of both.

    Attributes:
        state: NMT state of the last heartbeat; None before the first.
        heartbeat_age: scans since then; the drive counts them up.
        boots: boot-up messages since `forget_boots`.
        foreign: frames on identifiers that only this master may send. foreign_id: identifier of the first, -1 before.
        unknown: frames on identifiers without a meaning here.
    """

    def __init__(
        self,
        link: BusLink,
        node: int,
        master_node: int,
        sdo_timeout_s: float,
        *,
        beside: RemoteNode | None = None,
    ) -> None:
        self.link, self.node, self.master_node = link, node, master_node
        self.sdo = SdoClient(link, node, self.dispatch, sdo_timeout_s)
        self.emergencies = EmergencyLog()
        self.state: int | None = None
        self.heartbeat_age = 0
        self.boots = self.foreign = self.unknown = 0
        self.foreign_id = -1
        self.scan = 0
        self._heartbeat_frame = bytes((NmtState.OPERATIONAL,))
        # Nodes on one link share this table, so whoever receives hands every frame to its node; what nobody else may
        # send is counted by the first of them.
        self._first: RemoteNode = self if beside is None else beside._first
        self._handlers: dict[int, Callable[[bytes], object]] = {} if beside is None else beside._handlers
        self._handlers[_EMCY + node] = lambda data: self.emergencies.take(data, self.scan)
        self._handlers[_HEARTBEAT + node] = self._heartbeat
        self._handlers.setdefault(NMT, self._foreign_nmt)
        # An answer that comes after its request has timed out says nothing.
        self._handlers[self.sdo.response_id] = lambda _: None
        for can_id in (SYNC, _SDO_REQUEST + node, _HEARTBEAT + master_node):
            self.reserve(can_id)

    def listen(self, can_id: int, handler: Callable[[bytes], object]) -> None:
        """Hand frames of an identifier to a handler."""
        self._handlers[can_id] = handler

    def reserve(self, can_id: int) -> None:
        """Count frames of an identifier that only this master may send as foreign."""
        self._handlers[can_id] = partial(self._first._foreign, can_id)

    @property
    def identifiers(self) -> frozenset[int]:
        """Identifiers with a meaning here: of the nodes on this link, and those that only this master may send."""
        return frozenset(self._handlers)

    def dispatch(self, frame: Frame) -> None:
        """Take one frame; nothing on the bus may raise here."""
        handler = self._handlers.get(frame.can_id)
        if handler is not None:
            handler(frame.data)
        else:
            self.unknown += 1

    def _heartbeat(self, data: bytes) -> None:
        self.heartbeat_age = 0
        # Some drives send heartbeats without data: a sign of life, but no state.
        if not data:
            return
        state = data[0] & 0x7F
        if state == NmtState.BOOT_UP:
            self.boots += 1
        self.state = state

    def _foreign(self, can_id: int, _data: bytes) -> None:
        if not self.foreign:
            self.foreign_id = can_id
        self.foreign += 1

    def _foreign_nmt(self, data: bytes) -> None:
        """Another master changes the state of a node: of this one it acts at once, not with the next heartbeat."""
        self._foreign(NMT, data)
        if len(data) == 2 and data[1] in (0, self.node) and data[0] in _LEAVES_OPERATIONAL:
            self.state, self.heartbeat_age = _LEAVES_OPERATIONAL[data[0]], 0

    def forget_boots(self) -> None:
        """Clear the counters of boot-ups and foreign frames, and the heartbeat age."""
        self.boots = 0
        self.forget_foreign()

    def forget_foreign(self) -> None:
        """Clear the counter of foreign frames, and the heartbeat age."""
        self.foreign = self.heartbeat_age = 0
        self.foreign_id = -1

    # --- out ---------------------------------------------------------------------------------------------------

    def nmt(self, command: NmtCommand) -> None:
        """Send an NMT command to this node."""
        self.link.send(NMT, bytes((command, self.node)))

    def sync(self) -> None:
        self.link.send(SYNC, b"")

    def heartbeat(self) -> None:
        self.link.send(_HEARTBEAT + self.master_node, self._heartbeat_frame)

    def listen_for(self, seconds: float) -> None:
        """Dispatch frames for a time."""
        end = self.link.now_s() + seconds
        while (left := end - self.link.now_s()) > 1e-6:
            frame = self.link.receive(left)
            if frame is not None:
                self.dispatch(frame)

    def drain(self, within_s: float = math.inf, most: int = 500) -> bool:
        """Dispatch the waiting frames, within a time and at most so many: a flood must not hold up the scan.

        Returns:
            Whether none was left.
        """
        end = self.link.now_s() + within_s
        for _ in range(most):
            frame = self.link.receive(0.0)
            if frame is None:
                return True
            self.dispatch(frame)
            if self.link.now_s() > end:
                return False
        return False

    def enter_pre_operational(self) -> None:
        """Leave OPERATIONAL."""
        # Nothing confirms an NMT command but a later heartbeat: wait a moment.
        self.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        self.listen_for(_LISTEN_S)

    def identity(self) -> NodeIdentity:
        """Read the identity.

        Raises:
            DeviceError: the node does not answer.
        """
        sdo = self.sdo
        try:
            device_type = sdo.number(0x1000)
        except SdoError as silent:
            if silent.silent:
                raise DeviceError(
                    f"node {self.node} does not answer: is it switched on, is the node id right, and channel and bit "
                    "rate? `gantryctl can scan` shows who is there"
                ) from None
            device_type = 0
        vendor, product, revision, serial = (sdo.optional(0x1018, sub) or 0 for sub in (1, 2, 3, 4))
        names = (sdo.text(0x1008), sdo.text(0x1009), sdo.text(0x100A))
        return NodeIdentity(vendor, product, revision, serial, device_type, *names)


_GONE: Final = LinkFlag.RESTARTED | LinkFlag.NOT_OPERATIONAL | LinkFlag.HEARTBEAT_LOST
# With one of these the last feedback is not valid: without a heartbeat time-out a killed drive reads "operation
# enabled".
LOST: Final = _GONE | LinkFlag.BUS_DOWN
# A rebooted drive has lost its mapping, and of one that obeyed another master, or in whose name another node speaks,
# nothing is sure: these flags stay until the drive is set up again.
LATCHED: Final = _GONE | LinkFlag.OTHER_MASTER | LinkFlag.TWO_SENDERS
_WELL: Final = (None, NmtState.BOOT_UP, NmtState.OPERATIONAL)


def connection_flags(
    node: RemoteNode, before: LinkFlag, *, commanded: bool, timeout_scans: int | None
) -> LinkFlag:
    """Flags of the connection in this scan.

    Args:
        before: flags of the scan before.
        commanded: the master runs the node, so no restart or change of state is intended.
        timeout_scans: scans without a heartbeat until it counts as lost; None where it sends none.
    """
    # Operators of flags are Python: nearly every scan has none.
    flags = node.link.trouble
    if before:
        flags |= before & LATCHED
    if node.link.down:
        flags |= LinkFlag.BUS_DOWN
    if not commanded:
        return flags
    if node.boots:
        flags |= LinkFlag.RESTARTED
    if timeout_scans is not None and node.heartbeat_age > timeout_scans:
        flags |= LinkFlag.HEARTBEAT_LOST
    if node.state not in _WELL and node.heartbeat_age == 0:
        flags |= LinkFlag.NOT_OPERATIONAL
    if node.foreign:
        flags |= LinkFlag.OTHER_MASTER
    return flags
