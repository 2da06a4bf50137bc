"""The controller process: the scan and nothing that could hold it up.

`python -m gantryctl.service.controller HANDLE CONFIG HASH [--second-person]` runs it.

It opens the machine, scans until it is told to end, brings the axis to rest, closes the brake, takes the torque off and
keeps the state.
"""

from __future__ import annotations

import contextlib
import math
import secrets
import signal
import time
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Final

from gantryctl.errors import AlarmStop, ConfigError, GantryctlError
from gantryctl.image import DriveState
from gantryctl.machine import Machine, config_hash, load_machine, short_hash
from gantryctl.operation.bus_log import AlarmFrames, freeze
from gantryctl.operation.client import BRAKE_WATCH_S
from gantryctl.operation.opening import left_on_failure, open_axis, set_up_again
from gantryctl.operation.proofs import bus_reasons
from gantryctl.operation.store import StateStore
from gantryctl.program import GantryProgram
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import ENERGISED
from gantryctl.runtime import ScanFailure
from gantryctl.service.command.inbox import Inbox
from gantryctl.service.command.operator import ServiceOperator
from gantryctl.service.command.permit import Permit
from gantryctl.service.command.rules import first_levels
from gantryctl.service.controller.alarm_view import AlarmView
from gantryctl.service.controller.brake_watch import BrakeWatch
from gantryctl.service.controller.publisher import Publisher
from gantryctl.service.controller.retainer import Retainer
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.frame_ring import RingFrames
from gantryctl.service.memory.held_up import HeldUp
from gantryctl.service.memory.last_seen import LastSeen
from gantryctl.service.memory.memory import JournalHealth, SharedMemory, Source, Word
from gantryctl.service.memory.snapshot import Snapshot, publish_json
from gantryctl.service.memory.trace_ring import RingRecorder, rest_metadata
from gantryctl.service.realtime import die_with_parent, prepare_scan_process
from gantryctl.trace.naming import next_number
from gantryctl.wiring.bus_log import logged_links
from gantryctl.wiring.engine import build_engine, recording_metadata

# A shutdown that takes longer ends with torque off and the brake closed.
END_S: Final = 20.0
SECOND_PERSON: Final = "--second-person"
_DAY_S: Final = 86400.0
_STOP_S: Final = 5.0
_STOP_TRIES: Final = 20


class Controller:
    """One machine in service, from opening to closing.

    Args:
        memory: the service's shared memory.
        store: the machine's state directory, locked.
        second_person: what one person arms, another one executes.
    """

    def __init__(
        self, machine: Machine, store: StateStore, memory: SharedMemory, *, second_person: bool = False
    ) -> None:
        self.machine, self.memory, self._store = machine, memory, store
        opened = open_axis(machine, store)
        # Whatever fails from here on, a drive that was set up is not left behind on its bus.
        with left_on_failure(opened.drive):
            program, retained = opened.program, opened.retained
            assert isinstance(program, GantryProgram)
            self.axis, self.notes = program.axis, opened.notes
            # Commands in the rings were sent to a controller that is gone.
            for ring in memory.commands:
                ring.clear()
            self.events = EventLog(memory.events[Source.CONTROLLER])
            self.alarms = AlarmView(
                self.axis.alarms, self.axis.feedback, self.events, self.axis.settings.travel
            )
            self.brake = BrakeWatch(machine, self.axis, self.events, retained)
            self.permit = Permit(self.axis, JournalHealth(memory.words), self.events, opened.reasons)
            self.operator = ServiceOperator(
                machine,
                program,
                Inbox(memory.commands, memory.replies, self.events),
                self.permit,
                self.alarms.acknowledge,
                first_levels(machine, opened.speed_max_deg_s, retained.speed_rad_s, retained.increment_rad),
                # Epochs start from a random number, so that none of a previous start is met again (decision 0011).
                epoch=secrets.randbits(40),
                second_person=second_person,
            )
            self.engine = build_engine(
                machine, opened.drive, program, self.operator,
                recorder=partial(RingRecorder, memory.rows), real_time=True,
            )  # fmt: skip
            assert isinstance(self.engine.recorder, RingRecorder)
            self._recorder = self.engine.recorder
            # Numbers count on over restarts of controller and service, and when the folder was emptied.
            words = memory.words
            self._recorder.end(words[Word.RECORDING])
            newest = max(words[Word.RECORDING], retained.power_ups, next_number(store.traces) - 1)
            words[Word.RECORDING] = newest
            self.retainer = Retainer(machine, store, self.engine, self.operator, retained)
            self._held_up = HeldUp("controller", partial(self.events.put, "service"), self.operator.now)
            self._frames = AlarmFrames(self.axis.alarms, store.traces)
            self._powered = False
            self._resets = self._lost_rows = 0
            self._end_s = math.inf
            self._off_s = -math.inf

    # --- the run ----------------------------------------------------------------------------------

    def run(self, *, real_time: bool) -> int:
        """Scan until the end; the exit code.

        Args:
            real_time: the system granted scheduling and memory.
        """
        self._write_start()
        metadata = {
            **recording_metadata(self.machine),
            "version": version("gantryctl"),
            **rest_metadata(self.machine.motor.torque_rated_nm, self.retainer.count_rad),
        }
        publish_json(self.memory.columns, {"columns": list(self._recorder.columns), "metadata": metadata})
        publisher = Publisher(
            self.machine, self.engine, self.operator, self.alarms, self.brake, self._recorder, self.memory,
            real_time=real_time, version=version("gantryctl"),
        )  # fmt: skip
        failure: AlarmStop | None = None
        try:
            while not self.engine.run_until(lambda _: self._after_scan(publisher), _DAY_S):
                pass
        except GantryctlError as raised:
            failure = self._stopped_by(raised)
            self._hold_load(publisher)
        finally:
            self._close(failure)
        return 0 if failure is None else AlarmStop.exit_code

    def _stopped_by(self, raised: GantryctlError) -> AlarmStop:
        """Bring the axis to rest after an error in a scan, whatever it was; the engine has begun the stop."""
        engine = self.engine
        failure = (
            raised
            if isinstance(raised, AlarmStop)
            else ScanFailure(raised, engine.scan, engine.time_s, held=engine.holds_load)
        )
        if isinstance(failure, ScanFailure):
            reaction = Reaction.HOLD if engine.holds_load else None
            self.axis.alarms.raise_(Code.SYS_09, reaction, **failure.values)
            self.alarms.scan()
        else:
            self.events.put("alarm", str(failure))
        end_s = engine.time_s + _STOP_S
        for _ in range(0 if engine.holds_load else _STOP_TRIES):
            # A drive that was silent for a moment may answer again.
            with contextlib.suppress(GantryctlError):
                engine.run_for(max(0.0, end_s - engine.time_s))
                break
        return failure

    def _hold_load(self, publisher: Publisher) -> None:
        """Go on, and tell, while torque alone holds the load without a program, until the service ends."""
        engine = self.engine
        while engine.holds_load and time.monotonic() <= self._end_s:
            try:
                engine.run_until(lambda _: self._after_scan(publisher) or not engine.holds_load, _DAY_S)
            except GantryctlError:  # what comes after a scan may be what has failed
                if self.operator.shutdown:
                    self._end_s = min(self._end_s, time.monotonic() + END_S)

    def end(self) -> None:
        """Let the axis come to rest, close the brake, take torque off, then leave `run`."""
        self.operator.shutdown = True

    def _after_scan(self, publisher: Publisher) -> bool:
        """Answer, watch, publish; True ends the run."""
        self._held_up.look()
        self.operator.settle()
        self._watch()
        publisher.scan()
        if not self.operator.shutdown:
            return False
        now_s = time.monotonic()
        self._end_s = min(self._end_s, now_s + END_S)
        resting = self.axis.is_off and self.axis.at_rest
        watched = self.engine.time_s - self._off_s >= BRAKE_WATCH_S
        return (resting and watched) or now_s > self._end_s

    def _watch(self) -> None:
        """Follow resets, brake tests, power and motions: counters, recording, state on the disk."""
        retainer, permit, engine = self.retainer, self.permit, self.engine
        self._frames.look(engine.time_s)
        if permit.resets != self._resets:
            self._resets = permit.resets
            self._after_reset()
        self._report_write_faults()
        before = retainer.retained
        retainer.retained = self.brake.scan(before, retainer.power_ups, engine.time_s)
        if retainer.retained is not before:
            retainer.start("brake test")
        on = not self.axis.is_off
        if on is not self._powered:
            self._powered = on
            self._switched(on)
        # The program raises it in the scan that it comes in; from its reset on nobody asks for it any more.
        if engine.system_stop is not None and self.axis.system_stop is None:
            engine.system_stop = None
        if self._recorder.number and self.memory.words[Word.RECORDING_LONG] == self._recorder.number:
            self._record_on()
        retainer.scan()

    def _record_on(self) -> None:
        """Begin the next recording in the scan after the last one."""
        self._recorder.stop()
        number = self.memory.words[Word.RECORDING] + 1
        self.memory.words[Word.RECORDING] = self._recorder.number = number

    def _after_reset(self) -> None:
        """Follow a reset between two scans: forget acknowledged stops, and set up a lost drive again."""
        if not self.permit.held:
            self.retainer.retained = replace(self.retainer.retained, error_stop="")
        if not self.axis.is_off:
            return
        try:
            if not set_up_again(self.engine):
                return
        except GantryctlError as fault:
            self.events.put("service", f"the drive could not be set up again: {fault}")
            return
        self.events.put("service", "the drive was set up again")
        self.permit.judge_bus(bus_reasons(self.machine, self._store, self.engine.drive))

    def _switched(self, on: bool) -> None:
        if on:
            self.retainer.powered_up()
            self._record_on()
            self.brake.judge(self.retainer.retained, self.retainer.power_ups)
            return
        self._off_s = self.engine.time_s
        self._recorder.stop()
        lost, self._lost_rows = self._recorder.lost - self._lost_rows, self._recorder.lost
        if lost:
            self.events.put(
                "service", f"recording: {lost} rows are missing, the recorder was away for too long"
            )
        self.retainer.start("power off")

    def _report_write_faults(self) -> None:
        while self.retainer.faults:
            self.events.put("service", f"the state was not kept: {self.retainer.faults.popleft()}")

    def _close(self, failure: AlarmStop | None) -> None:
        """Take torque off and close the brake, keep the state, and write the end into the journal."""
        try:
            self.engine.close()
        finally:
            self.retainer.finish(failure)
            self._report_write_faults()
            self.operator.refusals.close()
            self.events.put("service", self._ended(failure is None))
            self.memory.words[Word.CONTROLLER_CLEAN] = failure is None
            self.memory.words[Word.COMMISSIONING] = failure is None and self.operator.hands_over

    def _ended(self, clean: bool) -> str:
        """How the controller left the axis, by the last reading: what that does not show was only commanded."""
        feedback, drive = self.axis.feedback, self.engine.image.drive
        where = ""
        if clean:
            at = self.machine.axis.dial.text(math.degrees(self.axis.pos_act_rad), ".3f")
            where = f" at {at} deg" if feedback.position_valid else ", the angle is not known"
        seen = drive.age_scans == 0 and drive.state is not DriveState.UNKNOWN
        if not seen or drive.state in ENERGISED or drive.brake_open:
            return f"controller ended{where}, torque off and brake commanded, not confirmed: press the emergency stop"
        brake = "brake closed" if feedback.brake_known else "brake commanded closed, not confirmed"
        return f"controller ended{where}, {brake}, torque off"

    def _write_start(self) -> None:
        """Write the start into the journal, and how the run before ended if it was not shut down."""
        before, age_ms = Snapshot(self.memory).fast()
        if before and not self.memory.words[Word.CONTROLLER_CLEAN]:
            seen = LastSeen.of(before, self.machine.axis.dial)
            told = seen.told(Words.AGO(age_s=age_ms * 1e-3))
            self.events.put("alarm", told.line, None, code=str(told.code), **seen._asdict())
            # The recorder still has the last frames of the controller before.
            freeze(self._store.traces, Code.SYS_05)
        self.memory.words[Word.CONTROLLER_CLEAN] = 0
        self.events.put("service", f"controller started: {self.machine.name}", hash=short_hash(self.machine))
        for note in self.notes:
            self.events.put("service", note)


def main(arguments: list[str]) -> int:
    """Entry point of the process."""
    handle, config, wanted = int(arguments[0]), Path(arguments[1]), arguments[2]
    root, options = Path(arguments[3]), arguments[4:]
    memory = SharedMemory(handle)
    die_with_parent(memory.words[Word.SUPERVISOR])
    machine = load_machine(config)
    if config_hash(machine) != wanted:
        raise ConfigError([f"{config}: has changed since the service was started; start the service again"])
    # The store locks the state directory: two controllers of one machine are impossible.
    with StateStore(machine, root) as store, logged_links(RingFrames(memory.frames)):
        controller = Controller(machine, store, memory, second_person=SECOND_PERSON in options)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, lambda *_: controller.end())
        return controller.run(real_time=prepare_scan_process())
