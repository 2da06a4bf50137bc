"""Commissioning as a process of the service, in the controller's place.

`python -m gantryctl.commissioning.in_service HANDLE CONFIG HASH ROOT [--second-person]` runs it. It sets the drive up
without enabling it, runs the steps that people begin, one by one, writes record and report, and leaves: then the
controller has the axis again, however this process ended.
"""

from __future__ import annotations

import signal
import threading
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Final

from gantryctl.commissioning.in_service.board import Board
from gantryctl.commissioning.in_service.desk import Desk
from gantryctl.commissioning.report import write_report
from gantryctl.commissioning.results import Outcome
from gantryctl.commissioning.run import Commissioning, Step
from gantryctl.commissioning.watch import StepStopped, StepWatch
from gantryctl.engineering.report.head import Head, Made
from gantryctl.engineering.report.machine_facts import known_serials, machine_facts
from gantryctl.errors import ConfigError, GantryctlError
from gantryctl.extras import need
from gantryctl.machine import Machine, config_hash, load_machine, short_hash
from gantryctl.operation.store import StateStore
from gantryctl.service.controller.process import SECOND_PERSON
from gantryctl.service.memory.frame_ring import RingFrames
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.memory.snapshot import publish_json
from gantryctl.service.realtime import die_with_parent
from gantryctl.wiring.bus_log import logged_links

# Below the machine's state directory.
FOLDER: Final = "commissioning_report"
_LEAVE_S: Final = 2.0


class Session:
    """One commissioning, from the controller's end to its next start.

    Args:
        store: the machine's state directory, locked.
    """

    def __init__(
        self, machine: Machine, store: StateStore, memory: SharedMemory, *, second_person: bool = False
    ) -> None:
        self._machine, self._store, self._memory = machine, store, memory
        self._board = Board(memory)
        self.desk = Desk(machine, memory, self._board, self._watch, second_person=second_person)
        self._folder = store.directory / FOLDER
        self._folder.mkdir(exist_ok=True)
        self._work = Commissioning(
            machine, store, self._folder, lambda line: None, lambda step: True, by=lambda: self.desk.by
        )

    def _watch(self) -> StepWatch | None:
        return self._work.watch

    def run(self) -> int:
        """Run steps until a person or a signal ends it; the exit code."""
        desk, words = self.desk, self._memory.words
        words[Word.CONTROLLER_CLEAN] = 0
        desk.tell("service", f"commissioning began: {self._machine.name}", hash=short_hash(self._machine))
        publish_json(self._memory.alarms, {"alarms": [], "alarm_history": []})
        listener = threading.Thread(target=desk.run, name="desk", daemon=True)
        listener.start()
        try:
            self._set_up()
            while (step := desk.next_order()) is not None:
                self._do(step)
            self._keep()
            words[Word.CONTROLLER_CLEAN] = 1
            desk.tell("service", "commissioning ended: torque off, brake closed")
        finally:
            desk.close()
            listener.join(_LEAVE_S)
        return 0

    def _set_up(self) -> None:
        """Read the drive and set it up; without it no step can be begun."""
        try:
            self._work.start(again=False)
        except GantryctlError as fault:
            self._board.refuse(self._machine.name, str(fault))
            self.desk.tell("service", f"commissioning: {fault}")
        else:
            self._board.show(self._work)
        self.desk.set_up()

    def _do(self, step: Step) -> None:
        """Run one step and show how it ended."""
        desk = self.desk
        desk.tell_of_step("command", f"step {step.key} began", step=step.key, by=desk.by)
        note = ""
        try:
            result = self._work.do(step, desk.halt)
        except StepStopped as stopped:
            note = str(stopped)
            desk.tell_of_step("command", f"step {step.key}: {stopped}", step=step.key)
        else:
            assert result is not None  # its person has agreed at the page
            text = f"step {step.key} {result.outcome.value}: {result.proof}"
            kind = "alarm" if result.outcome is Outcome.FAILED else "command"
            desk.tell_of_step(kind, text, step=step.key, by=desk.by)
        self._board.show(self._work, note)
        desk.step_ended()

    def _keep(self) -> None:
        """Write the record when all is proven, and the report of what was shown."""
        work = self._work
        if not work.progress.results:
            return
        if work.complete:
            self.desk.tell("service", f"commissioning record: {work.record()}")
        facts = machine_facts(self._machine, known_serials(self._machine, self._store.directory))
        made = Made(
            datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"), version("gantryctl"), "page of gantryctl serve",
            self.desk.by,
        )  # fmt: skip
        head = Head(self._machine.name, facts, made, None, self._machine.required.source)
        page = write_report(work.progress, work.ledger, self._folder, head)
        self.desk.tell("service", f"commissioning report: {page}", hash=work.progress.hash[:16])


def main(arguments: list[str]) -> int:
    """Entry point of the process."""
    handle, config, wanted = int(arguments[0]), Path(arguments[1]), arguments[2]
    root, options = Path(arguments[3]), arguments[4:]
    memory = SharedMemory(handle)
    die_with_parent(memory.words[Word.SUPERVISOR])
    need("matplotlib")
    machine = load_machine(config)
    if config_hash(machine) != wanted:
        raise ConfigError([f"{config}: has changed since the service was started; start the service again"])
    with StateStore(machine, root) as store, logged_links(RingFrames(memory.frames)):
        session = Session(machine, store, memory, second_person=SECOND_PERSON in options)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, lambda *_: session.desk.end("the service ends"))
        return session.run()
