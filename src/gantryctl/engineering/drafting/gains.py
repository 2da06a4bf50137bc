"""Gains of a draft: a first set from inertia, encoder and first mode, then the stiffest near it with margins.

The search is coarse and takes half a second: `gantryctl tune` goes on from it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final, NamedTuple

from gantryctl.engineering.analysis.models.modes import Oscillation
from gantryctl.engineering.analysis.models.robust import (
    UncertainPlant,
    Uncertainty,
    margins_on,
    uncertain_plants,
)
from gantryctl.engineering.analysis.models.sampled import LoopSettings, loop_settings
from gantryctl.engineering.drafting.basis import Basis
from gantryctl.machine import Machine

# Dead times of a servo drive together: current loop, one and a half cycles, filter of the speed. The speed loop is an
# amplitude optimum on them, Kvp = J / 2 T (Leonhard, Control of Electrical Drives, 2001, section 7.1).
DEAD_TIME_S: Final = 1.5e-3
TVI_LEAST_S: Final = 0.01
# One step of the encoder makes at most this part of the rated torque, as `tune --method margins` demands.
STEP_TORQUE: Final = 0.01
# The position loop is so much slower than the speed loop on load and rotor, and than the first mode.
CASCADE: Final = 4.0
MODE: Final = 0.8
# Conditions on every plant of the set, as those of `tune --method margins`: largest sensitivity, part of the damping of
# the first mode that the loop leaves.
SENSITIVITY: Final = 1.7
DAMPING_LEFT: Final = 0.8
# The set: stiffness of the transmission and inertia of the load, as factors.
_STIFFNESS: Final = (0.7, 1.4)
_INERTIA: Final = (0.8, 1.2)
# A load that stands stiffly behind a small rotor bears more than the rotor alone would.
_KVP: Final = (5.6, 4.0, 2.8, 2.0, 1.4, 1.0, 0.7, 0.5, 0.35, 0.25, 0.17)
_TVI: Final = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)
_KPP: Final = (2.0, 1.4, 1.0, 0.8, 0.6, 0.45, 0.33, 0.25, 0.18, 0.12)


class DraftGains(NamedTuple):
    """Gains of both loops.

    Attributes:
        sensitivity: its peak on the worst plant of the set; inf before a search.
    """

    kvp_nm_s_per_rad: float
    tvi_s: float
    kpp_per_s: float
    sensitivity: float = math.inf


def first_gains(basis: Basis) -> DraftGains:
    """By rule: Kvp from rotor and encoder, Kpp from speed loop and first mode, Tvi so that damping is left."""
    by_inertia = basis.train.fast_inertia_kg_m2 / (2.0 * DEAD_TIME_S)
    kvp = min(by_inertia, highest_kvp(basis))
    kpp = highest_kpp(basis, kvp)
    # P and PI take damping from a swing below sqrt(Kpp / Tvi).
    return DraftGains(kvp, max(TVI_LEAST_S, kpp / basis.mode_rad_s**2), kpp)


def highest_kvp(basis: Basis) -> float:
    """Kvp at which one step of the encoder makes 1 % of the rated torque."""
    return STEP_TORQUE * basis.motor.motor.torque_rated_nm * basis.cycle_s / basis.fine_count_rad


def highest_kpp(basis: Basis, kvp_nm_s_per_rad: float) -> float:
    """A quarter of the speed loop's bandwidth on load and rotor, and 0.8 of the first mode."""
    return min(kvp_nm_s_per_rad / (CASCADE * basis.train.inertia_kg_m2), MODE * basis.mode_rad_s)


def settled_gains(machine: Machine, basis: Basis, first: DraftGains) -> DraftGains:
    """The stiffest gains near the first ones, by Kvp Kpp / Tvi, that keep the conditions on every plant of the set.

    Where none does, those with the smallest peak of the sensitivity.
    """
    damping = machine.plant.transmission.damping_ratio
    uncertainty = Uncertainty(
        stiffness_parts=_STIFFNESS,
        stiffness_steps=3,
        damping_ratio=(damping,),
        load_inertia=_INERTIA,
        motor_inertia=(1.0,),
    )
    plants = uncertain_plants(machine, uncertainty)
    settings = loop_settings(machine)
    softest = first
    for gains in _candidates(basis, first):
        judged = _judged(gains, plants, settings)
        if judged.sensitivity <= SENSITIVITY:
            return judged
        softest = min(softest, judged, key=lambda g: g.sensitivity)
    return softest


def _candidates(basis: Basis, first: DraftGains) -> Iterator[DraftGains]:
    """Gains around the first ones and within their limits, the stiffest first."""
    most = highest_kvp(basis)
    grid = set()
    for a, b, c in itertools.product(_KVP, _TVI, _KPP):
        kvp = min(a * first.kvp_nm_s_per_rad, most)
        kpp = min(c * first.kpp_per_s, highest_kpp(basis, kvp))
        grid.add(DraftGains(kvp, max(TVI_LEAST_S, b * first.tvi_s), kpp))
    return iter(sorted(grid, key=lambda g: (-g.kvp_nm_s_per_rad * g.kpp_per_s / g.tvi_s, g)))


def _judged(gains: DraftGains, plants: list[UncertainPlant], settings: LoopSettings) -> DraftGains:
    """The gains with their worst sensitivity; inf where one plant is unstable or loses its damping."""
    tried = replace(
        settings,
        kvp_nm_s_per_rad=gains.kvp_nm_s_per_rad,
        tvi_s=gains.tvi_s,
        kpp_per_s=gains.kpp_per_s,
    )
    worst = 0.0
    for plant in plants:
        case = margins_on(plant, tried)
        own = Oscillation.of(complex(plant.plant.held_poles()[0])).zeta
        if not (case.stable and case.zeta >= DAMPING_LEFT * own):
            return gains
        worst = max(worst, case.sensitivity)
        if worst > 2.0 * SENSITIVITY:
            break
    return gains._replace(sensitivity=worst)
