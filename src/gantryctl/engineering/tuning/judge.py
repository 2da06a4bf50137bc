"""Gains on the uncertain plant: stiffness 0.3..1.2e9 N m/rad, damping, inertias; and where they are unstable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from gantryctl.engineering.analysis.models.modes import Oscillation
from gantryctl.engineering.analysis.models.robust import (
    Bands,
    Case,
    RobustMargins,
    UncertainPlant,
    describe,
    robust_margins,
    running_damping,
    sketch_damping,
    uncertain_plants,
    unstable_stiffness,
)
from gantryctl.engineering.tuning.gains import Gains, machine_with, settings_with
from gantryctl.machine import Machine

DAMPINGS: Final = (0.005, 0.01, 0.025)
"""Structural dampings for which bands of stiffness are given."""
SKETCH, RUNNING = "two masses, continuous", "full plant, as it runs"


@dataclass(frozen=True)
class Verdict:
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


def judged(machine: Machine, gains: Gains, plants: Sequence[UncertainPlant] | None = None) -> Verdict:
    """Hold gains against the uncertain plant.

    Args:
        machine: base, current loop and timing are taken as they are.
        gains: any.
        plants: the set, when it was made before.
    """
    chosen = uncertain_plants(machine) if plants is None else plants
    settings = settings_with(machine, gains)
    margins = robust_margins(machine, settings=settings, plants=chosen)
    left = [damping_left(case, plant) for case, plant in zip(margins.cases, chosen, strict=True)]
    worst = min(range(len(left)), key=lambda k: left[k])
    tried = machine_with(machine, gains)
    bands: dict[str, dict[float, Bands]] = {
        SKETCH: {zeta: unstable_stiffness(sketch_damping(tried, zeta)) for zeta in DAMPINGS},
        RUNNING: {zeta: unstable_stiffness(running_damping(machine, zeta, settings)) for zeta in DAMPINGS},
    }
    return Verdict(gains, margins, bands, left[worst], margins.cases[worst])


def damping_left(case: Case, plant: UncertainPlant) -> float:
    """Damping of the least damped swing in the closed loop over that of the load with the motor held."""
    return case.zeta / Oscillation.of(complex(plant.plant.held_poles()[0])).zeta


def sentences(name: str, verdict: Verdict) -> list[str]:
    """What the verdict says."""
    margins = verdict.margins
    count, wrong = len(margins.cases), len(margins.unstable)
    where = "stable on all" if not wrong else f"UNSTABLE on {wrong}"
    worst = margins.worst_damping
    found = [
        f"{name}: {where} of {count} uncertain plants; the least damped swing has {100.0 * worst.zeta:.2f} % at "
        f"{worst.hz:.2f} Hz ({describe(worst.variation)}); the loop leaves {100.0 * verdict.damping_left:.0f} % of the "
        f"load's own damping there where it leaves least."
    ]
    if not wrong:
        found.append(
            f"{name}: margins over all of them: sensitivity at most {margins.worst_sensitivity.sensitivity:.2f}, "
            f"phase margin at least {margins.worst_phase.phase_margin_deg:.0f} deg."
        )
    for model, by_damping in verdict.bands.items():
        bad = {zeta: bands for zeta, bands in by_damping.items() if bands}
        if bad:
            parts = [f"{100.0 * zeta:g} % damping: k = {_spans(bands)}" for zeta, bands in bad.items()]
            found.append(f"{name}: unstable on the {model} model with {'; '.join(parts)}.")
    return found


def verdict_data(verdict: Verdict) -> dict[str, Any]:
    """For JSON."""
    margins = verdict.margins
    return {
        "plants": len(margins.cases),
        "unstable": len(margins.unstable),
        "worst_damping": margins.worst_damping.zeta,
        "worst_damping_hz": margins.worst_damping.hz,
        "worst_phase_margin_deg": margins.worst_phase.phase_margin_deg,
        "worst_sensitivity": margins.worst_sensitivity.sensitivity,
        "damping_left": verdict.damping_left,
        "unstable_stiffness_nm_per_rad": {
            model: {f"{zeta:g}": [list(band) for band in bands] for zeta, bands in by_damping.items()}
            for model, by_damping in verdict.bands.items()
        },
    }


def _spans(bands: Bands) -> str:
    return " and ".join(f"{low / 1e9:.2f}..{high / 1e9:.2f}e9" for low, high in bands) + " N m/rad"
