"""The same comparison over random gears and plants: what works on one set of phases only does not count."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from gantryctl.engineering.accuracy.procedure.on_batch import random_gear_values
from gantryctl.engineering.batch import expected
from gantryctl.engineering.comparison.key_figures import (
    KEY_FIGURES,
    KeyFigures,
    figures_of,
    key_columns,
    measure_key_figures,
)
from gantryctl.engineering.comparison.variants import without_load_encoder
from gantryctl.engineering.identification import calibrate_each
from gantryctl.engineering.scheduler.job import Rows
from gantryctl.engineering.scheduler.schedule import all_rows
from gantryctl.errors import UsageError
from gantryctl.machine import Calibration, Machine, with_values
from gantryctl.machine.specs import value_at

SPREAD: Final = 0.2
QUANTILES: Final = (0.05, 0.5, 0.95)
_PLANT: Final = "plant."
_VARIED: Final = (
    "load.inertia_kg_m2", "load.eccentricity_m", "transmission.reducer_stiffness_1_nm_per_rad",
    "transmission.reducer_stiffness_2_nm_per_rad", "transmission.reducer_stiffness_3_nm_per_rad",
    "transmission.rest_stiffness_nm_per_rad", "transmission.damping_ratio", "transmission.hysteresis_torque_nm",
    "transmission.backlash_mm", "roller_friction.coulomb_nm", "roller_friction.breakaway_nm",
    "roller_friction.viscous_nm_s_per_rad", "motor_friction.coulomb_nm", "motor_friction.breakaway_nm",
    "base.inertia_kg_m2", "base.frequency_hz",
)  # fmt: skip
# These move with their partner: a stiffer reducer is stiffer in every slope.
_TOGETHER: Final = {
    "roller_friction.breakaway_nm": "roller_friction.coulomb_nm",
    "motor_friction.breakaway_nm": "motor_friction.coulomb_nm",
    "transmission.reducer_stiffness_2_nm_per_rad": "transmission.reducer_stiffness_1_nm_per_rad",
    "transmission.reducer_stiffness_3_nm_per_rad": "transmission.reducer_stiffness_1_nm_per_rad",
}


@dataclass(frozen=True)
class PlantEnsemble:
    """Figures of many plants.

    Attributes:
        seeds: one per plant. rows: by name of the control, one `KeyFigures` per plant, in the order of the seeds.
    """

    seeds: tuple[int, ...]
    rows: dict[str, tuple[KeyFigures, ...]]

    def quantiles(self, row: str) -> dict[str, tuple[float, float, float]]:
        """5, 50 and 95 % of every figure of a row."""
        values = np.array(self.rows[row])
        # An improvement on one set of phases does not count; quantiles over plants do.
        low, middle, high = np.quantile(values, QUANTILES, axis=0)
        return {name: (float(low[k]), float(middle[k]), float(high[k])) for k, name in enumerate(KEY_FIGURES)}


def random_plant(machine: Machine, seed: int) -> Machine:
    """Another gear of the same grade, and inertia, stiffness, friction, backlash and base within +-20 %."""
    return with_values(machine, random_plant_values(machine, seed))


def random_plant_values(machine: Machine, seed: int, *, edge: bool = False) -> dict[str, object]:
    """Values of `random_plant` by path, for a machine that changes in other things too.

    Args:
        edge: each value is 20 % above or below that of the machine.
    """
    # Another stream than that of the phases: the same seed gives the same gear with and without other values.
    rng = np.random.default_rng([seed, 1])
    factor = {key: float(rng.uniform(1.0 - SPREAD, 1.0 + SPREAD)) for key in _VARIED}
    if edge:
        factor = {key: 1.0 + (SPREAD if value > 1.0 else -SPREAD) for key, value in factor.items()}
    factor |= {key: factor[partner] for key, partner in _TOGETHER.items()}
    changes: dict[str, object] = random_gear_values(seed)
    for key in _VARIED:
        value = value_at(machine, _PLANT + key)
        assert isinstance(value, float)
        changes[_PLANT + key] = value * factor[key]
    return changes


def ensemble(
    paper: Machine,
    improved: Machine,
    count: int,
    *,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> PlantEnsemble:
    """Both ways of control, and the second without its load encoder, on `count` plants; each is identified anew.

    Args:
        seed: plants take `seed + 1`, `seed + 2`, ...
        progress: called with the number of plants that are done.

    Raises:
        UsageError: fewer than 2 plants have no quantiles.
    """
    if count < 2:
        raise UsageError(f"an ensemble of {count}: quantiles need at least 2 plants")
    found = all_rows(EnsembleJob(paper, improved, seed), count, threads, progress)
    return PlantEnsemble(tuple(range(seed + 1, seed + 1 + count)), figures_of(found))


@dataclass(frozen=True)
class EnsembleJob:
    """Key figures of random plants under both ways of control; row k is the plant of `seed + 1 + k`."""

    paper: Machine
    improved: Machine
    seed: int

    # Each control is computed of all plants side by side: two packs of the widest instruction set.
    pack: ClassVar[int] = 16

    def rows(self, first: int, count: int) -> Rows:
        """Columns of `key_columns`, by the name of the control."""
        seeds = [self.seed + 1 + row for row in range(first, first + count)]
        own = [random_plant(self.improved, seed) for seed in seeds]
        # Each plant is identified anew: compensations know only what was measured (decision 0010).
        calibrations = expected(calibrate_each(own, seeds))
        plants = [self._controls(*each) for each in zip(seeds, own, calibrations, strict=True)]
        names = list(plants[0])
        machines = [plant[name] for name in names for plant in plants]
        figures = measure_key_figures(machines, seeds * len(names))
        return key_columns({name: figures[k * count : (k + 1) * count] for k, name in enumerate(names)})

    def _controls(self, seed: int, plant: Machine, calibration: Calibration) -> dict[str, Machine]:
        own = plant.calibrated(calibration)
        controls = {self.paper.name: random_plant(self.paper, seed)}
        if self.improved.control.compensation.load_encoder.active:
            controls["without the load encoder"] = without_load_encoder(own)
        return controls | {self.improved.name: own}
