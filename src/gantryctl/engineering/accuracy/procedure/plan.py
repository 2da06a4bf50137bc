"""The plan of the accuracy tests on one axis: bases, displacements and speeds.

What the command asks for comes first, then `[accuracy]` of the machine file, then what follows from travel and speed
range, so that the reference machine gets the plan of the paper:

bases          middle of travel, and a quarter of the travel either side: 90, 0, -90 deg of +-180 deg
displacements  four steps of 5 deg, of a twentieth of the travel where that is less: 5, 10, 15, 20 deg
approach       two of these steps, 10 deg: from here on lost motion is taken up before a series begins
speeds         lowest setting, half of the highest, the highest: 0.1, 0.5, 1 r/min of 0.1 to 1 r/min; in place of the
               highest the fastest that a move within 95 % of the travel reaches
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from gantryctl.engineering.accuracy.procedure.procedures import (
    Chord,
    Procedure,
    chord_procedure,
)
from gantryctl.errors import UsageError
from gantryctl.machine import Machine
from gantryctl.machine.places import fitted_stretch_deg
from gantryctl.wiring.program import ramps_deg

STEP_DEG: Final = 5.0
STEPS: Final = 4
# Base, four steps beyond it and the approach keep within 0.45 of the travel on either side of its middle.
_STEP_PART: Final = 1.0 / 20.0
_BASE_PART: Final = 0.25
_ROUNDING: Final = 1.0 + 1e-9
_ROUNDING_DEG: Final = 1e-9
# Of the travel, for the two ramps of the fastest move; the rest is for its cruise.
_RAMPS_PART: Final = 0.95


@dataclass(frozen=True)
class ChordPlan:
    """Where chords are measured, deg.

    Attributes:
        approach_deg: a base is come to from at least this far away.
    """

    bases_deg: tuple[float, ...]
    displacements_deg: tuple[float, ...]
    approach_deg: float

    def procedure(self, name: str, runs: int = 1, chord: Chord = Chord.BASE) -> Procedure:
        """The stops of one of the procedures; the short one, E, takes one displacement out of the plan.

        Raises:
            UsageError: displacements that do not ascend inside 0..180 deg, the same base twice.
        """
        displacements = self.displacements_deg
        if name == "E":
            # 15 of 5, 10, 15, 20 deg: its figures lie nearest to those of the whole test.
            displacements = (displacements[math.ceil(0.75 * len(displacements)) - 1],)
        return chord_procedure(
            name,
            bases_deg=self.bases_deg,
            displacements_deg=displacements,
            runs=runs,
            chord=chord,
            approach_deg=self.approach_deg,
        )


def stretch_to_test_deg(machine: Machine) -> tuple[float, float]:
    """Where a test may go: travel, or the part of it that the axis can reach."""
    return fitted_stretch_deg(machine, machine.axis.pos_min_deg, machine.axis.pos_max_deg)


def chord_plan(
    machine: Machine, bases_deg: Sequence[float] = (), displacements_deg: Sequence[float] = ()
) -> ChordPlan:
    """The plan of a chord test: what a person gives here, else by the machine file, else from the travel."""
    given, (low, high) = machine.accuracy, stretch_to_test_deg(machine)
    travel, middle = high - low, 0.5 * (low + high)
    step = min(STEP_DEG, _STEP_PART * travel)
    bases = tuple(middle + part * travel for part in (_BASE_PART, 0.0, -_BASE_PART))
    steps = tuple(step * k for k in range(1, STEPS + 1))
    return ChordPlan(
        tuple(map(machine.axis.meant_deg, bases_deg)) or given.bases_deg or bases,
        tuple(displacements_deg) or given.displacements_deg or steps,
        2.0 * step,
    )


def check_travel(machine: Machine, procedure: Procedure) -> None:
    """Refuse a procedure that leaves the travel of the axis, and name what would fit.

    Raises:
        UsageError: a stop lies outside.
    """
    low, high = procedure.travel_deg
    bases, (least, most) = procedure.bases_deg, stretch_to_test_deg(machine)
    if least - _ROUNDING_DEG <= low and high <= most + _ROUNDING_DEG:
        return
    first, last = least + min(bases) - low, most - (high - max(bases))
    room = min(most - max(bases), min(bases) - least)
    fits = [
        f"bases from {machine.axis.dial.span(first, last)} deg" if first <= last else "",
        f"displacements up to {room:g} deg from these bases" if room > 0.0 else "",
    ]
    dial = machine.axis.dial
    raise UsageError(
        f"procedure {procedure.name} from {', '.join(map(dial.text, bases))} deg goes from {dial.span(low, high)} deg, "
        f"the axis reaches {dial.span(least, most)} deg; what fits: "
        f"{', or '.join(filter(None, fits)) or 'smaller displacements'}; without any, the plan follows the travel"
    )


def chord_test(
    machine: Machine,
    name: str = "A",
    *,
    runs: int = 1,
    chord: Chord = Chord.BASE,
    bases_deg: Sequence[float] = (),
    displacements_deg: Sequence[float] = (),
) -> Procedure:
    """The chord test of a machine, by the plan of `chord_plan`.

    Raises:
        UsageError: the axis cannot do it.
    """
    procedure = chord_plan(machine, bases_deg, displacements_deg).procedure(name, runs, chord)
    check_travel(machine, procedure)
    return procedure


def speeds_to_test(machine: Machine, speeds_deg_s: Sequence[float] = ()) -> tuple[float, ...]:
    """Speeds of the speed test, deg/s: what is given here, else by the machine file, else from its speed range.

    Raises:
        UsageError: a speed that the axis cannot have.
    """
    given = tuple(speeds_deg_s) or machine.accuracy.speeds_deg_s
    lowest = machine.speed.setting_min_deg_s
    highest = max(lowest, fastest_within(machine))
    speeds = given or tuple(dict.fromkeys((lowest, max(lowest, 0.5 * highest), highest)))
    for speed in speeds:
        _check_speed(machine, speed)
    return speeds


def fastest_within(machine: Machine) -> float:
    """Highest setting, or the fastest that is reached within most of the travel, deg/s, to three digits."""
    top, (least, most) = machine.speed.setting_max_deg_s, stretch_to_test_deg(machine)
    way = _RAMPS_PART * (most - least)
    if ramps_deg(machine, top) <= way:
        return top
    low, high = 0.0, top
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if ramps_deg(machine, middle) <= way else (low, middle)
    unit = 10.0 ** (math.floor(math.log10(low)) - 2)
    return unit * math.floor(low / unit)


def _check_speed(machine: Machine, speed_deg_s: float) -> None:
    speed, (least, most) = machine.speed, stretch_to_test_deg(machine)
    # 0.1 r/min are 0.6000000000000001 deg/s.
    if not speed.setting_min_deg_s / _ROUNDING <= speed_deg_s <= speed.setting_max_deg_s * _ROUNDING:
        raise UsageError(
            f"speed {speed_deg_s:g} deg/s: the setting goes from {speed.setting_min_deg_s:g} to "
            f"{speed.setting_max_deg_s:g} deg/s"
        )
    # The paper's 0.393 deg/s2 takes 45.8 deg to reach 6 deg/s and as much to leave it: the moves of the chord
    # test peak at 1.4 to 2.8 deg/s, so the speed test is a test of its own.
    ramps, travel = ramps_deg(machine, speed_deg_s), most - least
    if not ramps < travel:
        raise UsageError(
            f"speed {speed_deg_s:g} deg/s needs {ramps:.1f} deg to be reached and left again, the travel is "
            f"{travel:g} deg: {fastest_within(machine):g} deg/s fits, or raise [virtual_axis] acc_deg_s2 and dec_deg_s2"
        )
