"""Virtual drive as a CANopen node: frames in, frames out, time as an argument; it knows no bus and no clock."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from gantryctl.drives.base import TRUTH_COLUMNS, settle
from gantryctl.drives.faults import Faults
from gantryctl.drives.virtual.axis.drive_axis import DriveAxis
from gantryctl.drives.virtual.axis.hardware import Hardware, Scaling
from gantryctl.drives.virtual.axis.plant import DrivePlant
from gantryctl.drives.virtual.axis.signals import Signals
from gantryctl.drives.virtual.axis.speed_reference import SpeedReference, interpolation_us
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.emergency import Emergency
from gantryctl.drives.virtual.communication.identifiers import HEARTBEAT, NMT, SDO_REQUEST, SDO_RESPONSE, Send
from gantryctl.drives.virtual.communication.nmt import (
    HEARTBEAT_LOST,
    HeartbeatConsumer,
    HeartbeatProducer,
    NmtCommand,
    NmtState,
    command_for,
    next_nmt,
)
from gantryctl.drives.virtual.communication.objects import device_tables
from gantryctl.drives.virtual.communication.parameters import Parameters, ParameterStore
from gantryctl.drives.virtual.communication.pdo import DEADLINE, ProcessData
from gantryctl.drives.virtual.communication.sdo import SdoServer, abort_frame
from gantryctl.drives.virtual.personality import Personality
from gantryctl.drives.virtual.side_channel.frame_gate import FrameGate
from gantryctl.errors import UsageError

# Error codes of CiA 301 (8240 unexpected SYNC data length) and CiA 402 (5530 EEPROM, 6310 loss of parameters).
_SYNC_LENGTH: Final = 0x8240
_NMT_ABORT: Final = 0x8100
_STORE_FAILED: Final = 0x5530
_PARAMETERS_LOST: Final = 0x6310
_TOGGLE: Final = 0x10
_SETTLE_STEP_US: Final = 10_000


class DriveNode:
    """Drive on a bus.

    Args:
        hardware: motor, brake, encoder and gantry behind it.
        node_id: 1..127.
        send: takes identifier and data of every frame of the node.
        kind: quirks of the drive model.
        store: stored parameters; in memory when not given.
        stepped: time goes on by SYNC only, one SYNC period each; the first SYNC is time 0.

    Raises:
        UsageError: a node id outside 1..127.
    """

    truth_columns: tuple[str, ...] = TRUTH_COLUMNS

    def __init__(
        self,
        hardware: Hardware,
        node_id: int,
        send: Send,
        *,
        kind: Personality | None = None,
        store: ParameterStore | None = None,
        stepped: bool = False,
    ) -> None:
        if not 1 <= node_id <= 127:
            raise UsageError(f"node id {node_id}: CANopen has node ids 1 to 127")
        self.hardware, self.node_id, self.stepped = hardware, node_id, stepped
        self.kind = kind = kind or Personality()
        self.faults = Faults()
        self.time_us = 0
        """Time of the drive itself."""
        self.state = NmtState.INITIALISING
        self._out = send
        self._tick_us = round(hardware.tick_s * 1e6)
        self._owed_us = 0
        self._synced = self._wrong_sync = False
        self._later: list[tuple[int, Callable[[], object]]] = []
        self._answer_delay_us = self._silent_until_us = 0
        self._store_failed = False
        full, self.device = device_tables(hardware, kind)
        self.scaling = scaling = Scaling(hardware, kind)
        self.od = od = Dictionary(full, self.device, node_id)
        self.emergency = Emergency(od, self._send_emcy, kind.short_emcy)
        self.plant = DrivePlant(hardware, self.faults)
        reference = SpeedReference(od, self.plant, scaling, kind, self.faults, hardware.tick_s)
        self.axis = DriveAxis(hardware, od, self.plant, reference, self.emergency, kind, self.faults)
        self._signals = Signals(hardware, self.axis, od, scaling, kind, self.faults)
        self._store = store or ParameterStore()
        self._parameters = Parameters(od, self.axis, scaling, self._store, self._saving, kind.modes)
        self._sdo = SdoServer(od, self.kind.block_transfer, lambda: self.time_us * 1e-6)
        self._gate = FrameGate(self.faults.tpdo, self.send)
        self._gate_in = FrameGate(self.faults.frames, self._receive)
        self._gate_out = FrameGate(self.faults.frames, self._out)
        late = partial(self.axis.communication_lost, DEADLINE)
        report, now = self.emergency.report, lambda: self.time_us
        self.process_data = ProcessData(
            od, self._send_tpdo, report, late, now, deadlines=not kind.deadline_without_effect
        )
        self._producer = HeartbeatProducer(od, self.send_heartbeat)
        self._consumer = HeartbeatConsumer(od, self.emergency.report, self._heartbeat_lost)

    # --- time --------------------------------------------------------------------------------------------------

    def boot(self) -> None:
        """Power on: send the boot-up message, enter PRE-OPERATIONAL."""
        self._signals.tick(self.time_us)
        self.reset(communication_only=False)
        if self._store.damaged:
            self.emergency.raise_error(_PARAMETERS_LOST)

    def advance(self, us: int) -> None:
        """Advance the drive's own time in whole ticks; the remainder is kept."""
        self._owed_us += us
        while self._owed_us >= self._tick_us:
            self._owed_us -= self._tick_us
            self._tick()

    def _tick(self) -> None:
        self.time_us = now = self.time_us + self._tick_us
        self.axis.tick()
        self._signals.tick(now)
        self.emergency.tick(now)
        self._producer.tick(now)
        if not self.kind.heartbeat_without_effect:
            self._consumer.tick(now)
        self.process_data.tick()
        if self._later:
            self._run_later()

    def after(self, delay_us: int, action: Callable[[], object]) -> None:
        """Call an action later, in the drive's own time."""
        self._later.append((self.time_us + delay_us, action))

    def _run_later(self) -> None:
        due = [action for at, action in self._later if at <= self.time_us]
        self._later = [(at, action) for at, action in self._later if at > self.time_us]
        for action in due:
            action()

    @property
    def sync_period_us(self) -> int:
        """Step of one SYNC: 1006, else 60C2."""
        return self.od.number(0x1006) or interpolation_us(self.od)

    def truth(self) -> tuple[float, ...]:
        """True state of the gantry, see `truth_columns`; never on the bus."""
        return self.plant.sim.truth()

    def plant_state(self) -> dict[str, float]:
        """Everything of the gantry that a later run needs to go on."""
        return dict(self.plant.sim.state)

    def wires(self) -> dict[str, bool]:
        """Level of every wire that leads to an input of the axis, wherever it ends."""
        return self._signals.wires()

    def let_pass(self, seconds: float) -> None:
        """Nothing: the bus in this process lets time pass while the master waits."""

    def settle(self) -> None:
        """Let the load come to rest after the master has left."""
        settle(lambda: self.advance(_SETTLE_STEP_US), lambda: self.truth()[1], _SETTLE_STEP_US * 1e-6)

    def release(self) -> None:
        """Nothing: the gantry is of this process."""

    # --- frames in ---------------------------------------------------------------------------------------------

    def on_frame(self, can_id: int, data: bytes) -> None:
        """Take one data frame with an 11-bit identifier."""
        is_sync = can_id == self.process_data.sync_id
        if is_sync and self.stepped:
            if self._synced:
                self.advance(self.sync_period_us)
            self._synced = True
        # A frame that the drive does not hear lets its time go on all the same.
        if self._gate_in.in_use:
            self._gate_in.send(can_id, can_id, data)
        else:
            self._receive(can_id, data)

    def foreign(self, can_id: int, data: bytes) -> None:
        """Take a frame of a third party: the drive hears it, and so does its master."""
        self._out(can_id, data)
        self.on_frame(can_id, data)

    def _receive(self, can_id: int, data: bytes) -> None:
        if self._deaf:
            return
        if can_id == self.process_data.sync_id:
            self._on_sync(data)
        elif can_id == NMT:
            command = command_for(data, self.node_id)
            if command is not None:
                self.nmt(command)
        elif can_id == SDO_REQUEST + self.node_id:
            self._on_sdo(data)
        elif not self.process_data.receive(can_id, data) and can_id > HEARTBEAT and len(data) == 1:
            self._consumer.receive(can_id - HEARTBEAT, self.time_us)
        self.process_data.tick()

    @property
    def _deaf(self) -> bool:
        return (
            self.faults.silence or self.time_us < self._silent_until_us or self.state is NmtState.INITIALISING
        )

    def _on_sync(self, data: bytes) -> None:
        if self.state is NmtState.STOPPED:
            return
        if data and not self._wrong_sync:
            # 1019 is absent, so a SYNC has no counter and no data (CiA 301): EMCY 8240.
            self.emergency.warn(_SYNC_LENGTH)
        self._wrong_sync = bool(data)
        self.process_data.sync()

    def _on_sdo(self, data: bytes) -> None:
        faults = self.faults
        also = None if self.kind.sdo_preoperational_only else NmtState.OPERATIONAL
        if self.state not in (NmtState.PRE_OPERATIONAL, also) or faults.sdo_silent:
            return
        responses = self._sdo.answer(data)
        if not responses:
            return
        if faults.sdo_abort is not None:
            responses = (abort_frame(data[1] | data[2] << 8, data[3], faults.sdo_abort),)
        elif faults.sdo_toggle and responses[0][0] >> 5 in (0, 1):
            responses = (bytes((responses[0][0] ^ _TOGGLE,)) + responses[0][1:],)
        delay, self._answer_delay_us = self._answer_delay_us, 0
        if delay:
            self.after(delay, lambda: self._respond(responses))
        else:
            self._respond(responses)

    def _respond(self, responses: tuple[bytes, ...]) -> None:
        for response in responses:
            self.send(SDO_RESPONSE + self.node_id, response)

    # --- NMT ---------------------------------------------------------------------------------------------------

    def nmt(self, command: NmtCommand) -> None:
        """Obey an NMT command."""
        target = next_nmt(self.state, command)
        if target is NmtState.INITIALISING:
            self.reset(communication_only=command is NmtCommand.RESET_COMMUNICATION)
        else:
            self.enter(target)

    def enter(self, target: NmtState) -> None:
        """Change the NMT state; for 6007, entering STOPPED is a lost communication."""
        if target is NmtState.STOPPED and self.state is not NmtState.STOPPED:
            self.axis.communication_lost(_NMT_ABORT)
        self.state = target
        self.process_data.set_operational(target is NmtState.OPERATIONAL)

    def reset(self, communication_only: bool, off_us: int = 0) -> None:
        """Reset node or communication, then boot up.

        Args:
            communication_only: leave the objects from 2000h on and the axis alone; 6007 acts.
            off_us: time off the bus.
        """
        if communication_only:
            self.axis.communication_lost(_NMT_ABORT)
        self.state = NmtState.INITIALISING
        self.process_data.set_operational(False)
        self._store_failed = not self._parameters.reset(communication_only)
        self._sdo.reset()
        self.emergency.reset()
        for gate in (self._gate, self._gate_in, self._gate_out):
            gate.reset()
        self.process_data.reload()
        self._consumer.reload()
        if not communication_only:
            self.axis.reset()
            self.plant.power_on()
        if off_us:
            self.after(off_us, self._boot_up)
        else:
            self._boot_up()

    def _boot_up(self) -> None:
        self.send(HEARTBEAT + self.node_id, bytes((NmtState.INITIALISING,)))
        self._producer.reload(self.time_us)
        self.enter(NmtState.OPERATIONAL if self.kind.auto_operational else NmtState.PRE_OPERATIONAL)
        if self._store_failed:
            self.emergency.raise_error(_STORE_FAILED)

    # --- frames out and errors ---------------------------------------------------------------------------------

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame unless the node is off the bus."""
        if not self.faults.silence and self.time_us >= self._silent_until_us:
            if self._gate_out.in_use:
                self._gate_out.send(can_id, can_id, data)
            else:
                self._out(can_id, data)

    def _send_tpdo(self, number: int, can_id: int, data: bytes) -> None:
        """Send one TPDO (number 0 is the first)."""
        self._gate.send(number + 1, can_id, data)

    def send_heartbeat(self) -> None:
        """Send the heartbeat of this moment."""
        faults = self.faults
        if faults.heartbeat_off or self.state is NmtState.INITIALISING:
            return
        shown = self.state if faults.heartbeat_state is None else faults.heartbeat_state & 0xFF
        self.send(HEARTBEAT + self.node_id, b"" if self.kind.empty_heartbeat else bytes((shown,)))

    def _send_emcy(self, can_id: int, data: bytes) -> None:
        if self.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            self.send(can_id, data)

    def _heartbeat_lost(self) -> None:
        """React to a lost heartbeat: the axis by 6007, the NMT state by 1029."""
        # 1029:01: 0 leave OPERATIONAL, 1 no change, 2 enter STOPPED (CiA 301).
        self.axis.communication_lost(HEARTBEAT_LOST)
        if self.kind.silence_emcy_only:
            return
        reaction = self.od.number(0x1029, 1)
        if reaction == 0 and self.state is NmtState.OPERATIONAL:
            self.enter(NmtState.PRE_OPERATIONAL)
        elif reaction == 2:
            self.enter(NmtState.STOPPED)

    def _saving(self) -> None:
        self._answer_delay_us = 1000 * self.kind.save_ms
        self._silent_until_us = self.time_us + 1000 * self.kind.save_silence_ms
