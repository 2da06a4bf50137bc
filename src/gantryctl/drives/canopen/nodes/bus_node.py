"""Node beside the drive: set up like the drive, its telegram and its heartbeat watched in every scan."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

from gantryctl.drives.canopen.bus.node import (
    LATCHED,
    LOST,
    NmtCommand,
    NodeIdentity,
    RemoteNode,
    connection_flags,
)
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.drives.canopen.diagnostics import TpdoWatch
from gantryctl.drives.canopen.mapping import Mapping, check_mapping, write_mapping
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.drives.canopen.setup.parameter_check import stop_sync_period
from gantryctl.errors import DeviceError
from gantryctl.image import LinkFlag

# As long as an old reading of the drive is bridged (CAN-03), and never less than three scans.
_BRIDGED_S: Final = 0.030
_WRONG_LENGTHS: Final = 3
_TPDO_1: Final = 0x180
_RPDO_1: Final = 0x200
_COUNTER: Final = 0x1019


class NodeObject(NamedTuple):
    """Object of a node and the value that it must have."""

    obj: int
    sub: int
    size: int
    """Bytes."""
    value: int
    meaning: str
    needed: bool = False
    """A node without this object is refused."""
    mask: int = -1
    """Bits that are compared."""
    never_else: bool = False
    """A node that has it, and holds another value for good, is refused."""


def communication_objects(settings: CanopenSettings, watches_controller: bool) -> tuple[NodeObject, ...]:
    """Objects of CiA 301 that every node beside the drive must have as they are here.

    Args:
        watches_controller: the node must see that the controller is gone (1016).
    """
    watched = settings.master_node << 16 | round(settings.heartbeat_timeout_s * 1e3)
    return (
        NodeObject(0x1005, 0, 4, 0x80, "identifier of SYNC", mask=0x7FF, never_else=True),
        NodeObject(_COUNTER, 0, 1, 0, "SYNC comes without a counter", never_else=True),
        NodeObject(0x1006, 0, 4, round(settings.period_s * 1e6), "SYNC period, us"),
        NodeObject(0x1007, 0, 4, 0, "telegrams count whenever they come after SYNC, us", never_else=True),
        NodeObject(0x1016, 1, 4, watched, "it watches the controller's heartbeat", watches_controller),
        NodeObject(0x1017, 0, 2, round(settings.heartbeat_s * 1e3), "it shows that it lives, ms"),
        NodeObject(0x1029, 1, 1, 0, "without the controller it leaves OPERATIONAL"),
    )


class BusNode:
    """Connection to one node: set-up by SDO, one telegram of it for each SYNC, one to it.

    Args:
        remote: the node, on the link of the drive.
        settings: SYNC period, heartbeats.
        what: name of the node for people.
        mapping: its telegrams, one from it, at most one to it.
        objects: what is written, and read back, before it is started.
        in_time: whether the scan still waits for telegrams.
        noise: by which an object may differ between two reads at standstill.

    Attributes:
        watch: its telegram.
        lost: nothing that comes with the telegram is believed in this scan.
        identity: of the node that was set up; None before.
    """

    def __init__(
        self,
        remote: RemoteNode,
        settings: CanopenSettings,
        what: str,
        mapping: Mapping,
        objects: Iterable[NodeObject],
        in_time: Callable[[], bool],
        noise: int = 0,
    ) -> None:
        self.remote, self._settings, self._what, self._noise = remote, settings, what, noise
        self._mapping, self._objects, self._in_time = mapping, tuple(objects), in_time
        self._old_scans = max(3, int(_BRIDGED_S / settings.period_s + 1e-9))
        self._timeout: int | None = None
        self._flags = LinkFlag.NONE
        self.identity: NodeIdentity | None = None
        self.lost = False
        self.watch = TpdoWatch(mapping.tpdos[0].size, settings.period_s)

    # --- before the first scan -----------------------------------------------------------------------------------

    def open(self) -> None:
        """Set the node up and start it.

        Raises:
            DeviceError: it does not answer, is another node than before, or does not take what it must have.
        """
        remote, who = self.remote, self._who
        identity = remote.identity()
        if self.identity is not None and identity.key != self.identity.key:
            raise DeviceError(f"{who} is now {identity.key}, it was {self.identity.key}: another node")
        remote.enter_pre_operational()
        present = frozenset(row.obj for row in self._objects if self._holds(row))
        try:
            refused = write_mapping(remote.sdo, remote.node, self._mapping)
        except SdoError as fault:
            raise DeviceError(f"{who}: its telegrams cannot be mapped: {fault}") from None
        if refused is not None:
            raise DeviceError(f"{who}: {refused.text}")
        check_mapping(remote.sdo, remote.node, self._mapping)
        self.watch = TpdoWatch(self._mapping.tpdos[0].size, self._settings.period_s)
        remote.listen(_TPDO_1 + remote.node, self._take)
        if self._mapping.rpdos:
            remote.reserve(_RPDO_1 + remote.node)
        self._timeout = self._settings.timeout_scans if 0x1017 in present else None
        self.identity = identity
        self._flags, self.lost = LinkFlag.NONE, False
        remote.state = None
        remote.forget_boots()
        remote.nmt(NmtCommand.START)

    @property
    def _who(self) -> str:
        return f"node {self.remote.node}, {self._what}"

    def _holds(self, row: NodeObject) -> bool:
        """Write what differs and read it back; False for an object that the node has not, and may lack."""
        sdo, place = self.remote.sdo, f"{row.obj:04X}:{row.sub:02X}"
        have = row.value
        try:
            have = int.from_bytes(sdo.read(row.obj, row.sub), "little")
            if (have ^ row.value) & row.mask:
                if row.obj == _COUNTER:
                    stop_sync_period(sdo)
                sdo.write(row.obj, row.sub, row.value.to_bytes(row.size, "little"))
                have = int.from_bytes(sdo.read(row.obj, row.sub), "little")
        except SdoError as refused:
            if refused.silent or row.needed or (row.never_else and (have ^ row.value) & row.mask):
                raise DeviceError(f"{self._who}: {refused} · {row.meaning}") from None
            return False
        if (have ^ row.value) & row.mask:
            raise DeviceError(f"{self._who}: {place} is {have:X}h, written {row.value:X}h · {row.meaning}")
        return True

    def resume(self) -> None:
        """Start the node again after an intended silence.

        Raises:
            DeviceError: it has restarted: its mapping is lost.
        """
        if self.remote.boots:
            raise DeviceError(f"{self._who} has restarted: open it anew")
        self.remote.nmt(NmtCommand.START)
        self.remote.state, self._flags, self.lost = None, LinkFlag.NONE, False
        self.remote.heartbeat_age = 0
        self.watch.forget()

    def release(self) -> None:
        """Take the node out of operation: from now on a silent controller is no failure."""
        self.remote.enter_pre_operational()
        if self.remote.sdo.optional(0x1016, 1):
            self.remote.sdo.set(0x1016, 1, 0)

    def check_answer(self) -> None:
        """Refuse a node that has not answered SYNC.

        Raises:
            DeviceError: its telegram is missing.
        """
        if self.watch.data is None:
            raise DeviceError(f"{self._who} does not answer SYNC with its process data: is it OPERATIONAL?")

    def compare(self) -> list[str]:
        """What the last telegram says otherwise than SDO, a line for each object: a wrong mapping agrees with itself.

        Raises:
            DeviceError: there is no telegram, or an object cannot be read.
        """
        self.check_answer()
        sent, at, lines = self.watch.data or b"", 0, []
        for signal in self._mapping.tpdos[0].signals:
            size = signal.bits // 8
            told = int.from_bytes(sent[at : at + size], "little")
            asked = int.from_bytes(self.remote.sdo.read(signal.obj, signal.sub), "little")
            at += size
            if abs(told - asked) > self._noise:
                lines.append(
                    f"{signal.obj:04X}:{signal.sub:02X} is {asked:X}h by SDO and {told:X}h in its telegram"
                )
        return lines

    # --- the scan ------------------------------------------------------------------------------------------------

    def begin(self, periods: int) -> None:
        """SYNC goes out, `periods` after the one before."""
        self.remote.heartbeat_age += periods
        self.watch.begin(periods)

    def _take(self, data: bytes) -> None:
        self.watch.take(data, self._in_time())

    def judge(self, commanded: bool) -> bool:
        """Judge the node in this scan; True when it is lost.

        Args:
            commanded: the program runs the axis: a restart is not intended.
        """
        self._flags = connection_flags(
            self.remote, self._flags, commanded=commanded, timeout_scans=self._timeout
        )
        old = self.watch.age >= self._old_scans or self.watch.wrong_in_row >= _WRONG_LENGTHS
        # Error passive is a warning: frames still come and go.
        self.lost = bool(self._flags & (LOST | LATCHED)) or old or self.watch.data is None
        return self.lost

    @property
    def changed(self) -> bool:
        """Only a new set-up makes the node usable again."""
        return bool(self._flags & LATCHED) or self.watch.wrong_in_row >= _WRONG_LENGTHS

    def send(self, data: bytes) -> None:
        """Send its telegram."""
        self.remote.link.send(_RPDO_1 + self.remote.node, data)
