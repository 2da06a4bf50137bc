"""What is demanded of a scenario beyond the oracle: nobody is stopped without a cause, and causes are named."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.engineering.fault_campaign.judging.effects import (
    LOAD_MOVES,
    driven_on,
    loses_telegrams,
    may_come_first,
    nobody_sees_the_brake,
    nothing_holds,
    reaches_nobody,
    shows_no_motion,
    wrong_sign,
)
from gantryctl.engineering.fault_campaign.judging.ways import Way, begins, carried_deg_s
from gantryctl.engineering.fault_campaign.scenario import PlannedFault, Scenario
from gantryctl.engineering.faults.bench import FaultBench
from gantryctl.engineering.faults.case import FaultCase, ReactionClass
from gantryctl.engineering.faults.injection import Injection
from gantryctl.engineering.faults.oracle.axis_oracle import Violation
from gantryctl.program.alarms.codes import Code, Reaction, Severity
from gantryctl.program.alarms.log import Alarm
from gantryctl.program.alarms.words import Words

NUISANCE: Final = "M2"
"""Stopped or warned, and nobody caused it (meta-invariant of the catalogue)."""
NAMED: Final = "INV-7"
# Of the rated torque: a mean of 0.6 over 0.3 s is told, and in gusts the torque of one moment is less.
_HOLDS_MUCH: Final = 0.5
STOPPING: Final = frozenset(
    {
        ReactionClass.QUICK_STOP, ReactionClass.DRIVE_DEADLINE, ReactionClass.TORQUE_OFF, ReactionClass.FEEDBACK,
        ReactionClass.STANDSTILL, ReactionClass.BRAKE_SLIP, ReactionClass.HALT,
    }
)  # fmt: skip


class Judge:
    """Follows one scenario.

    Attributes:
        found: what broke. stops: codes of the alarms that stopped. nuisances: how many nobody caused.
        acted: numbers of the rows that have begun to act.
    """

    def __init__(self, bench: FaultBench, scenario: Scenario) -> None:
        self._bench, self._scenario = bench, scenario
        self.found: list[Violation] = []
        self.stops: list[str] = []
        self.nuisances = 0
        self.acted: list[str] = []
        self._cases: list[FaultCase] = []
        # Which row each injection belongs to: equal injections of two rows act for both.
        self._rows = [(each, fault) for fault in scenario.faults for each in fault.injections()]
        self._quick_stop_asked = any(action.do == "quick_stop" for action in scenario.actions)
        self._told_of_load = self._told_of_torque = self._told_of_lost_drive = False
        self._torque_kept_s = math.inf
        # Until then telegrams that would show what the drive and its load do are lost.
        self._seen_again_s = 0.0
        self._begun: list[PlannedFault] = []
        self._way: Way | None = None
        self._ways: list[Way] = []
        self._deg = bench.machine.axis.ratio * math.pi / 180.0

    def injected(self, each: Injection) -> None:
        """An injection acts now."""
        if loses_telegrams(each):
            lasts_s = math.inf if each.for_s is None else each.for_s
            self._seen_again_s = max(self._seen_again_s, self._bench.time_s + lasts_s)
        for injection, fault in self._rows:
            if injection == each and fault not in self._begun:
                self._begins(fault)

    def _begins(self, fault: PlannedFault) -> None:
        before = list(self._begun)
        self._begun.append(fault)
        self.acted.append(fault.number)
        self._cases.append(fault.case)
        bench = self._bench
        angle, speed = bench.pos_deg, bench.vel_deg_s
        carried = carried_deg_s(fault, speed, bench.vel_load_deg_s)
        if self._way is not None:
            # What the next fault permits hides nothing of the way until now.
            self._within_limit(self._way)
            self._way.also(fault, carried)
        elif bench.axis.alarms.first_out is None:
            wire = bench.engine.output.vel_cmd_rad_s / self._deg
            if begins(fault, bench.machine, speed, wire):
                fastest = max(carried, abs(wire))
                self._way = Way(
                    self._scenario, bench.machine, before, fault, bench.time_s, angle, fastest
                )  # fmt: skip

    def scan(self, pos: float, vel: float) -> None:
        """After each scan: true motor angle and speed, rad and rad/s."""
        way, axis = self._way, self._bench.axis
        if way is not None and axis.alarms.first_out is None:
            way.asked(abs(math.degrees(axis.virtual.vel_ref_rad_s)))
        if way is not None and not way.goes_on(self._bench.time_s, pos / self._deg, vel / self._deg):
            self._way = None
            if way.bounded:
                self._ways.append(way)
                self._within_limit(way)

    def _within_limit(self, way: Way) -> None:
        limit = way.limit()
        if way.bounded and way.way_deg > limit:
            self.found.append(
                Violation(
                    "INV-1",
                    self._bench.time_s,
                    f"{way.number}: {way.way_deg:.3f} deg from the fault to rest, at most {limit:.3f}",
                )
            )

    def alarm(self, alarm: Alarm) -> None:
        """An alarm has come."""
        self._told_of_load = self._told_of_load or alarm.code in LOAD_MOVES
        self._told_of_torque = self._told_of_torque or alarm.code is Code.DRV_03
        self._told_of_lost_drive = self._told_of_lost_drive or alarm.code is Code.CAN_13
        if Words.TORQUE_KEPT in alarm.steps:
            self._torque_kept_s = min(self._torque_kept_s, alarm.time_s)
        stops = alarm.reaction >= Reaction.QUICK_STOP
        if stops and alarm.follows is None:
            self.stops.append(alarm.code.value)
            if not self._caused(alarm.code):
                self.nuisances += not self._stopping
                self._say(alarm, NAMED if self._stopping else NUISANCE, "names nothing that was injected")
        elif alarm.severity is Severity.WARNING and not self._cases and not self._holds_much(alarm.code):
            self._say(alarm, NUISANCE, "a warning, and nothing was injected")

    @property
    def nothing_holds(self) -> bool:
        """Nothing is left that could hold the load, and people have been told, or the reading cannot show it.

        Of a drive that has left the bus no reading counts before a reset.
        """
        can = self._bench.machine.can
        relay = any(can.output_place(name) for name in ("watchdog", "drive_enable"))
        driven = self._told_of_torque and not relay and driven_on(self._cases)
        told = self._told_of_load or self._told_of_lost_drive
        return driven or ((told or self.blind) and nothing_holds(self._cases))

    @property
    def unseen_until_s(self) -> float:
        """Until then nobody could see that the brake does not hold; 0 without such faults.

        Torque that is told to be kept is held on to, whoever sees it. Where the telegrams come again people are told.
        """
        told = self._told_of_load or math.isinf(self._seen_again_s)
        unseen = told and nobody_sees_the_brake(self._cases)
        return min(self._torque_kept_s, self._seen_again_s) if unseen else 0.0

    @property
    def blind(self) -> bool:
        """No reading shows a motion, to anybody."""
        return any(shows_no_motion(case) or reaches_nobody(case) for case in self._cases)

    @property
    def angle_unknowable(self) -> bool:
        """Of a load that nothing holds: the reading stands, or has a wrong sign, which only torque could show."""
        return any(shows_no_motion(case) or wrong_sign(case) for case in self._cases)

    @property
    def _stopping(self) -> bool:
        """A fault that may stop the axis has begun."""
        return any(case.reaction in STOPPING or case.codes for case in self._cases)

    def _holds_much(self, code: Code) -> bool:
        """The plant needs as much torque at standstill as is told: it is heavier, or its wind stronger, than sized."""
        share = abs(self._bench.torque_nm) / self._bench.machine.motor.torque_rated_nm
        return code is Code.CTL_06 and share >= _HOLDS_MUCH

    def _caused(self, code: Code) -> bool:
        if code is Code.INT_06 and self._quick_stop_asked:
            return True
        return any(may_come_first(code, case) for case in self._cases)

    def _say(self, alarm: Alarm, invariant: str, what: str) -> None:
        begun = ", ".join(self.acted) or "nothing"
        self.found.append(
            Violation(invariant, alarm.time_s, f"{alarm.code} {what} (begun: {begun}): {alarm.measured}")
        )

    def way(self) -> tuple[str, float, float]:
        """Row, way and limit, deg, of the only fault; "" and NaN where there are more, or its way is not judged."""
        if len(self._scenario.faults) != 1 or not self._ways:
            return "", math.nan, math.nan
        way = self._ways[0]
        return way.number, way.way_deg, way.limit()

    def end(self) -> list[Violation]:
        """Everything that broke."""
        return self.found
