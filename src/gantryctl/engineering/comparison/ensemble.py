"""The same comparison over random gears and plants: what works on one set of phases only does not count."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from gantryctl.engineering.accuracy.procedure.on_batch import random_gear
from gantryctl.engineering.comparison.key_figures import KEY_FIGURES, KeyFigures, measure_key_figures
from gantryctl.engineering.comparison.variants import without_load_encoder
from gantryctl.engineering.identification import SimulatedAxis, calibrate
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, effective_values, with_values

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

Item = TypeVar("Item")
Result = TypeVar("Result")


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
    # Another stream than that of the phases: the same seed gives the same gear with and without other values.
    values, rng = effective_values(machine), np.random.default_rng([seed, 1])
    factor = {key: float(rng.uniform(1.0 - SPREAD, 1.0 + SPREAD)) for key in _VARIED}
    factor |= {key: factor[partner] for key, partner in _TOGETHER.items()}
    changes: dict[str, object] = {}
    for key in _VARIED:
        value = values[_PLANT + key]
        assert isinstance(value, float)
        changes[_PLANT + key] = value * factor[key]
    return with_values(random_gear(machine, seed), changes)


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
    seeds = tuple(range(seed + 1, seed + 1 + count))
    done: list[dict[str, KeyFigures]] = []
    for row in in_threads(lambda s: _one(paper, improved, s), seeds, threads):
        done.append(row)
        if progress is not None:
            progress(len(done))
    return PlantEnsemble(seeds, {name: tuple(row[name] for row in done) for name in done[0]})


def in_threads(
    work: Callable[[Item], Result], items: Iterable[Item], threads: int | None = None
) -> Iterable[Result]:
    """Results in the order of the items; the compiled loops run side by side."""
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        yield from pool.map(work, items)


def _one(paper: Machine, improved: Machine, seed: int) -> dict[str, KeyFigures]:
    own = random_plant(improved, seed)
    # Each plant is identified anew: compensations know only what was measured (decision 0010).
    own = own.calibrated(calibrate(SimulatedAxis(own, seed=seed)))
    rows = {paper.name: measure_key_figures(random_plant(paper, seed), seed)}
    if improved.control.compensation.load_encoder.active:
        rows["without the load encoder"] = measure_key_figures(without_load_encoder(own), seed)
    return rows | {improved.name: measure_key_figures(own, seed)}
