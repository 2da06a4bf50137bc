"""Virtual drive as a CANopen node: frames in, frames out, time as an argument; it knows no bus and no clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from gantryctl.drives.base import TRUTH_COLUMNS, settle
from gantryctl.drives.faults import Faults
from gantryctl.drives.virtual.axis.drive_axis import DriveAxis
from gantryctl.drives.virtual.axis.hardware import Hardware, Scaling
from gantryctl.drives.virtual.axis.plant import DrivePlant
from gantryctl.drives.virtual.axis.signals import Signals
from gantryctl.drives.virtual.axis.speed_reference import SpeedReference, interpolation_us
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.identifiers import Send
from gantryctl.drives.virtual.communication.nmt import NmtState
from gantryctl.drives.virtual.communication.objects import device_tables
from gantryctl.drives.virtual.communication.parameters import Parameters, ParameterStore
from gantryctl.drives.virtual.communication.sdo import abort_frame
from gantryctl.drives.virtual.communication.stack import NMT_ABORT, ProtocolStack
from gantryctl.drives.virtual.personality import Personality
from gantryctl.drives.virtual.side_channel.frame_gate import FrameGate
from gantryctl.errors import UsageError

# Error codes of CiA 402: EEPROM, loss of parameters.
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
        self._out = send
        self._tick_us = round(hardware.tick_s * 1e6)
        self._owed_us = 0
        self._synced = False
        self._later: list[tuple[int, Callable[[], object]]] = []
        self._answer_delay_us = self._silent_until_us = 0
        self._store_failed = False
        full, self.device = device_tables(hardware, kind)
        self.scaling = scaling = Scaling(hardware, kind)
        self.od = od = Dictionary(full, self.device, node_id)
        self.stack = stack = ProtocolStack(od, node_id, kind, self, self.faults.tpdo)
        self.emergency, self.process_data = stack.emergency, stack.process_data
        self.plant = DrivePlant(hardware, self.faults)
        reference = SpeedReference(od, self.plant, scaling, kind, self.faults, hardware.tick_s)
        self.axis = DriveAxis(hardware, od, self.plant, reference, self.emergency, kind, self.faults)
        self._signals = Signals(hardware, self.axis, od, scaling, kind, self.faults)
        self._store = store or ParameterStore()
        self._parameters = Parameters(od, self.axis, scaling, self._store, self._saving, kind.modes)
        self._gate_in = FrameGate(self.faults.frames, self._receive)
        self._gate_out = FrameGate(self.faults.frames, self._out)

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
        self.stack.tick(now, hears_heartbeat=not self.kind.heartbeat_without_effect)
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
        self.stack.receive(can_id, data)

    @property
    def _deaf(self) -> bool:
        return (
            self.faults.silence
            or self.time_us < self._silent_until_us
            or self.stack.state is NmtState.INITIALISING
        )

    def answer_sdo(self, request: bytes) -> None:
        """Answer an SDO request, as sound or as spoilt as the drive is."""
        faults = self.faults
        if faults.sdo_silent:
            return
        responses = self.stack.sdo.answer(request)
        if not responses:
            return
        if faults.sdo_abort is not None:
            responses = (abort_frame(request[1] | request[2] << 8, request[3], faults.sdo_abort),)
        elif faults.sdo_toggle and responses[0][0] >> 5 in (0, 1):
            responses = (bytes((responses[0][0] ^ _TOGGLE,)) + responses[0][1:],)
        delay, self._answer_delay_us = self._answer_delay_us, 0
        if delay:
            self.after(delay, lambda: self.stack.respond(responses))
        else:
            self.stack.respond(responses)

    # --- NMT ---------------------------------------------------------------------------------------------------

    @property
    def state(self) -> NmtState:
        """NMT state."""
        return self.stack.state

    def communication_lost(self, code: int) -> None:
        """Let the axis react to a communication that is lost (6007)."""
        self.axis.communication_lost(code)

    def reset(self, communication_only: bool, off_us: int = 0) -> None:
        """Reset node or communication, then boot up.

        Args:
            communication_only: leave the objects from 2000h on and the axis alone; 6007 acts.
            off_us: time off the bus.
        """
        if communication_only:
            self.axis.communication_lost(NMT_ABORT)
        self.stack.begin_reset()
        self._store_failed = not self._parameters.reset(communication_only)
        for gate in (self._gate_in, self._gate_out):
            gate.reset()
        self.stack.take_over()
        if not communication_only:
            self.axis.reset()
            self.plant.power_on()
        if off_us:
            self.after(off_us, self._boot_up)
        else:
            self._boot_up()

    def _boot_up(self) -> None:
        self.stack.boot_up()
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

    def send_heartbeat(self) -> None:
        """Send the heartbeat of this moment."""
        faults = self.faults
        if not faults.heartbeat_off:
            self.stack.send_heartbeat(
                None if faults.heartbeat_state is None else faults.heartbeat_state & 0xFF
            )

    def _saving(self) -> None:
        self._answer_delay_us = 1000 * self.kind.save_ms
        self._silent_until_us = self.time_us + 1000 * self.kind.save_silence_ms
