"""The controller process: the scan, alone.

`python -m gantryctl.service.controller HANDLE CONFIG HASH [--second-person]` runs it.

It opens the machine (and so locks its state directory: two controllers are impossible), scans until it is told to end,
brings the axis to rest, closes the brake, takes the torque off and keeps the state.
"""

from __future__ import annotations

import contextlib
import math
import signal
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Final

from gantryctl.errors import AlarmStop, ConfigError, GantryctlError
from gantryctl.machine import Machine, config_hash, load_machine, short_hash
from gantryctl.operation import StateStore
from gantryctl.operation.brake_policy import LOCKED
from gantryctl.operation.bus import set_up_again
from gantryctl.program import PowerPhase
from gantryctl.runtime import Engine, failure_text
from gantryctl.service.controller.alarm_view import AlarmView
from gantryctl.service.controller.brake_watch import BrakeWatch
from gantryctl.service.controller.opening import BUS, bus_refusal, open_service
from gantryctl.service.controller.publisher import Publisher
from gantryctl.service.controller.retainer import Retainer
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.memory.snapshot import Snapshot, publish_json
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.service.realtime import die_with_parent, prepare_scan_process

RECORDER_S: Final = 10.0
"""A recorder that is silent for longer keeps no events."""
END_S: Final = 20.0
"""A shutdown that takes longer ends with torque off and the brake closed."""
SECOND_PERSON: Final = "--second-person"
_DAY_S: Final = 86400.0
_STOP_S: Final = 5.0
_STOP_TRIES: Final = 20


class Controller:
    """One machine in service, from opening to closing.

    Args:
        memory: the service's shared memory.
        store: the machine's state directory, locked.
        second_person: what one user arms, another one executes.
    """

    def __init__(
        self, machine: Machine, store: StateStore, memory: SharedMemory, *, second_person: bool = False
    ) -> None:
        self.machine, self.memory = machine, memory
        self._store = store
        self.real_time = False
        opened = open_service(machine, store, memory, second_person=second_person)
        self.engine, self.operator, self._recorder = opened.engine, opened.operator, opened.recorder
        self._drive, self.notes = opened.drive, opened.notes
        self.retainer = Retainer(machine, store, opened)
        self.axis = self.operator.program.axis
        self.events: EventLog = self.operator.events
        self.alarms = AlarmView(self.axis.alarms, self.events)
        self.brake = BrakeWatch(machine, self.axis, self.events, opened.retained)
        rules = self.operator.rules
        rules.untestable = self.brake.untestable
        rules.locked = self._locked
        rules.journal_keeps, rules.acknowledge = self._journal_keeps, self.alarms.acknowledge
        self.operator.on_reset = self._reset
        self._powered = self._reset_asked = False
        self._lost_rows = 0
        self._end_s = math.inf

    # --- the run ----------------------------------------------------------------------------------

    def run(self) -> int:
        """Scan until the end; the exit code."""
        self._say_hello()
        publish_json(self.memory.columns, self._metadata())
        self._publisher = Publisher(
            self.machine, self.engine, self.operator, self.alarms, self.brake, self._recorder, self.memory,
            real_time=self.real_time, version=version("gantryctl"),
        )  # fmt: skip
        failure: AlarmStop | None = None
        try:
            while not self.engine.run_until(self._after, _DAY_S):
                pass
        except GantryctlError as raised:
            failure = self._stopped_by(raised)
        finally:
            self._close(failure)
        return 0 if failure is None else AlarmStop.exit_code

    def _stopped_by(self, raised: GantryctlError) -> AlarmStop:
        """Something raised in a scan, and the engine stops the axis: bring it to rest, whatever it was."""
        engine = self.engine
        if isinstance(raised, AlarmStop):
            failure = raised
        else:
            failure = AlarmStop(failure_text(raised, engine.scan, engine.time_s))
        self.events.put("alarm", str(failure))
        end_s = engine.time_s + _STOP_S
        for _ in range(_STOP_TRIES):
            with contextlib.suppress(GantryctlError):  # a drive that was silent for a moment may answer again
                engine.run_for(max(0.0, end_s - engine.time_s))
                break
        return failure

    def end(self) -> None:
        """Come to rest, brake closed, torque off, then leave `run`."""
        self.operator.shutdown = True

    def _after(self, _: Engine) -> bool:
        """After every scan; True ends the run."""
        self.operator.settle()
        if self._reset_asked:
            self._reset_asked = False
            self._set_up_again()
        self._watch()
        self._publisher.scan()
        if not self.operator.shutdown:
            return False
        now_s = time.monotonic()
        self._end_s = min(self._end_s, now_s + END_S)
        resting = self.axis.power.phase is PowerPhase.OFF and self.operator.at_rest
        return resting or now_s > self._end_s

    def _watch(self) -> None:
        """Power up and down, motions: counters, recording, state on the disk."""
        retainer = self.retainer
        self._say_keeping_faults()
        before = retainer.retained
        retainer.retained = self.brake.scan(before, retainer.power_ups, self.engine.time_s)
        if retainer.retained is not before:
            retainer.start("brake test")
        on = self.axis.power.phase is not PowerPhase.OFF
        if on is not self._powered:
            self._powered = on
            self._switched(on)
        late, rules = self.engine.overrun_stop, self.operator.rules
        if late is not None and late not in rules.held:
            rules.held = f"{rules.held}; {late}" if rules.held else late
            self.events.put("alarm", late)
        retainer.scan()

    def _switched(self, on: bool) -> None:
        if on:
            self.retainer.powered_up()
            self._recorder.number = int(time.time() * 1000)
            self.brake.judge(self.retainer.retained, self.retainer.power_ups)
            return
        self._recorder.stop()
        lost, self._lost_rows = self._recorder.lost - self._lost_rows, self._recorder.lost
        if lost:
            self.events.put(
                "service", f"recording: {lost} rows are missing, the recorder was away for too long"
            )
        self.retainer.start("power off")

    def _say_keeping_faults(self) -> None:
        while self.retainer.faults:
            self.events.put("service", f"the state was not kept: {self.retainer.faults.popleft()}")

    def _close(self, failure: AlarmStop | None) -> None:
        """Torque off, brake closed, state kept, and said so."""
        try:
            self.engine.close()
        finally:
            self.retainer.finish(failure)
            self._recorder.stop()
            self._say_keeping_faults()
            brake = "open" if self.engine.image.drive.brake_open else "closed"
            where = f" at {math.degrees(self.axis.pos_act_rad):.3f} deg" if failure is None else ""
            self.events.put("service", f"controller ended{where}, brake {brake}, torque off")
            self.memory.words[Word.CONTROLLER_CLEAN] = failure is None

    # --- odds and ends ----------------------------------------------------------------------------

    def _say_hello(self) -> None:
        """Start in the journal, and how the run before ended when nobody closed it."""
        before, age_ms = Snapshot(self.memory).fast()
        if before and not self.memory.words[Word.CONTROLLER_CLEAN]:
            text = (
                f"SYS-05 INFO · the previous run of the controller was not shut down; {age_ms * 1e-3:.1f} s ago it "
                f"was at {before['pos_act_deg']} deg with {before['vel_act_deg_s']} deg/s"
            )
            self.events.put("alarm", text)
        self.memory.words[Word.CONTROLLER_CLEAN] = 0
        self.events.put("service", f"controller started: {self.machine.name}", hash=short_hash(self.machine))
        for note in self.notes:
            self.events.put("service", note)

    def _metadata(self) -> dict[str, object]:
        return {
            "columns": list(self._recorder.columns),
            "metadata": {
                "machine": self.machine.name,
                "config_hash": short_hash(self.machine),
                "version": version("gantryctl"),
                "period_s": self.engine.period_s,
            },
        }

    def _journal_keeps(self) -> bool:
        words = self.memory.words
        alive = time.monotonic_ns() - words[Word.RECORDER_NS] < RECORDER_S * 1e9
        return alive and words[Word.JOURNAL_STATE] in (0, 1)

    def _locked(self) -> bool:
        """Whether a reset now meets something locked."""
        log = self.axis.alarms
        return (
            self.memory.words[Word.JOURNAL_STATE] == _JOURNAL_LOCKED
            or self._held_by_locked()
            or not self.axis.feedback.position_valid
            or any(alarm.definition.lock for alarm in log.active.values())
        )

    def _held_by_locked(self) -> bool:
        """A locked alarm of an earlier run that nobody has acknowledged."""
        return bool(self.operator.rules.held) and self.retainer.retained.error_stop in LOCKED

    def _reset(self, who: Identity, service: bool) -> str:
        """What a reset acknowledges beside the program's alarms."""
        words, rules = self.memory.words, self.operator.rules
        self._reset_asked = True
        if words[Word.JOURNAL_STATE] == _JOURNAL_LOCKED and service:
            self.events.put("journal", f"the damaged journal was acknowledged by {who.user}", who)
        if rules.lock:
            raise MessageRefused(rules.lock.partition(" ")[0], rules.lock)
        if not rules.held:
            return ""
        if self._held_by_locked() and not service:
            code = self.retainer.retained.error_stop
            raise MessageRefused("CTL-14", f"{code} ({rules.held}) may be reset by the service role only")
        said, rules.held = rules.held, ""
        self.retainer.retained = replace(self.retainer.retained, error_stop="")
        self.engine.overrun_stop = None
        self.events.put("command", f"acknowledged: {said}", who)
        return said

    def _set_up_again(self) -> None:
        """A reset of a lost drive: with power off it is set up again before the program looks at it."""
        if self.axis.power.phase is not PowerPhase.OFF:
            return
        try:
            if not set_up_again(self.engine):
                return
        except GantryctlError as fault:
            self.events.put("service", f"the drive could not be set up again: {fault}")
            return
        self.events.put("service", "the drive was set up again")
        rules = self.operator.rules
        if not rules.lock or rules.lock.startswith(BUS):  # what is wrong with the encoder stays
            rules.lock = bus_refusal(self.machine, self._store, self._drive)


_JOURNAL_LOCKED: Final = 4


def main(arguments: list[str]) -> int:
    """Entry point of the process."""
    handle, config, wanted, options = int(arguments[0]), Path(arguments[1]), arguments[2], arguments[3:]
    die_with_parent()
    memory = SharedMemory(handle)
    machine = load_machine(config)
    if config_hash(machine) != wanted:
        raise ConfigError([f"{config}: has changed since the service was started; start the service anew"])
    with StateStore(machine) as store:
        controller = Controller(machine, store, memory, second_person=SECOND_PERSON in options)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, lambda *_: controller.end())
        controller.real_time = prepare_scan_process()
        return controller.run()
