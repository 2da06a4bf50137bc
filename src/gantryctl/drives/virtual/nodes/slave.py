"""CANopen side of a virtual node that is no drive: NMT, SDO, PDO, heartbeat both ways, emergency messages (CiA 301)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from gantryctl.drives.faults import FrameFault
from gantryctl.drives.od.model import DeviceInfo, ObjectSpec, described
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.emergency import Emergency
from gantryctl.drives.virtual.communication.identifiers import HEARTBEAT, NMT, SDO_REQUEST, SDO_RESPONSE, Send
from gantryctl.drives.virtual.communication.nmt import (
    HeartbeatConsumer,
    HeartbeatProducer,
    NmtCommand,
    NmtState,
    command_for,
    next_nmt,
)
from gantryctl.drives.virtual.communication.objects import VENDOR_ID, communication_objects, pdo_objects
from gantryctl.drives.virtual.communication.pdo import ProcessData
from gantryctl.drives.virtual.communication.sdo import SdoServer
from gantryctl.drives.virtual.personality import Personality
from gantryctl.drives.virtual.side_channel.frame_gate import FrameGate

_TICK_US: Final = 1000
# The default mapping of CiA 402, which such a node has not.
_DRIVE_OBJECTS: Final = (0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x6077, 0x60B2, 0x60FF)


class Slave:
    """Node on a bus: frames in, frames out, time as an argument.

    Args:
        profile: device profile and type, 1000h.
        name, product: 1008h and 1018:02.
        objects: of its device profile.
        node_id: 1..127.
        send: takes identifier and data of every frame.
        failed: called when the heartbeat of the controller or a telegram of it is missing, or NMT stops the node.
        stepped: time goes on by SYNC only, one SYNC period (1006) each.

    Attributes:
        od: the object dictionary.
        silent: off the bus: nothing is sent, nothing is heard; its own time goes on.
        heartbeat_deaf: 1016 is taken and has no effect.
        mapping_ignored: writes to 1A00 and 1600 are acknowledged and not kept.
        tpdo: what happens to its telegrams, by the number of the TPDO.
    """

    def __init__(
        self,
        profile: int,
        name: str,
        product: int,
        objects: tuple[ObjectSpec, ...],
        node_id: int,
        send: Send,
        failed: Callable[[], None],
        *,
        stepped: bool,
    ) -> None:
        self.node_id, self.stepped = node_id, stepped
        self.time_us = self._owed_us = 0
        self.state = NmtState.INITIALISING
        self.silent = self.heartbeat_deaf = self.mapping_ignored = False
        self._out, self._failed = send, failed
        self._synced = False
        kind = Personality(device_type=profile, absent=_DRIVE_OBJECTS)
        plate: dict[tuple[int, int], int | str] = {(0x1008, 0): name, (0x1018, 2): product}
        common = (_named(spec, plate) for spec in communication_objects(kind, node_id))
        info = DeviceInfo(vendor_name="gantryctl", vendor_number=VENDOR_ID, product_name=name)
        device = described((*common, *pdo_objects(kind), *objects), info)
        self.od = od = Dictionary(device, device, node_id)
        self.emergency = Emergency(od, self._send_emcy, short=False)
        report = self.emergency.report
        self.tpdo: dict[int, FrameFault] = {}
        self._gate = FrameGate(self.tpdo, self._send)
        self.process_data = ProcessData(od, self._send_tpdo, report, failed, lambda: self.time_us)
        self._sdo = SdoServer(od, False, lambda: self.time_us * 1e-6)
        self._producer = HeartbeatProducer(od, self._send_heartbeat)
        self._consumer = HeartbeatConsumer(od, report, self._heartbeat_lost)

    # --- time ----------------------------------------------------------------------------------------------------

    def boot(self) -> None:
        """Power on: send the boot-up message, enter PRE-OPERATIONAL."""
        self.state = NmtState.INITIALISING
        self.process_data.set_operational(False)
        self.od.reset({}, communication_only=False)
        self._sdo.reset()
        self.emergency.reset()
        self._gate.reset()
        self.process_data.reload()
        self._consumer.reload()
        self._failed()
        self._send(HEARTBEAT + self.node_id, bytes((NmtState.INITIALISING,)))
        self._producer.reload(self.time_us)
        self.state = NmtState.PRE_OPERATIONAL

    def advance(self, us: int) -> None:
        """Advance the node's own time in whole milliseconds; the remainder is kept."""
        self._owed_us += us
        while self._owed_us >= _TICK_US:
            self._owed_us -= _TICK_US
            self.time_us += _TICK_US
            self.emergency.tick(self.time_us)
            self._producer.tick(self.time_us)
            if not self.heartbeat_deaf:
                self._consumer.tick(self.time_us)
            self.process_data.tick()

    # --- frames --------------------------------------------------------------------------------------------------

    def on_frame(self, can_id: int, data: bytes) -> None:
        """Take one data frame with an 11-bit identifier."""
        is_sync = can_id == self.process_data.sync_id
        if is_sync and self.stepped:
            if self._synced:
                self.advance(self.od.number(0x1006))
            self._synced = True
        if self.silent:
            return
        if is_sync:
            if self.state is not NmtState.STOPPED:
                self.process_data.sync()
        elif can_id == NMT:
            command = command_for(data, self.node_id)
            if command is not None:
                self._nmt(command)
        elif can_id == SDO_REQUEST + self.node_id:
            self._on_sdo(data)
        elif not self.process_data.receive(can_id, data) and can_id > HEARTBEAT and len(data) == 1:
            self._consumer.receive(can_id - HEARTBEAT, self.time_us)
        self.process_data.tick()

    def _on_sdo(self, data: bytes) -> None:
        if self.state not in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            return
        kept = None
        if self.mapping_ignored and len(data) == 8 and data[0] >> 5 == 1 and data[2] in (0x16, 0x1A):
            kept = (data[1] | data[2] << 8, data[3])
        before = None if kept is None else self.od.number(*kept)
        answers = self._sdo.answer(data)
        if kept is not None and before is not None:
            self.od.set(*kept, before)
        for answer in answers:
            self._send(SDO_RESPONSE + self.node_id, answer)

    def _nmt(self, command: NmtCommand) -> None:
        target = next_nmt(self.state, command)
        if target is NmtState.INITIALISING:
            self.boot()
        else:
            self._enter(target)

    def _enter(self, target: NmtState) -> None:
        if target is NmtState.STOPPED and self.state is not NmtState.STOPPED:
            self._failed()
        self.state = target
        self.process_data.set_operational(target is NmtState.OPERATIONAL)

    # --- what goes wrong -----------------------------------------------------------------------------------------

    def _heartbeat_lost(self) -> None:
        """Show the error values; leave OPERATIONAL as 1029:01 says (0 leave, 1 stay, 2 stop)."""
        self._failed()
        reaction = self.od.number(0x1029, 1)
        if reaction == 0 and self.state is NmtState.OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)
        elif reaction == 2:
            self._enter(NmtState.STOPPED)

    def _send(self, can_id: int, data: bytes) -> None:
        if not self.silent:
            self._out(can_id, data)

    def _send_tpdo(self, number: int, can_id: int, data: bytes) -> None:
        """Send one TPDO (number 0 is the first)."""
        self._gate.send(number + 1, can_id, data)

    def _send_heartbeat(self) -> None:
        if self.state is not NmtState.INITIALISING:
            self._send(HEARTBEAT + self.node_id, bytes((self.state,)))

    def _send_emcy(self, can_id: int, data: bytes) -> None:
        if self.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            self._send(can_id, data)


def _named(spec: ObjectSpec, plate: dict[tuple[int, int], int | str]) -> ObjectSpec:
    entries = {
        sub: replace(entry, default=plate.get((spec.index, sub), entry.default))
        for sub, entry in spec.entries.items()
    }
    return replace(spec, entries=entries)
