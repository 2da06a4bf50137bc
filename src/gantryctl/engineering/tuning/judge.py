"""Gains on the uncertain plant: stiffness, damping, inertias; and where they are unstable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from gantryctl.engineering.analysis.models.modes import Oscillation
from gantryctl.engineering.analysis.models.robust import (
    Bands,
    Case,
    RobustMargins,
    UncertainPlant,
    bands_by_damping,
    robust_margins,
    running_damping,
    sketch_damping,
    uncertain_plants,
)
from gantryctl.engineering.tuning.gains import Gains, machine_with, settings_with
from gantryctl.machine import Machine

SKETCH, RUNNING = "two masses, continuous", "full plant, as it runs"


@dataclass(frozen=True)
class GainsVerdict:
    """One set of gains on every plant of the uncertain set.

    Attributes:
        bands: by model and structural damping, the stiffnesses at which the gains are unstable, N m/rad.
        damping_left: smallest ratio of the load's damping in the closed loop to that with the motor held; below 1 the
            loop takes damping away, below 0 the swing grows.
        left_on: the plant it belongs to.
    """

    gains: Gains
    margins: RobustMargins
    bands: dict[str, dict[float, Bands]]
    damping_left: float
    left_on: Case

    @property
    def stable(self) -> bool:
        """Stable on every plant of the set."""
        return self.margins.stable


def judge_gains(
    machine: Machine, gains: Gains, plants: Sequence[UncertainPlant] | None = None
) -> GainsVerdict:
    """Judge gains on the uncertain plant.

    Args:
        machine: base, current loop and timing are taken as they are.
        gains: any.
        plants: the set, when it was made before.
    """
    chosen = uncertain_plants(machine) if plants is None else plants
    settings = settings_with(machine, gains)
    margins = robust_margins(machine, settings=settings, plants=chosen)
    # P and PI on the motor take damping from the load's swing below sqrt(Kpp/Tvi); with the paper's gains
    # half of it is left at the stiffness of the machine file, and 18 of the 156 plants are unstable.
    left = [damping_left(case, plant) for case, plant in zip(margins.cases, chosen, strict=True)]
    worst = min(range(len(left)), key=lambda k: left[k])
    # A gantry that did not vibrate with these gains lay outside the bands, by more damping or another
    # stiffness.
    tried = machine_with(machine, gains)
    bands = {
        SKETCH: bands_by_damping(machine, partial(sketch_damping, tried)),
        RUNNING: bands_by_damping(machine, partial(running_damping, machine, settings=settings)),
    }
    return GainsVerdict(gains, margins, bands, left[worst], margins.cases[worst])


def damping_left(case: Case, plant: UncertainPlant) -> float:
    """Damping of the least damped swing in the closed loop over that of the load with the motor held."""
    return case.zeta / Oscillation.of(complex(plant.plant.held_poles()[0])).zeta
