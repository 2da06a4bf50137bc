"""The fastest profile of a move under limits of base motion, motor and reducer, and which of them binds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from typing import Final, NamedTuple

from gantryctl.engineering.analysis.models.profiles import trapezoid_time_s
from gantryctl.engineering.batch import expected
from gantryctl.engineering.comparison.key_figures import Move, MoveFigures, moves_figures
from gantryctl.engineering.comparison.profiles import swing_hz, with_ramps
from gantryctl.errors import UsageError
from gantryctl.machine import Machine
from gantryctl.units import deg
from gantryctl.wiring.simulator import plant_params

# Of the bisection, between 0.1 and 1 of the highest acceleration that could be: to 0.5 %, 0.03 s of 90 deg.
_STEPS: Final = 9
_LOWEST_SHARE: Final = 0.1
# A ramp of whole periods of the first mode leaves no swing of it behind, a shorter one takes less time.
RAMP_PERIODS: Final = (0.25, 0.5, 1.0, 2.0)


class Limits(NamedTuple):
    """What a move may ask for; inf for as much as it likes.

    Attributes:
        base_um: base motion, peak to peak. after_um: the same, 0.2 to 2.2 s after the profile.
        motor_nm: at the motor shaft. reducer_knm: at the output of the reducer.
    """

    base_um: float = math.inf
    after_um: float = math.inf
    motor_nm: float = math.inf
    reducer_knm: float = math.inf

    def shares(self, move: MoveFigures) -> dict[str, float]:
        """By name of the limit, how much of it a move takes: 1 is all of it."""
        return {
            "base": move.base_um / self.base_um,
            "after": move.residual_um / self.after_um,
            "motor": move.motor_nm / self.motor_nm,
            "reducer": move.reducer_knm / self.reducer_knm,
        }


class Fastest(NamedTuple):
    """The fastest profile within limits, of those with ramps of one length.

    Attributes:
        move: each figure the worst of the ways there and back.
        binding: name of the limit of which it takes most; `quick stop` where a normal ramp as hard as that is within
            all of them.
        bound_s: `bound_s` of the same move.
    """

    limits: Limits
    acc_deg_s2: float
    ramp_s: float
    move: MoveFigures
    binding: str
    bound_s: float

    @property
    def jerk_deg_s3(self) -> float:
        """Of the profile."""
        return self.acc_deg_s2 / self.ramp_s


class Unkept(NamedTuple):
    """Limits that the slowest profile tried with ramps of one length does not keep.

    Attributes:
        acc_deg_s2: of that profile, a tenth of the highest acceleration that could be.
        name: the limit of which it takes most. share: how many times that limit it takes.
    """

    limits: Limits
    acc_deg_s2: float
    ramp_s: float
    name: str
    share: float


class Search(NamedTuple):
    """Per limits that some profile keeps, a row for each length of ramps that keeps them; and what is not kept."""

    found: list[list[Fastest]]
    unkept: list[Unkept]


def fastest_moves(
    machine: Machine, ends_deg: tuple[float, float], limits: Sequence[Limits], ramps_s: Sequence[float]
) -> Search:
    """Per limits, the fastest profile with ramps of each length; searched on the full plant of the machine file.

    Args:
        ends_deg: the move goes from the first to the second, and back.

    Raises:
        UsageError: none of the limits is kept by a profile with a tenth of the highest acceleration that could be.
    """
    tried = [
        (each, ramp, _LOWEST_SHARE * _highest_deg_s2(machine, each)) for each in limits for ramp in ramps_s
    ]
    slowest = _worst_moves(machine, ends_deg, [acc for _, _, acc in tried], [ramp for _, ramp, _ in tried])
    cases: list[tuple[Limits, float]] = []
    best: list[tuple[float, MoveFigures]] = []
    unkept: list[Unkept] = []
    for (each, ramp, acc), move in zip(tried, slowest, strict=True):
        name, share = _most(each, move)
        if share > 1.0:
            unkept.append(Unkept(each, acc, ramp, name, share))
        else:
            cases.append((each, ramp))
            best.append((acc, move))
    if not cases:
        near = min(unkept, key=lambda each: each.share)
        raise UsageError(
            f"no profile: with {near.acc_deg_s2:.3g} deg/s2 and ramps of {near.ramp_s:.3g} s the move takes "
            f"{near.share:.3g} times the permitted {near.name}; permit more"
        )
    low = [acc for acc, _ in best]
    high = [_highest_deg_s2(machine, each) for each, _ in cases]
    # The end of the range itself is tried first: of a machine that no limit holds.
    middle = list(high)
    for _ in range(_STEPS):
        found = _worst_moves(machine, ends_deg, middle, [ramp for _, ramp in cases])
        for index, move in enumerate(found):
            if _most(cases[index][0], move)[1] <= 1.0:
                low[index], best[index] = middle[index], (middle[index], move)
            else:
                high[index] = middle[index]
        middle = [math.sqrt(a * b) for a, b in zip(low, high, strict=True)]
    rows = [
        Fastest(each, acc, ramp, move, _binding(machine, each, acc, move), bound_s(machine, ends_deg, each.base_um))
        for (each, ramp), (acc, move) in zip(cases, best, strict=True)
    ]  # fmt: skip
    return Search([list(some) for _, some in groupby(rows, key=lambda each: each.limits)], unkept)


def bound_s(machine: Machine, ends_deg: tuple[float, float], base_um: float) -> float:
    """Time that no profile of the move undercuts within a base motion, whatever the gears and the law are.

    The base gives the load its speed: K_b times the mean angle of the base is J_l v over the time to reach v. So a base
    that goes up by b+ and down by b- with b+ + b- = B / R needs J_l v (1/b+ + 1/b-) / K_b for both ramps, least where
    they are equal: a = K_b B / (2 J_l R). Then the fastest move under |r'| <= v and |r''| <= a is a trapezoid.
    """
    way, speed = abs(ends_deg[1] - ends_deg[0]), machine.speed.setting_max_deg_s
    acc = _acc_of_base_deg_s2(machine, base_um)
    return way / speed if math.isinf(acc) else trapezoid_time_s(way, speed, acc)


def _acc_of_base_deg_s2(machine: Machine, base_um: float) -> float:
    """The acceleration and deceleration that a base motion, peak to peak, is just enough for."""
    plant = plant_params(machine)
    if not plant.base:
        return math.inf
    lever = plant.inertia_load_kg_m2 * machine.plant.gear_error.ring_radius_m
    return deg(plant.base_stiffness_nm_per_rad * base_um * 1e-6 / (2.0 * lever))


def _highest_deg_s2(machine: Machine, limits: Limits) -> float:
    # A normal ramp is never harder than the quick stop: a rule of the machine file.
    return min(_acc_of_base_deg_s2(machine, limits.base_um), machine.virtual_axis.quick_dec_deg_s2)


def _most(limits: Limits, move: MoveFigures) -> tuple[str, float]:
    """The limit of which a move takes the largest share, and the share."""
    shares = limits.shares(move)
    name = max(shares, key=lambda each: shares[each])
    return name, shares[name]


def _binding(machine: Machine, limits: Limits, acc_deg_s2: float, move: MoveFigures) -> str:
    at_the_end = acc_deg_s2 == machine.virtual_axis.quick_dec_deg_s2
    return "quick stop" if at_the_end else _most(limits, move)[0]


def _worst_moves(
    machine: Machine, ends_deg: tuple[float, float], acc_deg_s2: Sequence[float], ramps_s: Sequence[float]
) -> list[MoveFigures]:
    """The move with each acceleration and ramp."""
    ways = [with_ramps(machine, acc, ramp) for acc, ramp in zip(acc_deg_s2, ramps_s, strict=True)]
    return _both_ways(ways, ends_deg)


def _both_ways(machines: Sequence[Machine], ends_deg: tuple[float, float]) -> list[MoveFigures]:
    """The move there and back of each, all at once; each figure the worst of both."""
    there, back = ends_deg, ends_deg[::-1]
    found = expected(moves_figures([Move(each, *ends) for each in machines for ends in (there, back)]))
    return [
        MoveFigures(*(max(pair) for pair in zip(*found[k : k + 2], strict=True)))
        for k in range(0, len(found), 2)
    ]


def own_move(machine: Machine, ends_deg: tuple[float, float]) -> MoveFigures:
    """The move with the profile of the file, each figure the worst of both ways."""
    return _both_ways([machine], ends_deg)[0]


def ramps_of(machine: Machine) -> list[float]:
    """Lengths of the ramp that are tried: a quarter, half, one and two periods of the first mode."""
    return [periods / swing_hz(machine) for periods in RAMP_PERIODS]
