"""Worst case over the uncertain stiffness, damping and inertias of the gantry.

The full linear plant without friction, the loop as it runs. Every case is computed, nothing is
interpolated; the stiffness is a fine grid because gains may be unstable in a band of it only.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray
from gantryctl.engineering.analysis.models.load_side import (
    LoadSideFigures,
    WholeLoop,
    load_side_figures,
    load_side_law,
)
from gantryctl.engineering.analysis.models.margins import crossing_phases_deg, frequency_grid
from gantryctl.engineering.analysis.models.mechanics import (
    Friction,
    Mechanics,
    PlantKind,
    Variation,
    mechanics,
)
from gantryctl.engineering.analysis.models.modes import least_damped
from gantryctl.engineering.analysis.models.paper_loop import two_mass_loop
from gantryctl.engineering.analysis.models.sampled import Cut, LoopSettings, SampledLoop, loop_settings
from gantryctl.machine import Machine
from gantryctl.wiring.simulator import plant_params

_LOWEST_RAD_S: Final = 0.3
_PER_DECADE: Final = 60
# Stiffness of the reference machine below the first knee of its reducer, at the gantry. The uncertainty was estimated
# on it (0.3e9 to 1.2e9 N m/rad) and is the same part of the stiffness of any other machine.
_REFERENCE_NM_PER_RAD: Final = 5.12031263721788e8
STIFFNESS_PARTS: Final = (0.3e9 / _REFERENCE_NM_PER_RAD, 1.2e9 / _REFERENCE_NM_PER_RAD)
# Wider, to show where an instability ends: 1e8 to 4e9 N m/rad on the reference machine.
SEARCHED_PARTS: Final = (1e8 / _REFERENCE_NM_PER_RAD, 4e9 / _REFERENCE_NM_PER_RAD)
# Structural dampings for which bands of stiffness are given.
DAMPINGS: Final = (0.005, 0.01, 0.025)


def stiffness_range(machine: Machine, parts: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest stiffness of the transmission at the gantry, N m/rad, as parts of the machine's own."""
    own = plant_params(machine).stiffness_1_nm_per_rad
    return own * parts[0], own * parts[1]


@dataclass(frozen=True)
class Uncertainty:
    """Ranges of the uncertain plant; inertias as factors on the machine's.

    Attributes:
        stiffness_parts: lowest and highest, of the machine's own; `stiffness_steps` values between them, equal ratios.
        damping_ratio: of the transmission. load_inertia, motor_inertia: factors.
    """

    stiffness_parts: tuple[float, float] = STIFFNESS_PARTS
    # 13 stiffnesses, 2 dampings, 3 load and 2 motor inertias: 156 plants.
    stiffness_steps: int = 13
    damping_ratio: tuple[float, ...] = (0.01, 0.025)
    load_inertia: tuple[float, ...] = (0.8, 1.0, 1.2)
    motor_inertia: tuple[float, ...] = (0.8, 1.2)

    def stiffnesses(self, machine: Machine) -> FloatArray:
        """The grid, N m/rad."""
        return np.geomspace(*stiffness_range(machine, self.stiffness_parts), self.stiffness_steps)


DEFAULT: Final = Uncertainty()


class Case(NamedTuple):
    """One plant and the loop's figures on it.

    Attributes:
        zeta: smallest damping ratio of any swinging pole; negative = unstable. hz: its frequency.
        max_real_rad_s: largest real part of all poles.
        phase_margin_deg: smallest at torque, speed command and speed error; negative = unstable. sensitivity: largest
            of the three.
    """

    variation: Variation
    zeta: float
    hz: float
    max_real_rad_s: float
    phase_margin_deg: float
    sensitivity: float

    @property
    def stable(self) -> bool:
        """Every pole in the left half plane."""
        return self.max_real_rad_s < 0.0


@dataclass(frozen=True)
class RobustMargins:
    """All cases, and the worst of each figure with the plant it belongs to."""

    cases: tuple[Case, ...]

    @property
    def stable(self) -> bool:
        """Stable on every plant."""
        return all(case.stable for case in self.cases)

    @property
    def unstable(self) -> tuple[Case, ...]:
        """The plants on which the loop is unstable."""
        return tuple(case for case in self.cases if not case.stable)

    @property
    def worst_damping(self) -> Case:
        """Smallest damping ratio of a swinging pole."""
        return min(self.cases, key=lambda case: case.zeta)

    @property
    def worst_phase(self) -> Case:
        """Smallest phase margin at any cut."""
        return min(self.cases, key=lambda case: case.phase_margin_deg)

    @property
    def worst_sensitivity(self) -> Case:
        """Largest sensitivity peak at any cut."""
        return max(self.cases, key=lambda case: case.sensitivity)


@dataclass(frozen=True)
class UncertainPlant:
    """One plant of the set, with its response that does not depend on the gains."""

    variation: Variation
    plant: Mechanics
    w_rad_s: FloatArray
    angle: ComplexArray


def uncertain_plants(
    machine: Machine, uncertainty: Uncertainty = DEFAULT, kind: PlantKind = PlantKind.FULL
) -> list[UncertainPlant]:
    """Every combination of the uncertain values.

    Args:
        machine: its base, current loop and timing are taken as they are.
        uncertainty: the set.
        kind: FULL with the rocking base, or TWO_MASS.
    """
    load = machine.plant.load.inertia_kg_m2
    # The paper's Js leaves the wave generator out; the axis turns it all the same.
    motor = machine.motor.inertia_kg_m2 + machine.plant.motor.wave_generator_inertia_kg_m2
    combinations = itertools.product(
        uncertainty.stiffnesses(machine),
        uncertainty.damping_ratio,
        uncertainty.load_inertia,
        uncertainty.motor_inertia,
    )
    settings = loop_settings(machine)
    plants = []
    for k, zeta, load_factor, motor_factor in combinations:
        variation = Variation(float(k), zeta, load * load_factor, motor * motor_factor)
        plant = mechanics(machine, kind, Friction.NONE, variation)
        # the free modes lie high above 0 dB, no margin is decided there
        poles = plant.held_poles()
        w = frequency_grid(_LOWEST_RAD_S, 0.999 * math.pi / settings.cycle_s, poles, _PER_DECADE)
        angle = SampledLoop(plant, settings).angle_per_torque(w)
        plants.append(UncertainPlant(variation, plant, w, angle))
    return plants


def robust_margins(
    machine: Machine,
    uncertainty: Uncertainty = DEFAULT,
    settings: LoopSettings | None = None,
    plants: Sequence[UncertainPlant] | None = None,
) -> RobustMargins:
    """Figures of the loop on every plant of the uncertain set.

    Args:
        machine: see `uncertain_plants`.
        uncertainty: the set.
        settings: other gains than the machine's, for tuning; its timing must be the machine's.
        plants: the set, when it was made before; then `uncertainty` is not used.
    """
    gains = loop_settings(machine) if settings is None else settings
    chosen = uncertain_plants(machine, uncertainty) if plants is None else plants
    return RobustMargins(tuple(margins_on(plant, gains) for plant in chosen))


def margins_on(plant: UncertainPlant, settings: LoopSettings) -> Case:
    """The loop on one plant; poles are exact, margins are interpolated on the plant's grid."""
    loop = SampledLoop(plant.plant, settings)
    worst = least_damped(loop.poles)
    speed, torque = (loop.open_loop(cut, plant.w_rad_s, plant.angle) for cut in (Cut.SPEED_ERROR, Cut.TORQUE))
    # both loops cut at the torque = speed loop + position path; the position path closes around the speed loop
    command = (torque - speed) / (1.0 + speed)
    phase, sensitivity = 180.0, 1.0
    for open_loop in (speed, torque, command):
        phase = min([phase, *np.abs(crossing_phases_deg(open_loop)).tolist()])
        sensitivity = max(sensitivity, float(np.max(1.0 / np.abs(1.0 + open_loop))))
    rightmost = float(loop.poles.real.max())
    return Case(
        plant.variation, worst.zeta, worst.hz, rightmost, phase if rightmost < 0.0 else -phase, sensitivity
    )


# Bands of stiffness, N m/rad, in which a loop is unstable.
Bands = Sequence[tuple[float, float]]


def unstable_stiffness(damping: Callable[[float], float], low: float, high: float) -> Bands:
    """The bands of stiffness, N m/rad, in which the smallest damping ratio is negative; edges by bisection.

    Args:
        damping: stiffness to the smallest damping ratio of the closed loop.
        low, high: range searched.
    """
    # Fine, because gains may fail in a band only: 0.63 to 1.6e9 N m/rad on the two-mass loop with 1 % damping
    # and the paper's gains.
    grid = np.geomspace(low, high, 120)
    values = [damping(float(k)) for k in grid]
    bands: list[tuple[float, float]] = []
    start = low if values[0] < 0.0 else None
    for k in range(1, len(grid)):
        if (values[k] < 0.0) == (values[k - 1] < 0.0):
            continue
        edge = _edge(damping, float(grid[k - 1]), float(grid[k]))
        if start is None:
            start = edge
        else:
            bands.append((start, edge))
            start = None
    return [*bands, (start, high)] if start is not None else bands


def sketch_damping(machine: Machine, damping_ratio: float) -> Callable[[float], float]:
    """Damping of the continuous two-mass sketch (rotor alone, no base) over the stiffness."""

    def damping(stiffness: float) -> float:
        # The sketch of the paper's Js: without the wave generator, continuous, with ideal torque.
        return two_mass_loop(machine, stiffness, damping_ratio).load_mode_zeta

    return damping


def running_damping(
    machine: Machine, damping_ratio: float, settings: LoopSettings | None = None
) -> Callable[[float], float]:
    """Damping of the loop as it runs on the full plant over the stiffness."""
    gains = loop_settings(machine) if settings is None else settings

    def damping(stiffness: float) -> float:
        plant = mechanics(machine, PlantKind.FULL, variation=Variation(stiffness, damping_ratio))
        return least_damped(SampledLoop(plant, gains).poles).zeta

    return damping


def _edge(damping: Callable[[float], float], low: float, high: float) -> float:
    negative = damping(low) < 0.0
    for _ in range(40):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if (damping(middle) < 0.0) == negative else (low, middle)
    return low


def bands_by_damping(
    machine: Machine, model: Callable[[float], Callable[[float], float]]
) -> dict[float, Bands]:
    """Unstable bands of stiffness by structural damping, searched around the stiffness of a machine.

    Args:
        model: structural damping ratio to damping over stiffness, such as `sketch_damping` of one machine.
    """
    low, high = stiffness_range(machine, SEARCHED_PARTS)
    return {zeta: unstable_stiffness(model(zeta), low, high) for zeta in DAMPINGS}


class LoadSideCase(NamedTuple):
    """One plant, and the figures of the whole loop on it."""

    variation: Variation
    figures: LoadSideFigures


class RobustReport(NamedTuple):
    """The worst case with the bands of stiffness in which the gains are unstable, by model and damping.

    Attributes:
        load_side: the whole loop on the same plants; empty where no compensation feeds back.
    """

    margins: RobustMargins
    bands: dict[str, dict[float, Bands]]
    load_side: tuple[LoadSideCase, ...]


def robust_report(machine: Machine) -> RobustReport:
    """The configured gains on the uncertain set and over the stiffness."""
    models = {"two-mass, continuous": sketch_damping, "full, as it runs": running_damping}
    bands = {name: bands_by_damping(machine, partial(model, machine)) for name, model in models.items()}
    plants = uncertain_plants(machine)
    law, settings = load_side_law(machine), loop_settings(machine)
    whole = [
        LoadSideCase(
            plant.variation,
            load_side_figures(WholeLoop(SampledLoop(plant.plant, settings), law), plant.w_rad_s),
        )
        for plant in plants
        if law is not None
    ]
    return RobustReport(robust_margins(machine, plants=plants), bands, tuple(whole))
