"""CiA 402 drive in cyclic synchronous velocity on a CANopen bus, behind the `Drive` port.

One scan: `read` sends SYNC and takes the answers that belong to it, `write` sends the RPDO, which acts at the next
SYNC. So the feedback of scan k is the state at its SYNC, and a command acts one period later.
"""

from __future__ import annotations

import math
import random
from contextlib import suppress
from typing import Final

from gantryctl.drives.base import SimulatedPlant
from gantryctl.drives.canopen.brake import BrakeControl
from gantryctl.drives.canopen.bus.link import BusLink
from gantryctl.drives.canopen.bus.node import LATCHED, LOST, NmtCommand, RemoteNode, connection_flags
from gantryctl.drives.canopen.bus.requests import SdoRequests
from gantryctl.drives.canopen.cia402 import (
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    ENERGISED,
    FOLLOWS_COMMAND,
    INTERNAL_LIMIT,
    TURNING,
    WARNING,
    decode_statusword,
    next_controlword,
)
from gantryctl.drives.canopen.nodes.neighbours import Neighbours
from gantryctl.drives.canopen.process_image import ProcessImage
from gantryctl.drives.canopen.settings import CanopenSettings, drive_identity
from gantryctl.drives.canopen.setup.opening import (
    RESTART_MARKERS,
    NodeSetup,
    open_node,
    refuse_a_running_drive,
    write_restart_marker,
)
from gantryctl.drives.canopen.setup.parameter_watch import ParameterWatch
from gantryctl.drives.canopen.stop_by_sdo import StopBySdo
from gantryctl.drives.canopen.supervision import Supervision
from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import DeviceError
from gantryctl.image import (
    SAFE_OUTPUT,
    DriveFeedback,
    DriveIdentity,
    DriveRequest,
    DriveState,
    LinkFlag,
    LinkHealth,
    OutputImage,
)
from gantryctl.ports import Truth

_FIRST_ANSWER_S: Final = 0.5
_CLOSE_S: Final = 3.0
# A controlword acts at the next SYNC and shows at the one after (decision 0012); one scan more is granted.
_OBEYED_SCANS: Final = 3
_CHANGED: Final = LATCHED | LinkFlag.WRONG_MODE | LinkFlag.STALE_TARGET | LinkFlag.WRONG_LENGTH
# A drive may show Operation enabled while its brake still opens. Less than power_up_time_ms, whose alarm tells less.
_FOLLOWS_WITHIN_S: Final = 1.0
# Scans without any answer to SYNC after which a stop is asked for by SDO as well.
_SILENT_SCANS: Final = 2
# A sound drive shows after two or three scans that its torque is off; the program tells people of one that does not.
_TORQUE_KEPT_S: Final = 0.2
_SILENT_ANSWER_S: Final = 0.1
_REST_RAD_S: Final = 0.02
# Time for the frames that wait before SYNC; the answers and the program need the rest of the scan. A frame of UDP
# takes 30 to 60 us.
_DRAIN_SHARE: Final = 0.4
_DRAIN_MIN_S: Final = 0.001
# A tenth of a period of 4 ms is 0.0024 deg at 6 deg/s: far inside every band. Held up for 9 ms between the clock and
# SYNC, a sound axis showed a step of 0.06 deg too much, which looks like a jump of the encoder.
_SPREAD_MIN: Final = 0.1
_TORQUE_TAKEN: Final = (
    # A drive opens its brake against the preload (60B2) before it shows Operation enabled.
    DriveState.SWITCHED_ON,
    DriveState.OPERATION_ENABLED,
    DriveState.QUICK_STOP_ACTIVE,
)
_IN_FAULT: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)


class CanopenDrive:
    """Drive on a CANopen bus, set up by `open()`.

    Args:
        link: the bus; closed by `close`.
        settings: of the drive.
        plant: the simulated gantry of a virtual drive.

    Attributes:
        node: NMT, SDO, emergency messages.
        beside: other nodes on the same SYNC; inputs, outputs, the encoder on the ring.
        requests: SDO behind the process data.
        opened: identity, parameter check and mapping; after `open`.
        parameter_watch: the same parameters, read again while the axis runs.
        commanded: the program has written: heartbeats are sent, and the drive watches the controller.
        silent_process_data, silent_heartbeat: for the proof that the drive stops a silent controller's axis.
    """

    def __init__(self, link: BusLink, settings: CanopenSettings, plant: SimulatedPlant | None = None) -> None:
        self.link, self.settings, self.plant = link, settings, plant
        self.node = RemoteNode(link, settings.node, settings.master_node, settings.sdo_timeout_s)
        self.beside = Neighbours(self.node, settings, lambda: self.process.in_time)
        self.silent_process_data = self.silent_heartbeat = False
        self.scan = self._heartbeat_due = 0
        self.commanded = self._due = self._closed = False
        self._flags = LinkFlag.NONE
        # A stepped drive waits, whatever holds this computer up.
        self._drain_s = math.inf if link.stepped else max(_DRAIN_SHARE * settings.period_s, _DRAIN_MIN_S)
        self._synced_s = self._sampled_s = self._spread_scans = 0.0
        self._request = DriveRequest.DISABLE
        self._passed = 1

    # --- before the first scan ---------------------------------------------------------------------------------

    def open(self) -> CanopenDrive:
        """Set the drive up, start it, and wait for its first answer to SYNC.

        Raises:
            DeviceError: it cannot be set up; the link is closed then.
        """
        try:
            self._set_up(open_node(self.node, self.settings), None)
        except BaseException:
            self._closed = True
            self._leave()
            raise
        return self

    def _set_up(self, opened: NodeSetup, before: ProcessImage | None) -> None:
        """Begin with what was found and written; forget every earlier connection."""
        settings, node = self.settings, self.node
        self.opened = opened
        self.beside.open()
        self.process = ProcessImage(
            node, settings, opened.units, opened.mapping, self.beside.watches, before
        )  # fmt: skip
        self.requests = SdoRequests(node)
        self.parameter_watch = ParameterWatch(self.requests, opened.kept, settings.period_s)
        self._stop_by_sdo = StopBySdo(node, self.requests, settings, self.process.takes_speed)
        self._supervision = Supervision(node, self.process, self.requests, settings)
        self._brake, self._controlword = BrakeControl(settings), DISABLE_VOLTAGE
        self.silent_process_data = self.silent_heartbeat = self._followed = self.commanded = False
        self._flags, self._enabling, self._torque_kept, self._in_fault = LinkFlag.NONE, 0, 0, True
        node.state = None
        node.forget_boots()
        node.emergencies.code = opened.error_code
        # A drive without a heartbeat producer (1017) is not expected to send one.
        watched = any(row.place == "1017:00" and row.verdict is ParameterVerdict.OK for row in opened.rows)
        self._heartbeat_timeout = settings.timeout_scans if watched else None
        self.link.accept(node.identifiers)
        self._first_answer()

    @property
    def lost(self) -> bool:
        """Connection lost or something changed in the drive: only a new set-up makes it usable again."""
        return bool(self._flags & _CHANGED or self.parameter_watch.differs) or self.beside.changed

    def set_up_again(self) -> None:
        """Set a lost drive up on the same bus, with power off and between two scans; nothing moves.

        Raises:
            DeviceError: it does not answer, is enabled, or is another drive; it stays lost then.
        """
        # Blocking SDO: nobody scans for some tenths of a second, so only a reset by a person does this (decision
        # 0012).
        node = self.node
        node.drain()
        node.enter_pre_operational()
        # Its own watch is all that stops a drive that still has torque.
        refuse_a_running_drive(node)
        self._take_the_watch_off()
        key = node.identity().key
        if key != self.opened.identity.key:
            raise DeviceError(
                f"node {node.node} is now {key}, it was {self.opened.identity.key}: another drive"
            )
        self._set_up(open_node(node, self.settings), self.process)

    def _first_answer(self) -> None:
        self._exchange(_FIRST_ANSWER_S)
        if not self.process.complete:
            raise DeviceError(
                f"node {self.settings.node} does not answer SYNC with its process data: is it OPERATIONAL, and is "
                "1005 = 80h?"
            )
        self.beside.check_answers()
        self._last = self._feedback()

    def resume(self) -> None:
        """Go on after an intended silence; the set-up is still valid unless the drive has restarted.

        Raises:
            DeviceError: it has restarted, or does not answer.
        """
        self.silent_process_data = self.silent_heartbeat = False
        self.node.drain()
        if self.node.boots:
            raise DeviceError(f"node {self.settings.node} has restarted: open it anew")
        # The speed of before the silence; the RPDO repeats the 0 (DRV-08 asks for it before that).
        with suppress(DeviceError):
            self.node.sdo.set(0x60FF, 0, 0)
        self.node.nmt(NmtCommand.START)
        self.node.state, self._flags, self.commanded = None, LinkFlag.NONE, False
        self.process.forget()
        self.beside.resume()
        self._first_answer()

    def look(self) -> DriveFeedback:
        """Send SYNC and no command: what a drive shows before the controller speaks again."""
        silent, self.silent_process_data = self.silent_process_data, False
        # Of a drive that has left OPERATIONAL no telegram comes: a stepped one is then waited for by its SDO answer.
        self._exchange(self._patience_s)
        self.silent_process_data = silent
        if self.link.stepped:
            self.requests.wait(_SILENT_ANSWER_S)
        self._last = self._feedback()
        return self._last

    @property
    def refusals(self) -> tuple[str, ...]:
        """Lines of the parameter check that forbid enabling."""
        return self.opened.refusals

    @property
    def facts(self) -> DriveFacts:
        """What the drive has, as its set-up has left it."""
        return self.opened.facts

    @property
    def torque_preload(self) -> bool:
        """60B2 and 6077 are both mapped: a torque that cannot be read proves nothing."""
        return self.process.torque_offset and self.process.torque_known

    @property
    def reports_torque(self) -> bool:
        """6077 is mapped."""
        return self.process.torque_known

    def identity(self) -> DriveIdentity:
        """Name, serial number and resolution."""
        return drive_identity(self.opened.settings, self.opened.identity.text, self.opened.identity.key)

    # --- the scan ----------------------------------------------------------------------------------------------

    def read(self) -> DriveFeedback:
        """State at this scan's SYNC; the same until the next `write`."""
        if self._due and not self._closed:
            self._exchange(self._patience_s)
            self._last = self._feedback()
        return self._last

    @property
    def _patience_s(self) -> float:
        """Longest wait for the answers to the next SYNC."""
        # A stepped drive is waited for by seconds, because its process may be held up: not in every scan, though, of
        # one that does not answer any more, and not where no answer can come (CiA 301: process data in OPERATIONAL).
        if not self.link.stepped:
            return self.settings.answer_s
        if self.link.down or self._flags & LinkFlag.NOT_OPERATIONAL:
            return 0.0
        return (
            min(self.settings.answer_s, _SILENT_ANSWER_S) if self.process.silence else self.settings.answer_s
        )

    def _obeys(self, state: DriveState) -> bool:
        """False from where a drive keeps its torque against its command, until the next one: a relay takes it."""
        kept_max = round(_TORQUE_KEPT_S / self.settings.period_s)
        if self._controlword != DISABLE_VOLTAGE:
            self._torque_kept = 0
        elif self._torque_kept <= kept_max:
            self._torque_kept = self._torque_kept + self._passed if state in TURNING else 0
        return self._torque_kept <= kept_max

    def write(self, output: OutputImage) -> None:
        """Send the command of this scan, which acts at the next SYNC."""
        if self._closed:
            return
        # From the first heartbeat on the drive watches the controller, so none is sent before the program commands.
        if not self.commanded:
            self._synced_s = self.link.now_s()
            self.commanded = True
            self.node.forget_foreign()
            self._supervision.begin()
        state, lost = self._last.state, bool(self._flags & LOST)
        forbidden = self.refusals or lost
        request = self._request = DriveRequest.DISABLE if forbidden else output.request
        if self._supervision.forbids and state not in TURNING and request is DriveRequest.ENABLE:
            request = DriveRequest.DISABLE
        # A proof: a word that follows the drive's state would end what the drive has to end by itself.
        if not self.silent_heartbeat:
            word = next_controlword(state, request, self._controlword)
            release, at_once = output.brake_open, output.at_once
            self._controlword = self._brake.word(word, state, request, release, at_once=at_once)
        word = self._controlword
        self._enabling = self._enabling + 1 if word == ENABLE_OPERATION else 0
        enabled = state is DriveState.OPERATION_ENABLED and request is DriveRequest.ENABLE
        vel = output.vel_cmd_rad_s if enabled else 0.0
        torque = output.torque_ff_nm if state in _TORQUE_TAKEN else 0.0
        if not self.silent_process_data:
            self.beside.send(output, self._brake.released, not lost and self._obeys(state))
            outputs = self.beside.outputs.drive_word
            # Behind one missing SYNC answer there may be a drive that takes no commands either.
            if self.silent_heartbeat:
                pass  # a proof: what the drive does is its own doing
            elif lost or self.process.silence >= _SILENT_SCANS:
                self._stop_by_sdo.scan(word, outputs, self._passed)
            else:
                self._stop_by_sdo.forget()
            self.process.send(word, vel, torque, outputs)
            # A fault without EMCY, and without 603F in a telegram, is completed by an SDO read of 603F (decision
            # 0012).
            unknown = state in _IN_FAULT and not (self.process.error_code or self.node.emergencies.fault_code)
            self.parameter_watch.scan(self._passed, unknown)
            if not lost:
                self._supervision.ask(state in TURNING or request is DriveRequest.ENABLE)
        self._due = True

    def _exchange(self, answer_s: float) -> None:
        """Send SYNC and take its answers.

        Waiting for them costs up to `answer_s`. Taking those of the previous SYNC would cost nothing, but feedback
        one period old is 0.024 deg at 6 deg/s and 4 ms, seen as a following error (decision 0012).
        """
        self._due = False
        node, process = self.node, self.process
        periods = self._passed = self._periods()
        node.heartbeat_age += periods
        process.congested = not node.drain(self._drain_s)
        self.scan += periods
        node.scan = self.scan
        # A drive that left OPERATIONAL takes no command; if it still turns, silence makes its own watch stop it.
        deaf = self._flags & LinkFlag.NOT_OPERATIONAL and process.silence
        speaks = self.commanded and not self.silent_heartbeat and not deaf
        if speaks and self.scan >= self._heartbeat_due:
            node.heartbeat()
            self._heartbeat_due = self.scan + self.settings.heartbeat_scans
        if self.silent_process_data:
            if self.link.stepped and self.plant is not None:
                self.plant.let_pass(self.settings.period_s)
            node.listen_for(self.settings.period_s)
            return
        process.begin(periods)
        self.beside.begin(periods)
        node.sync()
        self._spread_scans = self._spread(periods)
        process.collect(answer_s)

    def _periods(self) -> int:
        """SYNC periods since the last SYNC, those that were missed included: ages and time-outs count them too."""
        # A controller that was held up leaves scans out, and the time-outs of the drive go on meanwhile (decision
        # 0005).
        before, self._synced_s = self._synced_s, self.link.now_s()
        if self.link.stepped or not self.commanded:
            return 1
        self._supervision.period(self._synced_s - before)
        return max(1, round((self._synced_s - before) / self.settings.period_s))

    def _spread(self, periods: int) -> float:
        """How much later, or earlier, than its scan this SYNC went out after the one before, in periods."""
        before, self._sampled_s = self._sampled_s, self.link.now_s()
        if self.link.stepped or not self.commanded:
            return 0.0
        spread = (self._sampled_s - before) / self.settings.period_s - periods
        return spread if abs(spread) > _SPREAD_MIN else 0.0

    def _feedback(self) -> DriveFeedback:
        process = self.process
        flags = self._flags = self._link_flags()
        status, lost = process.statusword, bool(flags & LOST)
        # Of a drive that is lost only what it has said by SDO since counts.
        state = self._stop_by_sdo.state if lost else self._shown(decode_statusword(status), status)
        # While the axis turns the alarm of a lost node stops it on its ramp; what its inputs show then is not known.
        inputs = self.beside.read_inputs(process.input_word, keep=state in ENERGISED)
        brake = self.beside.brake_contact()
        brake_open = self._brake.is_open(state, brake)
        self._follow_fault(state)
        code = self._fault_code()
        return DriveFeedback(
            state,
            process.position,
            process.vel_rad_s,
            process.torque_nm,
            brake_open,
            bool(status & INTERNAL_LIMIT) and state in ENERGISED,
            0.0,
            process.encoder_flags,
            code if self._in_fault else self._supervision.complaint,
            bool(status & WARNING),
            process.age,
            inputs,
            self.beside.ring_rad(process),
            link=flags,
            changed="" if lost else self.parameter_watch.line,
            speed_age_scans=process.speed_age,
            inputs_age_scans=process.inputs_age,
            brake_contact=brake is not None,
            spread_scans=self._spread_scans,
            foreign_id=self.node.foreign_id,
        )

    def _follow_fault(self, state: DriveState) -> None:
        """Note whether the drive is in fault, and forget what explained one that is over."""
        # Not every drive tells by EMCY that an error is over: it explains no later fault.
        if self._in_fault and state not in _IN_FAULT:
            self.node.emergencies.code = 0
        self._in_fault = state in _IN_FAULT

    def _fault_code(self) -> int:
        """Error code of a fault: by telegram, by EMCY, by SDO; a warning only where there is nothing else."""
        emergencies = self.node.emergencies
        return (
            self.process.error_code
            or emergencies.fault_code
            or self.parameter_watch.error_code
            or emergencies.code
        )

    def _shown(self, state: DriveState, status: int) -> DriveState:
        """Operation enabled from the moment the drive follows 60FF; some report it while the brake still opens."""
        if state is not DriveState.OPERATION_ENABLED:
            self._followed = False
        elif not self.settings.follows_bit or status & FOLLOWS_COMMAND:
            self._followed = True
        elif not self._followed:
            return DriveState.SWITCHED_ON
        return state

    def _link_flags(self) -> LinkFlag:
        flags = connection_flags(
            self.node, self._flags, commanded=self.commanded, timeout_scans=self._heartbeat_timeout
        )
        flags |= self.beside.flags(self.commanded)
        if self.commanded:
            status = self.process.statusword
            flags |= self._supervision.flags(self.scan, decode_statusword(status), status, self._request)
        elif self.process.age or self.process.inputs_age:
            flags |= LinkFlag.LATE
        return flags | self._ignores_command() if self.commanded and self._enabling > _OBEYED_SCANS else flags

    def _ignores_command(self) -> LinkFlag:
        """Enabled for long enough, yet bit 12 (CSV: drive follows the command value) is 0 again, or still."""
        status = self.process.statusword
        enabled = decode_statusword(status) is DriveState.OPERATION_ENABLED
        if not (enabled and self.settings.follows_bit) or status & FOLLOWS_COMMAND:
            return LinkFlag.NONE
        if self._followed:
            return LinkFlag.IGNORES_COMMAND
        never = self._enabling * self.settings.period_s > _FOLLOWS_WITHIN_S
        return LinkFlag.NEVER_FOLLOWED if never else LinkFlag.NONE

    def health(self) -> LinkHealth:
        """Counters of the telegrams, heartbeat age and emergency messages of this moment."""
        node, watches, emergencies, link = self.node, self.process.watches, self.node.emergencies, self.link
        return LinkHealth(
            drive_key=self.opened.identity.key,
            software=self.opened.identity.software,
            restart_marker=self.opened.restart_marker,
            heartbeat_age_scans=node.heartbeat_age,
            scans=self.scan,
            received=tuple(w.received for w in watches),
            missed=tuple(w.missed for w in watches),
            late=tuple(w.late for w in watches),
            duplicated=tuple(w.duplicated for w in watches),
            wrong_length=tuple(w.wrong_length for w in watches),
            longest_age_scans=tuple(w.longest_age for w in watches),
            contradicted=tuple(w.contradicted for w in watches),
            boots=node.boots,
            foreign=node.foreign,
            unknown=node.unknown + link.traffic.filtered,
            refused=link.refused,
            queue_full=link.queue_full,
            bus_offs=link.bus_offs,
            passives=link.passives,
            emergencies=emergencies.count,
            messages=tuple(message.text for message in emergencies.messages if message.code),
            nodes=self.beside.health(),
        )

    def leave_restart_marker(self) -> int | None:
        """Write a random marker into the drive, which a restart erases; None where it takes none."""
        marker = random.SystemRandom().choice(RESTART_MARKERS)
        return marker if write_restart_marker(self.node.sdo, self.settings.node, marker) else None

    @property
    def truth_source(self) -> Truth | None:
        """Gantry of a virtual drive."""
        return self.plant

    def plant_state(self) -> dict[str, float]:
        """State of a virtual drive's gantry in this process."""
        return {} if self.plant is None else self.plant.plant_state()

    # --- the end -----------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Torque off, brake closed, no watch over a controller that falls silent now; then leave the bus.

        A drive that does not show that it is off keeps its watch, which stops it as soon as nobody sends any more.
        """
        if self._closed:
            return
        try:
            self.silent_process_data = self.silent_heartbeat = False
            if not self.commanded or self._comes_to_rest():
                with suppress(DeviceError):
                    self._take_the_watch_off()
        finally:
            self._closed = True
            self._leave()

    def _leave(self) -> None:
        self.link.close()
        if self.plant is not None:
            if self.commanded:
                self.plant.settle()
            self.plant.release()

    def _take_the_watch_off(self) -> None:
        """Stop process data and the drive's heartbeat consumer (1016): silence is no fault any more."""
        self.node.enter_pre_operational()
        if self.node.sdo.optional(0x1016, 1):
            self.node.sdo.set(0x1016, 1, 0)
        # Behind the drive's: a node that does not answer any more leaves no fault in a drive that does.
        self.beside.release()

    def _comes_to_rest(self) -> bool:
        """Scan with safe outputs until the drive is off and its shaft at rest; False for one that does not show it."""
        period = self.settings.period_s
        for _ in range(round(_CLOSE_S / period)):
            self.write(SAFE_OUTPUT)
            self.link.pace(period)
            seen = self.read()
            # Of a lost drive nothing is known; a telegram that is missing, or a full queue, is no reason to leave.
            if seen.link & LOST:
                return False
            off = seen.state not in (*ENERGISED, DriveState.UNKNOWN) and not seen.age_scans
            if off and not seen.brake_open and abs(seen.vel_act_rad_s) < _REST_RAD_S:
                return True
        return False
