"""CANopen protocol stack of a virtual node: NMT, SDO, PDO, heartbeat both ways, emergency messages (CiA 301)."""

from __future__ import annotations

from functools import partial
from typing import Final, Protocol

from gantryctl.drives.faults import FrameFault
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.emergency import Emergency
from gantryctl.drives.virtual.communication.identifiers import HEARTBEAT, NMT, SDO_REQUEST, SDO_RESPONSE
from gantryctl.drives.virtual.communication.nmt import (
    HEARTBEAT_LOST,
    HeartbeatConsumer,
    HeartbeatProducer,
    NmtCommand,
    NmtState,
    command_for,
    next_nmt,
)
from gantryctl.drives.virtual.communication.pdo import DEADLINE, ProcessData
from gantryctl.drives.virtual.communication.sdo import SdoServer
from gantryctl.drives.virtual.personality import Personality
from gantryctl.drives.virtual.side_channel.frame_gate import FrameGate

# Error code "communication" (CiA 301), of an axis that NMT stops.
NMT_ABORT: Final = 0x8100
# Error code "unexpected SYNC data length" (CiA 301).
_SYNC_LENGTH: Final = 0x8240


class Device(Protocol):
    """What is behind a protocol stack.

    Attributes:
        time_us: its own time.
    """

    time_us: int

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame, if it can."""
        ...

    def answer_sdo(self, request: bytes) -> None:
        """Answer a request that has come in a state with SDO."""
        ...

    def send_heartbeat(self) -> None:
        """Send the heartbeat of this moment."""
        ...

    def communication_lost(self, code: int) -> None:
        """Heartbeat or command of the controller is missing, or NMT stops the node.

        Args:
            code: error code of CiA 301.
        """
        ...

    def reset(self, communication_only: bool) -> None:
        """Reset node or communication, by `ProtocolStack.reset`, then boot up."""
        ...


class ProtocolStack:
    """Communication of one node.

    Args:
        od: object dictionary; its communication objects get their meaning here.
        node_id: 1..127.
        kind: quirks of the model.
        device: what is behind.
        tpdo: what happens to its telegrams, by the number of the TPDO.

    Attributes:
        state: NMT state.
        sdo: the SDO server.
        emergency, process_data: emergency messages; PDOs.
    """

    def __init__(
        self, od: Dictionary, node_id: int, kind: Personality, device: Device, tpdo: dict[int, FrameFault]
    ) -> None:
        self._od, self._node_id, self._kind, self._device = od, node_id, kind, device
        self.state = NmtState.INITIALISING
        self._wrong_sync = False
        self._gate = FrameGate(tpdo, device.send)
        self.emergency = Emergency(od, self._send_emcy, kind.short_emcy)
        self.process_data = ProcessData(
            od,
            self._send_tpdo,
            self.emergency.report,
            partial(device.communication_lost, DEADLINE),
            lambda: device.time_us,
            deadlines=not kind.deadline_without_effect,
        )
        self.sdo = SdoServer(od, kind.block_transfer, lambda: device.time_us * 1e-6)
        self._producer = HeartbeatProducer(od, device.send_heartbeat)
        self._consumer = HeartbeatConsumer(od, self.emergency.report, self._heartbeat_lost)

    def tick(self, now_us: int, *, hears_heartbeat: bool) -> None:
        """One tick of the device's own time.

        Args:
            hears_heartbeat: False: 1016 is without effect.
        """
        self.emergency.tick(now_us)
        self._producer.tick(now_us)
        if hears_heartbeat:
            self._consumer.tick(now_us)
        self.process_data.tick()

    # --- frames --------------------------------------------------------------------------------------------------

    def receive(self, can_id: int, data: bytes) -> None:
        """Take one data frame with an 11-bit identifier."""
        if can_id == self.process_data.sync_id:
            self._on_sync(data)
        elif can_id == NMT:
            command = command_for(data, self._node_id)
            if command is not None:
                self.nmt(command)
        elif can_id == SDO_REQUEST + self._node_id:
            self._on_sdo(data)
        elif not self.process_data.receive(can_id, data) and can_id > HEARTBEAT and len(data) == 1:
            self._consumer.receive(can_id - HEARTBEAT, self._device.time_us)
        self.process_data.tick()

    def _on_sync(self, data: bytes) -> None:
        if self.state is NmtState.STOPPED:
            return
        if data and not self._wrong_sync:
            # 1019 is absent, so a SYNC has no counter and no data (CiA 301): EMCY 8240.
            self.emergency.warn(_SYNC_LENGTH)
        self._wrong_sync = bool(data)
        self.process_data.sync()

    def _on_sdo(self, request: bytes) -> None:
        also = None if self._kind.sdo_preoperational_only else NmtState.OPERATIONAL
        if self.state in (NmtState.PRE_OPERATIONAL, also):
            self._device.answer_sdo(request)

    def respond(self, responses: tuple[bytes, ...]) -> None:
        """Send the responses to an SDO request."""
        for response in responses:
            self._device.send(SDO_RESPONSE + self._node_id, response)

    def _send_tpdo(self, number: int, can_id: int, data: bytes) -> None:
        """Send one TPDO (number 0 is the first)."""
        self._gate.send(number + 1, can_id, data)

    def send_heartbeat(self, shown: int | None = None) -> None:
        """Send a heartbeat.

        Args:
            shown: state that it shows; the true one when not given.
        """
        if self.state is not NmtState.INITIALISING:
            data = b"" if self._kind.empty_heartbeat else bytes((self.state if shown is None else shown,))
            self._device.send(HEARTBEAT + self._node_id, data)

    def _send_emcy(self, can_id: int, data: bytes) -> None:
        if self.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            self._device.send(can_id, data)

    # --- NMT -----------------------------------------------------------------------------------------------------

    def nmt(self, command: NmtCommand) -> None:
        """Obey an NMT command."""
        target = next_nmt(self.state, command)
        if target is NmtState.INITIALISING:
            self._device.reset(communication_only=command is NmtCommand.RESET_COMMUNICATION)
        else:
            self.enter(target)

    def enter(self, target: NmtState) -> None:
        """Change the NMT state; entering STOPPED is a lost communication."""
        if target is NmtState.STOPPED and self.state is not NmtState.STOPPED:
            self._device.communication_lost(NMT_ABORT)
        self.state = target
        self.process_data.set_operational(target is NmtState.OPERATIONAL)

    def begin_reset(self) -> None:
        """Leave the bus for a reset; the dictionary gets its power-on values after this."""
        self.state = NmtState.INITIALISING
        self.process_data.set_operational(False)

    def take_over(self) -> None:
        """Take the values of the dictionary over after a reset; nothing under way before it is left."""
        self.sdo.reset()
        self.emergency.reset()
        self._gate.reset()
        self.process_data.reload()
        self._consumer.reload()

    def boot_up(self) -> None:
        """Send the boot-up message and go on to PRE-OPERATIONAL, or further where the model does that by itself."""
        self._device.send(HEARTBEAT + self._node_id, bytes((NmtState.INITIALISING,)))
        self._producer.reload(self._device.time_us)
        self.enter(NmtState.OPERATIONAL if self._kind.auto_operational else NmtState.PRE_OPERATIONAL)

    def _heartbeat_lost(self) -> None:
        """React to a lost heartbeat: the device by itself, the NMT state by 1029."""
        # 1029:01: 0 leave OPERATIONAL, 1 no change, 2 enter STOPPED (CiA 301).
        self._device.communication_lost(HEARTBEAT_LOST)
        if self._kind.silence_emcy_only:
            return
        reaction = self._od.number(0x1029, 1)
        if reaction == 0 and self.state is NmtState.OPERATIONAL:
            self.enter(NmtState.PRE_OPERATIONAL)
        elif reaction == 2:
            self.enter(NmtState.STOPPED)
