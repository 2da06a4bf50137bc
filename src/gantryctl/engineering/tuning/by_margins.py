"""Gains by margins: as stiff as possible, while on every plant of the uncertain set

- the loop takes no damping away from the load (it leaves at least `damping_left` of the load's own damping),
- the sensitivity peaks at no cut above `sensitivity` (1.7 means at least 7.7 dB of gain and 34 deg of phase margin),
- the position loop is `cascade` times slower than the speed loop on load and rotor: Kpp <= Kvp/(cascade J),
- and one step of the encoder makes at most `step_torque` of the rated torque, else the drive chatters.

"Stiff" is Kvp Kpp/Tvi: how fast torque grows behind an angle that is off. The search runs on the corners of the set; a
plant of the whole set that breaks a condition joins them, until none does.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.analysis.models.mechanics import PlantKind, mechanics
from gantryctl.engineering.analysis.models.robust import (
    UncertainPlant,
    Uncertainty,
    margins_on,
    uncertain_plants,
)
from gantryctl.engineering.report.meter import Watch, nobody
from gantryctl.engineering.tuning.gains import FAST_INERTIA_KG_M2, Gains, configured, settings_with
from gantryctl.engineering.tuning.judge import damping_left
from gantryctl.errors import UsageError
from gantryctl.machine import Machine
from gantryctl.machine.rules.parts import rotor_inertia_kg_m2
from gantryctl.wiring.simulator import drive_params

# The corners first: 3 x 2 x 2 x 2 plants instead of 156 in every step of the search.
_CORNERS: Final = Uncertainty(stiffness_steps=3, load_inertia=(0.8, 1.2))
_LOWEST: Final = Gains(5.0, 0.002, 0.5, 1.0, 0.1)
_HIGHEST: Final = Gains(500.0, 0.4, 50.0, 1.0, 0.1)
_GRID: Final = 7
_STEPS: Final = (1.3, 1.1, 1.03, 1.01)
_ROUNDS: Final = 8
_STARTS: Final = 6
# Gains that are looked at, 740 to 1195 on the delivered machines: for the time that is left.
_USUAL_LOOKS: Final = 1000
Point = tuple[float, float, float]


# They began as 2.0 and 1.0 without the cascade rule: margins were thin, then Kpp ran to the edge of the
# search (docs/explanation/tuning.md).
class Conditions(NamedTuple):
    """Demands on every plant."""

    sensitivity: float = 1.7
    damping_left: float = 0.8
    cascade: float = 4.0
    step_torque: float = 0.01


# The conditions unless a caller states others.
STATED: Final = Conditions()


class Designed(NamedTuple):
    """The result.

    Attributes:
        corners: plants the search ended with. kvp_max: limit by the encoder's step, None without a limit.
    """

    gains: Gains
    corners: int
    kvp_max: float | None


def by_margins(
    machine: Machine,
    conditions: Conditions = STATED,
    plants: Sequence[UncertainPlant] | None = None,
    kvp_highest: float = math.inf,
    watch: Watch = nobody,
) -> Designed:
    """Search the gains of a machine.

    Args:
        machine: its timing, encoder and current loop count; its gains do not.
        conditions: see `Conditions`.
        plants: the whole set, when it was made before.
        kvp_highest: no Kvp above it.
        watch: is told the part that is done, about.

    Raises:
        UsageError: no gains meet the conditions.
    """
    whole = uncertain_plants(machine) if plants is None else list(plants)
    corners = uncertain_plants(machine, _CORNERS)
    kvp_max = _encoder_limit(machine, conditions)
    limits = [kvp for kvp in (kvp_max, kvp_highest) if kvp is not None and math.isfinite(kvp)]
    search = _Search(machine, conditions, corners, min(limits, default=None), watch)
    for _ in range(_ROUNDS):
        gains = search.best()
        bad = [plant for plant in whole if search.excess(gains, [plant]) > 0.0]
        if not bad:
            return Designed(gains, len(search.plants), kvp_max)
        # The plant that breaks a condition most joins the corners, until none does.
        search.plants.append(max(bad, key=lambda plant: search.excess(gains, [plant])))
    raise UsageError(
        "no gains found that hold on the whole uncertain set; ask for less sensitivity or damping"
    )


def _encoder_limit(machine: Machine, conditions: Conditions) -> float | None:
    """Kvp at which one encoder step in a drive cycle makes the permitted share of the rated torque."""
    drive = drive_params(machine)
    if not drive.speed_count_rad:
        return None
    # A drive whose speed is a difference of counts chatters by one step; interpolation lifts the limit.
    return conditions.step_torque * machine.motor.torque_rated_nm * drive.cycle_s / drive.speed_count_rad


class _Search:
    """Pattern search over the logarithms of Kvp, Tvi, Kpp."""

    def __init__(
        self,
        machine: Machine,
        conditions: Conditions,
        plants: list[UncertainPlant],
        kvp_max: float | None,
        watch: Watch,
    ) -> None:
        self._watch, self._looks = watch, 0
        self.machine = machine
        self.conditions = conditions
        self.plants = plants
        self.base = configured(machine)
        self.inertia = float(mechanics(machine, PlantKind.RIGID).inertia[0])
        # A speed loop goes with the rotor that it turns: from 72 ms to 0.7 ms for any of them.
        rotor = round(rotor_inertia_kg_m2(machine) / FAST_INERTIA_KG_M2, 12)
        lowest, highest = rotor * _LOWEST.kvp_nm_s_per_rad, rotor * _HIGHEST.kvp_nm_s_per_rad
        highest = highest if kvp_max is None else min(kvp_max, highest)
        if highest <= lowest:
            raise UsageError(
                f"[drive.speed_loop] feedback: one encoder step makes {conditions.step_torque:.0%} of the rated torque "
                f"already at Kvp = {highest:.3g} N m s/rad; take an interpolated encoder"
            )
        self.highest = (highest, _HIGHEST.tvi_s, _HIGHEST.kpp_per_s)
        self.lowest = (lowest, _LOWEST.tvi_s, _LOWEST.kpp_per_s)

    def best(self) -> Gains:
        """The stiffest gains that meet the conditions on the present plants."""
        axes = [np.geomspace(low, high, _GRID) for low, high in zip(self.lowest, self.highest, strict=True)]
        good = [point for point in itertools.product(*axes) if self.excess(self.gains(point)) <= 0.0]
        if not good:
            raise UsageError("no gains meet the conditions; ask for less sensitivity or damping")
        stiffest = sorted(good, key=lambda p: -self.gains(p).stiffness)[:_STARTS]
        ends = [self._top(start) for start in stiffest]
        return self.final(max(ends, key=lambda p: self.gains(p).stiffness))

    def _top(self, point: Point) -> Point:
        """Climb from one point of the grid with ever smaller steps."""
        for factor in _STEPS:
            point = self._climbed(point, factor)
        return point

    def final(self, point: Point) -> Gains:
        """A point with the digits of a machine file; what was not searched stays as it is."""
        return replace(self.gains(point).rounded(), kvf=self.base.kvf, acc_deg_s2=self.base.acc_deg_s2)

    def gains(self, point: Point) -> Gains:
        """A point as gains."""
        kvp, tvi, kpp = (float(value) for value in point)
        return replace(self.base, kvp_nm_s_per_rad=kvp, tvi_s=tvi, kpp_per_s=kpp)

    def excess(self, gains: Gains, plants: Sequence[UncertainPlant] | None = None) -> float:
        """Miss of the worst condition; at or below 0 all hold."""
        self._looks += 1
        self._watch(min(1.0, self._looks / _USUAL_LOOKS))
        wanted = self.conditions
        settings = settings_with(self.machine, gains)
        fastest = gains.kvp_nm_s_per_rad / (wanted.cascade * self.inertia)
        # The rule of thumb for cascades; with the paper's Kvp it gives Kpp = 10.2 /s, its own value.
        worst = gains.kpp_per_s / fastest - 1.0
        if worst > 0.0:
            return worst
        for plant in self.plants if plants is None else plants:
            case = margins_on(plant, settings)
            if not case.stable:
                return math.inf
            worst = max(
                worst,
                case.sensitivity / wanted.sensitivity - 1.0,
                wanted.damping_left - damping_left(case, plant),
            )
            if worst > 0.0 and plants is None:
                return worst
        return worst

    def _climbed(self, point: Point, factor: float) -> Point:
        """Along every combination of steps, while it gets stiffer and the conditions hold."""
        steps = [s for s in itertools.product((1.0 / factor, 1.0, factor), repeat=3) if s != (1.0, 1.0, 1.0)]
        while True:
            around = [self._moved(point, step) for step in steps]
            here = self.gains(point).stiffness * (1.0 + 1e-9)
            stiffer = sorted(
                (p for p in around if self.gains(p).stiffness > here), key=lambda p: -self.gains(p).stiffness
            )
            better = next((p for p in stiffer if self.excess(self.final(p)) <= 0.0), None)
            if better is None:
                return point
            point = better

    def _moved(self, point: Point, step: Sequence[float]) -> Point:
        kvp, tvi, kpp = (
            min(max(value * factor, low), high)
            for value, factor, low, high in zip(point, step, self.lowest, self.highest, strict=True)
        )
        return kvp, tvi, kpp
