"""The way from a fault in motion to rest against the limit of its class, also where faults come together.

The oracle counts the way of a stop from what it knows to act at once, else from the alarm. Here it counts from the
injection, by the limit of the row (`faults.limits`), for rows that are seen in motion at once. Where the scenario has
several faults the slowest of their classes holds, each from where it begins:

- a second fault within the stop of the first: the way until then, and the limit of the second at
  the speed that is left;
- a brake that comes late: its delay times the speed more;
- a brake with a part of its torque: the way of the brake grows as that part becomes smaller, so the
  limit divided by it;
- a quick stop without torque: the limit of torque off, from the time in which the ramp is seen to be left;
- no limit at all where nothing can keep one: a brake without torque, a load beyond what the axis was checked with, a
  drive that obeys nothing.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Final

import numpy as np

from gantryctl.engineering.fault_campaign.machines import base_machine, base_of
from gantryctl.engineering.fault_campaign.scenario import PlannedFault, Scenario
from gantryctl.engineering.faults.case import FaultCase, Phase, ReactionClass, SeenBy
from gantryctl.engineering.faults.limits import (
    goes_by_itself_s,
    held_up_deg,
    limit_deg,
    reaction_of,
    unreached,
)
from gantryctl.engineering.faults.oracle.tell import effect_of
from gantryctl.machine import Machine

_CLASSES: Final = frozenset(
    {
        ReactionClass.QUICK_STOP, ReactionClass.DRIVE_DEADLINE, ReactionClass.TORQUE_OFF, ReactionClass.FEEDBACK,
        ReactionClass.HALT,
    }
)  # fmt: skip
# Parts of the highest speed: ways of slower motions are within what standstill permits (0.6 deg/s of the reference
# gantry); and what the oracle calls rest too (0.05 deg/s), for so long, s.
_LEAST_PART: Final = 10.0
_REST_PART: Final = 120.0
_RESTS_S: Final = 0.2
# s: what lasts less may be over before it is believed.
_LASTS_S: Final = 0.5
# A stop from no speed at all has no simulation.
_GRID_DEG_S: Final = (0.01, 0.6, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
_LONGEST_S: Final = 4.0
_UNBOUNDED: Final = frozenset({"B3", "B7", "C2", "C3", "C4", "D3"})
_TORQUE_OFF: Final = frozenset({ReactionClass.TORQUE_OFF, ReactionClass.FEEDBACK})
_WITHOUT_TORQUE: Final = frozenset({"B8", "C7", "D7", "D13"})


def seen_in_motion(case: FaultCase) -> bool:
    """A row that a moving axis sees at once, so that its way counts from the injection."""
    return case.phase is Phase.CRUISE and case.reaction in _CLASSES and not case.from_deviation


def _spoils(case: FaultCase) -> bool:
    effects = [effect_of(each) for each in case.injections]
    return any(effect.feedback and effect.at_once for effect in effects)


def _on_the_way(case: FaultCase) -> FaultCase | None:
    """The row as an axis meets it that comes to rest already; None where it changes nothing of the way.

    What spoils the reading there is no fault at standstill, whatever phase its own row is run in.
    """
    in_a_stop = case.phase is Phase.QUICK_STOP and case.reaction in _CLASSES
    if in_a_stop or seen_in_motion(case):
        return case
    return replace(case, reaction=ReactionClass.FEEDBACK, seen_by=SeenBy.CLASS) if _spoils(case) else None


@functools.lru_cache(maxsize=1024)
def _grid(machine: Machine, reaction: ReactionClass, seen_by: SeenBy) -> tuple[float, ...]:
    return tuple(limit_deg(machine, reaction, speed, seen_by) for speed in _GRID_DEG_S)


class Way:
    """The way of one stop, from the first fault that a moving axis sees.

    Args:
        machine: with the plant of the scenario.
        before: faults that had begun before.
    """

    def __init__(
        self, scenario: Scenario, machine: Machine, before: list[PlannedFault], fault: PlannedFault, time_s: float,
        angle_deg: float, speed_deg_s: float,
    ) -> None:  # fmt: skip
        self._scenario, self._machine = scenario, machine
        self._faults = [*before, fault]
        self.number, self._begin_s, self._from_deg = fault.number, time_s, angle_deg
        self.way_deg = 0.0
        self._parts: list[tuple[FaultCase, float, float]] = [(self._met(fault), 0.0, speed_deg_s)]
        self._rested_s: float | None = None
        self._asked_deg_s = speed_deg_s
        self.bounded = not any(each.number in _UNBOUNDED for each in self._faults)
        self._rest_deg_s = machine.speed.setting_max_deg_s / _REST_PART

    def _met(self, fault: PlannedFault) -> FaultCase:
        return replace(fault.case, reaction=reaction_of(self._machine, fault.case, fault.injections()))

    def also(self, fault: PlannedFault, speed_deg_s: float) -> None:
        """Another fault begins on the way."""
        self._faults.append(fault)
        self.bounded = self.bounded and fault.number not in _UNBOUNDED
        case = _on_the_way(self._met(fault))
        if case is not None:
            self._parts.append((case, self.way_deg, speed_deg_s))

    def asked(self, speed_deg_s: float) -> None:
        """Nobody has seen the fault yet: the motion that people asked for goes on, and its stop begins at its speed.

        Args:
            speed_deg_s: of the set-point.
        """
        if speed_deg_s > self._asked_deg_s:
            self._asked_deg_s = speed_deg_s
            self._parts = [(case, way, max(speed, speed_deg_s)) for case, way, speed in self._parts]

    def goes_on(self, time_s: float, angle_deg: float, speed_deg_s: float) -> bool:
        """After a scan; False when the axis has come to rest, or the time is over."""
        self.way_deg = max(self.way_deg, abs(angle_deg - self._from_deg))
        if abs(speed_deg_s) > self._rest_deg_s:
            self._rested_s = None
        elif self._rested_s is None:
            self._rested_s = time_s
        rests = self._rested_s is not None and time_s - self._rested_s >= _RESTS_S
        return not rests and time_s - self._begin_s < _LONGEST_S

    def limit(self) -> float:
        """Permitted way, deg: by the plant of the machine file, or if that is passed by the plant of the scenario.

        Of a drawn axis nearly every scenario has its own: a table of its ways would be asked once.
        """
        base, known = base_of(self._scenario), 0.0
        if not self._scenario.template:
            known = max(
                way + self._weakened(_between(base, case, speed), speed) for case, way, speed in self._parts
            )
            if self.way_deg <= known:
                return known
        own = max(
            way + self._weakened(self._of_class(self._machine, case, speed), speed)
            for case, way, speed in self._parts
        )
        return max(known, own)

    def _of_class(self, machine: Machine, case: FaultCase, speed: float) -> float:
        limit = limit_deg(machine, case.reaction, max(speed, _GRID_DEG_S[0]), case.seen_by)
        if any(each.kind == "readings_late" for each in case.injections):
            # No fault of the drive's own loop: a gap of telegrams is a quick stop.
            limit = max(limit, limit_deg(machine, ReactionClass.QUICK_STOP, max(speed, _GRID_DEG_S[0])))
        if self._no_torque:
            limit = max(limit, limit_deg(machine, ReactionClass.TORQUE_OFF, speed, SeenBy.RAMP))
        return limit

    @property
    def _no_torque(self) -> bool:
        return any(each.number in _WITHOUT_TORQUE for each in self._faults)

    @property
    def _spoilt(self) -> bool:
        """The reading is in doubt, or what the drive does with it, from now on."""
        return any(_spoils(each.case) for each in self._faults)

    def _weakened(self, limit: float, speed_deg_s: float) -> float:
        if self._no_torque:
            limit = max(limit, self._without_ramp(speed_deg_s))
        for each in self._faults:
            for injection in each.injections():
                if injection.kind == "slow":
                    limit += injection.values["late_s"] * speed_deg_s
                elif injection.kind == "stall":
                    # The drive goes on with its last command; on a bus until its own deadline, which its class has in.
                    late_s = injection.values["late_s"]
                    limit += late_s * speed_deg_s if self._scenario.drive == "sim" else 0.0
                    if self._spoilt:
                        limit = max(limit, held_up_deg(self._machine, speed_deg_s, late_s))
                elif unreached(injection) and self._spoilt:
                    # No torque off arrives: with what its encoder shows the drive goes on until its own deadline has
                    # ended (a yaw drive from 0.112 deg/s, 0.313 deg: E8, then A2).
                    own_s = goes_by_itself_s(self._machine, speed_deg_s)
                    limit = max(limit, held_up_deg(self._machine, speed_deg_s, own_s))
                elif injection.where == "brake" and injection.kind == "torque":
                    share = injection.values["share"]
                    limit = limit / share if share > 0.0 else math.inf
        return limit

    def _without_ramp(self, speed_deg_s: float) -> float:
        if self._scenario.template:
            return limit_deg(base_of(self._scenario), ReactionClass.TORQUE_OFF, speed_deg_s, SeenBy.RAMP)
        base = base_machine("sim", False, "drive", self._scenario.scan_ms)
        return _interpolated(base, ReactionClass.TORQUE_OFF, SeenBy.RAMP, speed_deg_s)


def _between(machine: Machine, case: FaultCase, speed_deg_s: float) -> float:
    return _interpolated(machine, case.reaction, case.seen_by, speed_deg_s)


def _interpolated(machine: Machine, reaction: ReactionClass, seen_by: SeenBy, speed_deg_s: float) -> float:
    """Between speeds the chord: ways grow with the square of the speed, so it lies above them."""
    return float(np.interp(abs(speed_deg_s), _GRID_DEG_S, _grid(machine, reaction, seen_by)))


def begins(fault: PlannedFault, machine: Machine, speed_deg_s: float, wire_deg_s: float) -> bool:
    """The way of this fault is judged: it is seen at once, lasts, and the axis is in a motion that is commanded."""
    lasts = fault.for_s is None or fault.for_s >= _LASTS_S
    least_deg_s = machine.speed.setting_max_deg_s / _LEAST_PART
    return seen_in_motion(fault.case) and lasts and min(abs(speed_deg_s), abs(wire_deg_s)) >= least_deg_s


def carried_deg_s(fault: PlannedFault, motor_deg_s: float, load_deg_s: float) -> float:
    """Speed from which a stop begins: without torque the load carries the motor on.

    Where the drive slows a load that its gear is twisted by, the load is the faster of both (seed 1400 of other axes:
    0.83 deg/s, the motor 0.71).
    """
    motor = abs(motor_deg_s)
    return max(motor, abs(load_deg_s)) if fault.case.reaction in _TORQUE_OFF else motor
