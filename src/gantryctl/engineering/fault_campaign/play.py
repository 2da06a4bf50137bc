"""One scenario in virtual time: played on the engine and the program of the product, watched by the oracle."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from gantryctl.engineering.fault_campaign.judging.judge import Judge
from gantryctl.engineering.fault_campaign.machines import KEEPS_RAMPS_DEG_S, machine_of
from gantryctl.engineering.fault_campaign.person import changes_of
from gantryctl.engineering.fault_campaign.scenario import Action, Scenario
from gantryctl.engineering.faults.bench import FaultBench, FaultLog
from gantryctl.engineering.faults.case import Phase
from gantryctl.engineering.faults.injection import Injection
from gantryctl.engineering.faults.oracle.axis_oracle import AxisOracle, Violation
from gantryctl.engineering.faults.oracle.excused import EXCUSED
from gantryctl.engineering.faults.oracle.limits import bounds_of, reference_bounds
from gantryctl.engineering.faults.oracle.taps import Oracle, tapped, watching
from gantryctl.engineering.faults.oracle.tell import load_share
from gantryctl.errors import ConfigError, GantryctlError, UsageError
from gantryctl.image import Mode

# time, true motor angle and speed, true load angle and speed, told angle, wire: speed and torque.
_BITS: Final = struct.Struct("<8d4B")
_BROKE: Final = "INV-9"
# What the load may do, which cannot be kept where nothing holds it.
_OF_THE_LOAD: Final = frozenset({"INV-1", "INV-2", "INV-3"})
# Of the torque of the brake. The motor has 385 N m, and a brake of the plants of seeds 380 to 500.
_HOLDABLE_SHARE: Final = 0.75


class Event(NamedTuple):
    """Something that happened, for people."""

    time_s: float
    text: str


@dataclass(slots=True)
class Played:
    """What a scenario led to.

    Attributes:
        refused: why the machine cannot be built; "" for a scenario that ran. unsound: its checks refuse the machine.
        violations: what broke; () when everything held.
        trace_sha256: of the bits of the run.
        stops: codes of the alarms that stopped the axis. nuisances: of them, how many nobody caused.
        fault, way_deg, limit_deg: the way of a fault in motion, where the scenario has one alone; "" for none.
        axis_s: time that was played. log: a row each millisecond, where asked for.
    """

    scenario: Scenario
    refused: str = ""
    unsound: bool = False
    violations: tuple[Violation, ...] = ()
    trace_sha256: str = ""
    stops: tuple[str, ...] = ()
    nuisances: int = 0
    fault: str = ""
    way_deg: float = 0.0
    limit_deg: float = 0.0
    axis_s: float = 0.0
    events: list[Event] = field(default_factory=list)
    onset_s: float | None = None
    log: FaultLog | None = None

    @property
    def ok(self) -> bool:
        """It ran, and nothing broke."""
        return not self.violations


def play(scenario: Scenario, *, record: bool = False) -> Played:
    """Play a scenario; the same one gives the same bits.

    Args:
        record: keep a row of each millisecond from the first fault on.
    """
    played = Played(scenario)
    # A drive on a bus moves its time on while it is opened: the oracle watches from there.
    with tapped(), watching(Oracle()) as oracle:
        try:
            machine = machine_of(scenario)
            oracle.bounds = bounds_of(machine) if scenario.template else reference_bounds(machine)
            bench = FaultBench(machine, Phase.OFF, KEEPS_RAMPS_DEG_S, scenario.angle_deg)
        except (ConfigError, UsageError) as refused:
            played.refused = str(refused).splitlines()[0]
            played.unsound = isinstance(refused, ConfigError)
            return played
        run = _Run(bench, scenario, oracle, played)
        try:
            run.go(record)
        finally:
            bench.close()
    return played


class _Run:
    def __init__(self, bench: FaultBench, scenario: Scenario, oracle: Oracle, played: Played) -> None:
        self._bench, self._scenario, self._oracle, self._played = bench, scenario, oracle, played
        self._judge = Judge(bench, scenario)
        self._alarms = 0
        self._unholdable = False
        self._axis: AxisOracle | None = None

    def go(self, record: bool) -> None:
        bench, scenario = self._bench, self._scenario
        device, plant = bench.device, bench.target.plant
        bench.injected = self._injected
        bench.command(mode=Mode.CONTINUOUS)
        bench.inject(tuple(each for fault in scenario.faults for each in fault.injections()))
        changes = changes_of(scenario.actions)
        digest, pack = hashlib.sha256(), _BITS.pack
        first_s = min((fault.at_s for fault in scenario.faults), default=0.0)
        scans = round(scenario.duration_s / bench.axis.settings.period_s)
        operator, engine, axis, judge = bench.target.operator, bench.engine, bench.axis, self._judge
        at = 0
        begin_s = engine.time_s
        try:
            while engine.time_s - begin_s < scenario.duration_s - 1e-9 and scans > 0:
                now_s = engine.time_s
                while at < len(changes) and changes[at].at_s <= now_s:
                    operator.command = changes[at].on(operator.command)
                    at += 1
                if record and now_s >= first_s - 1.0:
                    bench.record()
                if self._axis is None:
                    self._axis = self._oracle.axes.get(id(plant))
                bench.step()
                request, vel, torque, brake_open = engine.output[:4]
                load, vel_load, pos, vel_true, *_ = device.truth()
                first = axis.alarms.first_out
                digest.update(
                    pack(
                        engine.time_s, pos, vel_true, load, vel_load, axis.pos_act_rad, vel, torque,
                        request.value, brake_open, bench.enabled, first is not None,
                    )
                )  # fmt: skip
                judge.scan(pos, vel_true)
                watched = self._axis
                if watched is not None and watched.known.load_share is not None and not self._unholdable:
                    self._unholdable = load_share(bench.target, pos) > _HOLDABLE_SHARE
                if len(axis.alarms.history) != self._alarms:
                    self._tell_alarms()
        except GantryctlError as stop:
            self._broke(f"the run ended by {type(stop).__name__}: {stop}")
        except (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError) as broke:
            self._broke(f"{type(broke).__name__}: {broke}")
        self._end(digest.hexdigest(), record)

    def _broke(self, text: str) -> None:
        self._judge.found.append(Violation(_BROKE, self._bench.time_s, text))

    def _injected(self, each: Injection) -> None:
        bench = self._bench
        self._played.events.append(Event(bench.time_s, f"fault: {each.text}"))
        self._judge.injected(each)

    def _tell_alarms(self) -> None:
        history = list(self._bench.axis.alarms.history)
        # The history is bounded: a storm of warnings may push old ones out.
        for alarm in history[self._alarms :]:
            self._judge.alarm(alarm)
            self._played.events.append(Event(alarm.time_s, f"alarm: {alarm.text}"))
        self._alarms = len(history)

    def _end(self, sha256: str, record: bool) -> None:
        played, judge = self._played, self._judge
        acted = judge.acted
        excused = {invariant for number in acted for invariant in EXCUSED.get(number, ())}
        if self._unholdable:
            # A load of its own place, and the moving axis has taken it to where neither motor nor brake holds it.
            excused |= {"INV-1", "INV-3"}
        if judge.nothing_holds:
            excused |= _OF_THE_LOAD
            if judge.angle_unknowable:
                excused.add("INV-7")
        seen = [
            each
            for each in self._oracle.violations
            if each.invariant not in excused
            and not (each.invariant in _OF_THE_LOAD and each.time_s <= judge.unseen_until_s)
        ]
        played.violations = tuple(sorted([*seen, *judge.end()], key=lambda each: each.time_s))
        played.trace_sha256 = sha256
        played.stops, played.nuisances = tuple(judge.stops), judge.nuisances
        played.fault, played.way_deg, played.limit_deg = judge.way()
        played.axis_s, played.onset_s = self._bench.time_s, self._bench.onset_s
        played.events += [
            Event(action.at_s, f"operator: {_deed(action)}") for action in self._scenario.actions
        ]
        played.events += [
            Event(each.time_s, f"BROKEN: {each.invariant}: {each.text}") for each in played.violations
        ]
        played.events.sort(key=lambda event: event.time_s)
        if record:
            played.log = self._bench.log()


def _deed(action: Action) -> str:
    given = action.model_dump(exclude_defaults=True, exclude={"at_s", "do"})
    return " ".join([action.do, *(f"{name}={value:g}" for name, value in given.items())])
