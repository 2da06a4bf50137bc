"""Commissioning: its steps in their order, run one by one, their results stored, the record at the end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path
from typing import Final

from gantryctl.commissioning import (
    steps_bus,
    steps_lacks,
    steps_motion,
    steps_power,
    steps_sign,
)
from gantryctl.commissioning.load_side import chord_test
from gantryctl.commissioning.load_side.ring import ring
from gantryctl.commissioning.results import (
    Context,
    InstrumentMaker,
    Outcome,
    Progress,
    StepResult,
    at_most,
    load_progress,
    store_progress,
)
from gantryctl.commissioning.room import sag_deg
from gantryctl.commissioning.stopping import steps_silence
from gantryctl.commissioning.watch import Halt, StepStopped, StepWatch
from gantryctl.drives.canopen.setup.opening import UnusableDrive
from gantryctl.drives.canopen.setup.read_only import ReadOnlyDrive
from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.od.verdicts import ParameterRow
from gantryctl.engineering.accuracy.procedure.on_batch import run_time_s
from gantryctl.engineering.report.meter import Meter
from gantryctl.errors import AlarmStop, CommandRefused, DeviceError, UsageError
from gantryctl.machine import Machine
from gantryctl.machine.places import reach_deg
from gantryctl.operation.bus_log import freeze
from gantryctl.operation.ledger import LedgerRow, Proofs, Standing
from gantryctl.operation.ledger.acceptance import proven_hash
from gantryctl.operation.ledger.judging import known_of_model, speed_max_deg_s, unproven
from gantryctl.operation.ledger.kept_facts import facts_path, load_facts, store_facts
from gantryctl.operation.ledger.limits import RAMP, TORQUE
from gantryctl.operation.ledger.rows import MEASURED
from gantryctl.operation.opening import leave_bus, open_machine
from gantryctl.operation.proofs import (
    CommissioningRecord,
    ledger_reasons,
    read_ledger,
    record_path,
    store_record,
    why_in_fault,
)
from gantryctl.operation.state import operator_name
from gantryctl.operation.store import StateStore, now_text
from gantryctl.wiring.canopen import can_link, canopen_settings

_RESULTS: Final = "commissioning.json"


class Reach(IntEnum):
    """How far a step can move the gantry: a person who has agreed to one need not be asked for less."""

    NOTHING = 0
    # At most 0.05 deg, or 25 deg of the motor.
    STANDSTILL = 1
    # Some 10 deg.
    NEAR = 2
    TRAVEL = 3


@dataclass(frozen=True)
class Step:
    """One step.

    Attributes:
        moves: what could move, and how far, with places for figures of the machine (`could_move`); "" for nothing.
        reach: how far at most.
        lasts_s: time of the axis that it takes, about, for the progress.
        required: without it there is no commissioning record.
        makes_up: key of the ledger row that the step is for; a drive that has an object for it needs no such step.
        by_hand: it waits for a person at the machine, and is run on its own only (`--only`).
    """

    key: str
    title: str
    does: str
    moves: str
    run: Callable[[Context], StepResult]
    reach: Reach = Reach.NOTHING
    lasts_s: Callable[[Machine], float] = lambda machine: 1.0
    required: bool = True
    makes_up: str = ""
    by_hand: bool = False

    def could_move(self, machine: Machine) -> str:
        """What could move on this machine, and how far; "" when nothing can."""
        permitted = {
            "sag": sag_deg(machine), "brake": machine.brake.sag_max_deg, "push": steps_lacks.push_deg(machine)
        }  # fmt: skip
        return self.moves.format(**{name: at_most(deg) for name, deg in permitted.items()})


def _travel_s(machine: Machine) -> float:
    """The slow turn: to one end, to the other, and to the middle."""
    low, high = reach_deg(machine)
    travel_deg = high - low
    speed_deg_s = steps_motion.turn_speed_deg_s(machine)
    # Three moves, each with half a ramp up and half a ramp down more than at constant speed.
    return 2.0 * travel_deg / speed_deg_s + 3.0 * speed_deg_s / machine.virtual_axis.acc_deg_s2


def _chords_s(machine: Machine) -> float:
    """The chord test: every move and dwell."""
    return run_time_s(machine, chord_test.order_of(machine).made())


# What moves nothing comes first, what turns the whole travel last: each step rests on those before it.
# The times are those of the reference gantry with the virtual drive, measured.
STEPS: Final = (
    Step("identity", "Identity", "reads who the drive is and pins it", "", steps_bus.identity),
    Step("encoder", "Absolute reference", "checks the zero offset and the wrap margins before any limit is trusted", "",
         steps_bus.encoder),
    Step("defaults", "Dangerous defaults", "compares the drive as it comes with what it must be", "",
         steps_bus.defaults),
    Step("parameters", "Parameters", "writes the parameters, reads them back, keeps a backup", "",
         steps_bus.parameters),
    Step("pdo", "Process data", "compares telegrams with SDO reads, counts what is missed", "", steps_bus.process_data,
         lasts_s=lambda machine: 2.0),
    Step("sync", "SYNC and dead time", "measures answers to SYNC and scans from command to statusword", "",
         steps_bus.sync, lasts_s=lambda machine: 2.1),
    Step("nodes", "Nodes", "compares telegrams of the nodes beside the drive with SDO reads", "", steps_bus.nodes,
         lasts_s=lambda machine: 2.0),
    Step("wiring", "Wiring by hand", "a person works every input, and looks at every output", "", steps_bus.wiring,
         lasts_s=lambda machine: 60.0, required=False, by_hand=True),
    Step("silence", "Silence", "stops commands, then the heartbeat, each alone, enabled at standstill",
         "the axis may sag by less than {sag} deg when the brake closes", steps_silence.silence, Reach.STANDSTILL,
         lambda machine: 3.0),
    Step("watchdog", "Watchdog", "kills the controller: the watchdog beside the drive takes the torque off",
         "the axis may sag by less than {sag} deg when the brake closes", steps_silence.watchdog, Reach.STANDSTILL,
         lambda machine: 4.0),
    Step("brake", "Brake", "pushes against the closed brake with the proof torque", "less than {brake} deg",
         steps_power.brake, Reach.STANDSTILL, lambda machine: 6.0),
    Step("torque", "Torque limit", "pushes against the closed brake: the limit of the drive maker's tool",
         "less than {push} deg", steps_lacks.torque, Reach.STANDSTILL, lambda machine: 4.0, makes_up=TORQUE),
    Step("sign", "Sign and scale", "a brief speed pulse with the position loop open, torque and speed limits lowered",
         "at most 0.05 deg, or 25 deg of the motor where that is more", steps_sign.sign, Reach.STANDSTILL,
         lambda machine: 3.3),
    Step("velocity", "Velocity step", "a step to creep speed, position loop open", "at most 1 deg",
         steps_power.velocity, Reach.NEAR, lambda machine: 7.0),
    Step("ring", "Ring encoder", "turns both ways, position loop open: the encoder on the ring beside the motor's",
         "1.5 deg forward and back", ring, Reach.NEAR, lambda machine: 15.0),
    Step("ramp", "Quick-stop ramp", "measures the drive's own ramp, from 0.3 deg/s upwards",
         "about 7 deg forward and back", steps_lacks.ramp, Reach.NEAR, lambda machine: 20.0, makes_up=RAMP),
    Step("loop", "Position loop", "closes the position loop: 1 deg forward and back at the lowest speed",
         "1 deg and back", steps_motion.loop, Reach.NEAR, lambda machine: 8.0),
    Step("stops", "Stops", "jog release, quick stop, silence: the angle measured against the computed one",
         "about 10 deg forward and back", steps_motion.stops, Reach.NEAR, lambda machine: 22.0),
    Step("turn", "Slow turn", "one turn each way: eccentric moment and friction", "the whole travel",
         steps_motion.slow_turn, Reach.TRAVEL, _travel_s),
    Step("bands", "Bands", "proposes in-position and following-error bands from what was measured", "",
         steps_motion.bands),
    Step("accuracy", "Accuracy", "the chord test by an instrument at the load", "the whole travel",
         chord_test.accuracy, Reach.TRAVEL, _chords_s, required=False),
)  # fmt: skip


def steps_for(rows: Iterable[LedgerRow]) -> tuple[Step, ...]:
    """The steps of a drive with this ledger."""
    has = {row.what for row in rows if row.standing is Standing.OBJECT}
    return tuple(step for step in STEPS if step.makes_up not in has)


def complete(results: Mapping[str, StepResult], steps: Iterable[Step]) -> bool:
    """True when every required step has passed, or cannot be tested on this machine."""
    return all(
        step.key in results and results[step.key].outcome is not Outcome.FAILED
        for step in steps
        if step.required
    )


def void_control_proofs(machine: Machine, store: StateStore) -> None:
    """Forget what was proven with the drive's control as it was: the record, and each step from `sign` on.

    Args:
        store: locked by the caller.

    Raises:
        StateError: the results of before are damaged.
    """
    record_path(store.directory, machine).unlink(missing_ok=True)
    path = store.directory / _RESULTS
    kept = load_progress(path)
    if kept is not None:
        # Each step rests on those before it, and `sign` is the first that moves by the speed loop.
        before = {step.key for step in STEPS[: [step.key for step in STEPS].index("sign")]}
        results = {key: result for key, result in kept.results.items() if key in before}
        store_progress(path, replace(kept, results=results))


class Commissioning:
    """Commissioning of one machine; resumes where an earlier run in the same configuration ended.

    Args:
        store: locked by the caller.
        folder: for files and the report.
        say: a line for the person who watches.
        confirm: asked before a step that moves further than was agreed to before; False leaves it out.
        instrument: makes the instrument at the load for the chord test; None without one.
        certificate: of its calibration, for the report.
        now_s: clock of the person who watches.
        by: who runs a step, for the results.

    Attributes:
        watch: over the step under way, or the last one.
    """

    def __init__(
        self,
        machine: Machine,
        store: StateStore,
        folder: Path,
        say: Callable[[str], None],
        confirm: Callable[[Step], bool],
        instrument: InstrumentMaker | None = None,
        certificate: str = "",
        now_s: Callable[[], float] = time.monotonic,
        by: Callable[[], str] = operator_name,
    ) -> None:
        if not machine.on_bus:
            raise UsageError(
                f'{machine.name}: [drive] kind = "{machine.drive.kind}"; a CAN machine is commissioned'
            )
        self.machine, self.store, self.folder = machine, store, folder
        self._say, self._confirm, self._now_s = say, confirm, now_s
        self._instrument, self._certificate, self._by = instrument, certificate, by
        self.watch: StepWatch | None = None
        self._agreed = Reach.NOTHING
        self._path = store.directory / _RESULTS
        kept = load_progress(self._path)
        # A change of [axis], [control], [motor], [encoder], [brake], [drive] or [can] begins anew.
        if kept is None or kept.proven_hash != proven_hash(machine):
            kept = Progress(machine.name, proven_hash(machine))
        self.progress = kept
        self.resumed = bool(self.progress.results)
        self._as_found: tuple[ParameterRow, ...] = ()

    @property
    def steps(self) -> tuple[Step, ...]:
        """The steps that this drive needs."""
        return steps_for(self.ledger)

    def left(self, only: str | None = None) -> tuple[Step, ...]:
        """Steps that are left.

        Raises:
            UsageError: there is no such step.
        """
        if only is not None:
            found = tuple(step for step in self.steps if step.key == only)
            if not found:
                raise UsageError(f"--only {only}: the steps are {', '.join(step.key for step in self.steps)}")
            return found
        done = {key for key, result in self.progress.results.items() if result.outcome is not Outcome.FAILED}
        return tuple(step for step in self.steps if step.key not in done and not step.by_hand)

    def start(self, again: bool) -> None:
        """Set the drive up, pin it, and say its ledger; another drive or firmware than before begins from the start.

        Raises:
            CommandRefused: something is lacking that no step will show. DeviceError: the drive cannot be reached.
        """
        link = can_link(self.machine)
        try:
            self._as_found = ReadOnlyDrive(link, canopen_settings(self.machine)).rows
        finally:
            link.close()
        facts, nodes = self._set_up()
        # Proofs belong to one drive: another one has shown nothing yet.
        before = self.progress.drive, self.progress.software, self.progress.nodes
        if again or (before[0] and before != (facts.key, facts.software, nodes)):
            self.progress = Progress(self.machine.name, proven_hash(self.machine))
        self.progress = replace(self.progress, drive=facts.key, software=facts.software, nodes=nodes)
        for line in known_of_model(self.machine, facts):
            self._say(f"  {line}")
        rows = self.ledger
        for row in rows:
            self._say(f"  {row.text}")
        reasons = ledger_reasons(self.machine, rows)
        if reasons:
            raise CommandRefused(" · ".join(reason.text for reason in reasons))

    def _set_up(self) -> tuple[DriveFacts, tuple[str, ...]]:
        """Set the drive up once, which shows what it takes, and who is beside it; nothing is enabled."""
        path = facts_path(self.store.directory, self.machine)
        nodes: tuple[str, ...] = ()
        try:
            drive = open_machine(self.machine, self.store).drive
            health, fault = drive.health(), why_in_fault(drive)
            nodes = () if health is None else health.node_keys
            leave_bus(drive)
            if fault is not None:
                raise CommandRefused(fault.text)
        except UnusableDrive as unusable:
            store_facts(path, unusable.facts)
        facts = load_facts(path)
        # A CAN machine is commissioned: its set-up has kept them.
        assert facts is not None
        return facts, nodes

    def do(self, step: Step, halt: Halt | None = None) -> StepResult | None:
        """Run one step; None when the person declined it.

        Args:
            halt: how a person ends it; None where nobody can.

        Raises:
            StepStopped: a person has. The axis is off, and the results are what they were.
        """
        if step.reach > self._agreed:
            if not self._confirm(step):
                return None
            self._agreed = step.reach
        begun_s = self._now_s()
        halt = halt or Halt()
        self.watch = watch = StepWatch(Meter(self._say, step.lasts_s(self.machine), self._now_s), halt)
        context = Context(
            self.machine,
            self.store,
            self.folder,
            self.progress.results,
            self._as_found,
            self._say,
            watch,
            self._instrument,
            self._certificate,
            speed_max_deg_s(self.ledger),
        )
        try:
            result = step.run(context)
        # A step that stops the axis has failed; the run ends there and goes on with this step.
        except (AlarmStop, CommandRefused, DeviceError) as stopped:
            # What a quick stop by a person leaves behind is an alarm, and no proof that failed.
            if halt.asked():
                raise StepStopped(f"{halt.why} · {stopped}") from stopped
            result = StepResult(
                step.key, Outcome.FAILED, str(stopped), to_do="find the cause, then go on with this step"
            )
        result = self._of_this_drive(result)
        if result.outcome is Outcome.FAILED:
            # What was proven before is not so any more: the machine waits until the step has passed again.
            record_path(self.store.directory, self.machine).unlink(missing_ok=True)
            freeze(self.store.traces, f"step-{step.key}")
        result = replace(
            result,
            seconds=self._now_s() - begun_s,
            axis_s=watch.meter.done,
            at=now_text(),
            by=self._by(),
            pictures=tuple(watch.pictures),
        )
        self.progress = replace(self.progress, results={**self.progress.results, step.key: result})
        store_progress(self._path, self.progress)
        return result

    def _of_this_drive(self, result: StepResult) -> StepResult:
        """The result of a step; a failure where its set-up has found another drive than this commissioning is of."""
        facts = load_facts(facts_path(self.store.directory, self.machine))
        mine = self.progress.drive, self.progress.software
        if facts is None or not mine[0] or (facts.key, facts.software) == mine:
            return result
        proof = (
            f"the drive is now {facts.key}, software {facts.software or '?'}; what was shown before is of "
            f"{mine[0]}, software {mine[1] or '?'}"
        )
        to_do = "begin the commissioning anew: it starts from the first step with another drive"
        return StepResult(result.key, Outcome.FAILED, proof, to_do=to_do)

    @property
    def ledger(self) -> tuple[LedgerRow, ...]:
        """What gives each safety property; of a virtual drive too, which needs no acceptance."""
        results = self.progress.results
        passed = frozenset(key for key, result in results.items() if result.outcome is Outcome.PASSED)
        failed = frozenset(key for key, result in results.items() if result.outcome is Outcome.FAILED)
        proofs = Proofs(passed, failed, self._measured)
        return read_ledger(self.machine, self.store.directory, proofs=proofs)

    @property
    def _measured(self) -> dict[str, float]:
        """Figures of passed steps that the ledger is computed with."""
        return {
            name: result.number(name)
            for result in self.progress.results.values()
            if result.outcome is Outcome.PASSED
            for name in MEASURED
            if name in result.figures
        }

    @property
    def complete(self) -> bool:
        """True when the record can be written."""
        return complete(self.progress.results, self.steps) and not unproven(self.ledger)

    def record(self) -> Path:
        """Write the commissioning record: from now on the machine may move."""
        path = record_path(self.store.directory, self.machine)
        done = tuple(key for key, result in self.progress.results.items() if result.outcome is Outcome.PASSED)
        store_record(
            path,
            CommissioningRecord(
                machine=self.machine.name,
                proven_hash=self.progress.proven_hash,
                drive=self.progress.drive,
                software=self.progress.software,
                nodes=self.progress.nodes,
                date=now_text(),
                by=self._by(),
                report_hash=self.progress.hash,
                steps=done,
                accepted=tuple(row.text for row in self.ledger if row.standing is Standing.ACCEPTED),
                measured=self._measured,
            ),
        )
        return path
