"""The quick stop that motor and reducer give on every plant of the uncertain set, and the speed that it permits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from gantryctl.engineering.batch import expected, grouped
from gantryctl.engineering.stops.run import (
    SPEED_PARTS,
    StopCase,
    StopClass,
    StopResult,
    within_ratings,
    worst_of,
    worst_stops,
)
from gantryctl.engineering.stops.uncertain import Factors, UncertainPlant, corners, drawn, plants
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import REACTION_S

# Steps of the search, of the power of ten below the configured value: 0.1 deg/s2 for 5.4.
_RESOLUTION: Final = 0.1
_FEWEST_STEPS, _MOST_STEPS = 2, 400
# Of the highest setting: 0.1 deg/s for 6.
_SPEED_RESOLUTION: Final = 1.0 / 60.0
# Of the load's inertia.
_INERTIA_RESOLUTION: Final = 0.001
RANDOM_PLANTS: Final = 32


class Certificate(NamedTuple):
    """A quick stop that is within the ratings on every plant of a set.

    Attributes:
        dec_deg_s2: largest such deceleration; speed_deg_s: highest speed from which it keeps the permitted angle.
        worst: each figure the worst of all stops from that speed and below. hardest_motor, hardest_reducer: whose.
        plants, stops: how many were simulated with that deceleration.
    """

    dec_deg_s2: float
    speed_deg_s: float
    worst: StopResult
    hardest_motor: Factors
    hardest_reducer: Factors
    plants: int
    stops: int


class QuickStops(NamedTuple):
    """What `stops --find-quick` finds.

    Attributes:
        nominal_deg_s2: largest deceleration on the plant of the file.
        identified_ratio: how much heavier the load may be for the quick stop of the file (`heaviest_ratio`).
        certificate: over the whole of [plant.uncertainty]. inertia_alone: with the heaviest load of its band and all
            else as in the file; None for a band of no width.
    """

    nominal_deg_s2: float
    identified_ratio: float
    certificate: Certificate
    inertia_alone: Certificate | None


def find_quick_stops(machine: Machine, random_plants: int = RANDOM_PLANTS, seed: int = 0) -> QuickStops:
    """Largest quick stop of the file's plant, its inertia band, and what holds on the uncertain plant.

    Raises:
        ConfigError: not even the smallest deceleration is possible, or the bands lead to no plant.
    """
    half = machine.plant.uncertainty.inertia_ratio
    alone = (
        certified_on(machine, list(plants(machine, [Factors(inertia=1.0 + half)]))) if half > 0.0 else None
    )
    return QuickStops(
        largest_dec_deg_s2(machine, list(plants(machine, [Factors()]))),
        heaviest_ratio(machine),
        certify(machine, random_plants, seed),
        alone,
    )


def step_deg_s2(machine: Machine) -> float:
    """Resolution of the search: a tenth of the power of ten below the configured value, 0.1 deg/s2 for 5.4."""
    return _RESOLUTION * 10.0 ** math.floor(math.log10(machine.virtual_axis.quick_dec_deg_s2))


def certify(machine: Machine, random_plants: int = RANDOM_PLANTS, seed: int = 0) -> Certificate:
    """Certify over the corners of [plant.uncertainty] and over plants drawn within it.

    Found on the corners with the heaviest load and the least friction, then tried on all corners and on the drawn
    plants, and lowered step by step until all of them hold it. At every plant: both directions, where the eccentric
    moment of the check is largest either way, from 1/10, 1/2 and the whole of the speed.

    Raises:
        ConfigError: not even the smallest deceleration is possible, or the bands lead to no plant.
    """
    every = corners(machine)
    heavy, slick = max(each.inertia for each in every), min(each.friction for each in every)
    hard = [each for each in every if each.inertia == heavy and each.friction == slick]
    rest = [each for each in every if each not in hard]
    others = [*rest, *drawn(machine, random_plants, seed)]
    return certified_on(machine, list(plants(machine, hard)), list(plants(machine, others)))


def certified_on(
    machine: Machine, bounding: Sequence[UncertainPlant], others: Sequence[UncertainPlant] = ()
) -> Certificate:
    """The same over given plants: the search is made on `bounding`, and confirmed on `others`.

    Raises:
        ConfigError: not even the smallest deceleration is possible.
    """
    resolution, permitted = step_deg_s2(machine), machine.required.stopping_angle_deg
    dec = largest_dec_deg_s2(machine, bounding)
    some = [*bounding, *others]
    while dec > 0.5 * resolution:
        speed = _speed_deg_s(machine, bounding, dec)
        stops = _stops(some, speed, dec)
        worst = worst_of(StopClass.QUICK, speed, stops)
        if within_ratings(machine, worst) and worst.angle_deg + speed * REACTION_S <= permitted:
            return Certificate(
                dec,
                speed,
                worst,
                _hardest(some, stops, "torque_motor_nm"),
                _hardest(some, stops, "torque_reducer_nm"),
                len(some),
                len(some) * len(SPEED_PARTS) * 4,
            )
        dec -= resolution
    raise impossible(machine)


def largest_dec_deg_s2(machine: Machine, some: Sequence[UncertainPlant]) -> float:
    """Largest deceleration that motor and reducer give on all of these plants, from every speed, rounded down.

    Raises:
        ConfigError: not even the smallest is possible.
    """
    resolution = step_deg_s2(machine)

    def possible(steps: int) -> bool:
        found = _stops(some, machine.speed.setting_max_deg_s, steps * resolution)
        return all(within_ratings(machine, stop) for stop in found)

    low, high = _FEWEST_STEPS, _MOST_STEPS
    if not possible(low):
        raise impossible(machine)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if possible(middle) else (low, middle)
    return low * resolution


def _speed_deg_s(machine: Machine, some: Sequence[UncertainPlant], dec_deg_s2: float) -> float:
    """Highest speed from which a stop keeps the permitted angle on all of these plants, rounded down."""
    permitted, top = machine.required.stopping_angle_deg, machine.speed.setting_max_deg_s
    resolution = _SPEED_RESOLUTION * top
    # v^2 / 2a + 60 ms v = A on the rigid body, then down until the full plants keep it.
    rigid = dec_deg_s2 * (math.sqrt(REACTION_S**2 + 2.0 * permitted / dec_deg_s2) - REACTION_S)
    for steps in range(min(round(top / resolution), math.floor(rigid / resolution) + 1), 0, -1):
        speed = steps * resolution
        if all(stop.angle_deg + speed * REACTION_S <= permitted for stop in _stops(some, speed, dec_deg_s2)):
            return speed
    raise impossible(machine)


def _hardest(some: Sequence[UncertainPlant], stops: Sequence[StopResult], figure: str) -> Factors:
    index = max(range(len(stops)), key=lambda k: float(getattr(stops[k], figure)))
    return some[index].factors


def _stops(some: Sequence[UncertainPlant], speed_deg_s: float, dec_deg_s2: float | None) -> list[StopResult]:
    """Each figure the worst of all stops of a plant, per plant."""
    cases = [
        StopCase(plant.machine, StopClass.QUICK, part * speed_deg_s, dec_deg_s2)
        for plant in some
        for part in SPEED_PARTS
    ]
    own = expected(grouped(worst_stops(cases), [len(SPEED_PARTS)] * len(some)))
    return [worst_of(StopClass.QUICK, speed_deg_s, expected(stops)) for stops in own]


def heaviest_ratio(machine: Machine) -> float:
    """How much heavier the load may be for the quick stop of the file, all else as in the file.

    As part of the file's inertia, to 0.1 % below, 1 at most; 0 where the quick stop is not even possible with the
    inertia of the file.
    """

    def possible(steps: int) -> bool:
        try:
            some = list(plants(machine, [Factors(inertia=1.0 + steps * _INERTIA_RESOLUTION)]))
        except ConfigError:
            # The rules of the machine file refuse the rigid body.
            return False
        found = _stops(some, machine.speed.setting_max_deg_s, None)
        return all(within_ratings(machine, stop) for stop in found)

    low, high = 0, round(1.0 / _INERTIA_RESOLUTION) + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if possible(middle) else (low, middle)
    return low * _INERTIA_RESOLUTION


def impossible(machine: Machine) -> ConfigError:
    """No quick stop at all is within the ratings."""
    return ConfigError(
        [
            f"{machine.machine.name}: no quick stop from {machine.speed.setting_max_deg_s:g} deg/s is within "
            f"motor.torque_max_nm = {machine.motor.torque_max_nm:g} N m and reducer.torque_momentary_nm = "
            f"{machine.reducer.torque_momentary_nm:g} N m with the eccentric moment of the check, "
            f"{machine.plant.load.eccentric_check_moment_nm:g} N m; choose a larger motor or reducer"
        ]
    )
