"""The worst case in words and as data: bands of stiffness in which the configured gains are unstable."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from gantryctl.engineering.analysis.models.robust import (
    Bands,
    Case,
    RobustMargins,
    describe,
    robust_margins,
    running_damping,
    sketch_damping,
    unstable_stiffness,
)
from gantryctl.machine import Machine

DAMPINGS: Final = (0.005, 0.01, 0.025)
"""Structural dampings for which bands are given."""


def bands(machine: Machine) -> dict[str, dict[str, Bands]]:
    """Unstable bands of stiffness, N m/rad, by model and structural damping."""
    models = {"two-mass, continuous": sketch_damping, "full, as it runs": running_damping}
    return {
        name: {f"{zeta:g}": unstable_stiffness(model(machine, zeta)) for zeta in DAMPINGS}
        for name, model in models.items()
    }


class RobustReport(NamedTuple):
    """The worst case with the bands of stiffness in which the gains are unstable."""

    margins: RobustMargins
    bands: dict[str, dict[str, Bands]]


def robust_report(machine: Machine) -> RobustReport:
    """Compute both for the configured gains."""
    return RobustReport(robust_margins(machine), bands(machine))


def robust_sentences(report: RobustReport) -> list[str]:
    """Where the gains are unstable, and the worst plant."""
    found = []
    for name, by_damping in report.bands.items():
        parts = []
        for zeta, spans in by_damping.items():
            where = " and ".join(f"{low / 1e9:.2f}..{high / 1e9:.2f}e9" for low, high in spans)
            parts.append(
                f"{100.0 * float(zeta):g} % "
                + (f"unstable for k = {where} N m/rad" if where else "stable at every stiffness")
            )
        found.append(f"Configured gains on the {name} plant, by structural damping: {'; '.join(parts)}.")
    worst = report.margins.worst_damping
    state = "unstable" if worst.zeta < 0.0 else "stable"
    found.append(
        f"Over the uncertain full plant the worst swing has {100.0 * worst.zeta:.2f} % damping at {worst.hz:.2f} Hz "
        f"({state}; {describe(worst.variation)}); friction is left out."
    )
    return found


def robust_data(report: RobustReport) -> dict[str, Any]:
    """For JSON."""
    margins = report.margins
    return {
        "plants": len(margins.cases),
        "unstable": len(margins.unstable),
        "worst_damping": _case(margins.worst_damping),
        "worst_phase_margin": _case(margins.worst_phase),
        "worst_sensitivity": _case(margins.worst_sensitivity),
        "unstable_stiffness_nm_per_rad": report.bands,
        "sentences": robust_sentences(report),
    }


def _case(case: Case) -> dict[str, Any]:
    return {
        "stiffness_nm_per_rad": case.variation.stiffness_nm_per_rad,
        "damping_ratio": case.variation.damping_ratio,
        "load_inertia_kg_m2": case.variation.load_inertia_kg_m2,
        "motor_inertia_kg_m2": case.variation.motor_inertia_kg_m2,
        "stable": case.stable,
        "zeta": case.zeta,
        "hz": case.hz,
        "max_real_rad_s": case.max_real_rad_s,
        "phase_margin_deg": case.phase_margin_deg,
        "sensitivity_peak": case.sensitivity,
    }
