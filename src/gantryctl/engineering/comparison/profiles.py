"""Profiles against each other at equal base motion: how soon the short move is done when the base may shake as much."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

from gantryctl.engineering.batch import expected
from gantryctl.engineering.comparison.key_figures import SHORT_DEG, Move, MoveFigures, moves_figures
from gantryctl.engineering.comparison.variants import without_load_encoder
from gantryctl.machine import Machine, with_values
from gantryctl.machine.places import fitted_stretch_deg

# Of the bisection, between this part of the quick stop and all of it: acceleration to 0.1 %.
_STEPS: Final = 12
_LOWEST_SHARE: Final = 0.02
_ONE: Final = "S-curve, ramps of one swing period"


class ProfileRow(NamedTuple):
    """A profile with the largest acceleration that keeps the permitted base motion.

    Attributes:
        kept: False where wind or gears alone shake the base more, at any acceleration.
    """

    name: str
    acc_deg_s2: float
    jerk_deg_s3: float
    move: MoveFigures
    kept: bool


class _Way(NamedTuple):
    """A machine and its profile; `ramp_s`: how long the acceleration ramps, 0 for a trapezoid."""

    name: str
    machine: Machine
    ramp_s: float


def with_ramps(machine: Machine, acc_deg_s2: float, ramp_s: float) -> Machine:
    """The machine with this acceleration and deceleration, each ramped in `ramp_s`; 0 for a trapezoid."""
    profile: Literal["trapezoid", "jerk_limited"] = "jerk_limited" if ramp_s else "trapezoid"
    release = max(acc_deg_s2, machine.virtual_axis.jog_release_dec_deg_s2)
    changes: dict[str, object] = {
        "virtual_axis.profile": profile,
        "virtual_axis.acc_deg_s2": acc_deg_s2,
        "virtual_axis.dec_deg_s2": acc_deg_s2,
        "virtual_axis.jog_release_dec_deg_s2": release,
    }
    if ramp_s:
        changes["virtual_axis.jerk_deg_s3"] = acc_deg_s2 / ramp_s
    return with_values(machine, changes)


def swing_hz(machine: Machine) -> float:
    """First mode of the load: as identified, else as the machine file expects it."""
    # 2.00 Hz in the linear plant of the reference machine, 1.92 Hz as identified: a wrong value costs little.
    found = machine.calibration.identified.swing_hz if machine.calibration else None
    return machine.control.compensation.first_mode_hz if found is None else found


def profiles_at_equal_base_motion(first: Machine, second: Machine, base_um: float) -> list[ProfileRow]:
    """The short move with `base_um` of base motion, first by profiles alone, then with what the second machine knows.

    Args:
        first: its compensations are those of the trapezoid and of the first S-curve.
        base_um: a ramp of one period of the first mode leaves no swing behind; one of two periods has a second zero
            around it, and half of the jerk.
    """
    period_s = 1.0 / swing_hz(second)
    ways = [
        _Way(f"{first.name}, trapezoid", first, 0.0),
        _Way(f"{first.name}, {_ONE}", first, period_s),
    ]
    if second.control.compensation.load_encoder.active:
        ways.append(
            _Way(f"{second.name} without the load encoder, {_ONE}", without_load_encoder(second), period_s)
        )
    ways += [
        _Way(f"{second.name}, {_ONE}", second, period_s),
        _Way(f"{second.name}, S-curve, ramps of two swing periods", second, 2.0 * period_s),
    ]
    found = _accelerations(ways, base_um)
    moves = _moves(ways, found)
    return [
        ProfileRow(way.name, acc, acc / way.ramp_s if way.ramp_s else 0.0, move, move.base_um <= base_um)
        for way, acc, move in zip(ways, found, moves, strict=True)
    ]


def _accelerations(ways: Sequence[_Way], base_um: float) -> list[float]:
    """Equal base motion, because a faster profile that shakes more is no better one."""
    # A normal ramp is never harder than the quick stop: a rule of the machine file.
    high = [way.machine.virtual_axis.quick_dec_deg_s2 for way in ways]
    low = [_LOWEST_SHARE * each for each in high]
    for _ in range(_STEPS):
        middle = [math.sqrt(a * b) for a, b in zip(low, high, strict=True)]
        for index, move in enumerate(_moves(ways, middle)):
            ends = low if move.base_um <= base_um else high
            ends[index] = middle[index]
    return low


def _moves(ways: Sequence[_Way], acc_deg_s2: Sequence[float]) -> list[MoveFigures]:
    """The short move of each, all at once."""
    ends = fitted_stretch_deg(ways[0].machine, *SHORT_DEG)
    moves = [
        Move(with_ramps(way.machine, acc, way.ramp_s), *ends)
        for way, acc in zip(ways, acc_deg_s2, strict=True)
    ]
    return expected(moves_figures(moves))
