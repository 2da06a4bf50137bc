"""A tuning as plain data for JSON."""

from __future__ import annotations

from typing import Any

from gantryctl.engineering.report.data import plain
from gantryctl.engineering.tuning.judge import GainsVerdict
from gantryctl.engineering.tuning.result import Tuning, differences
from gantryctl.machine import config_hash


def tuning_data(tuning: Tuning) -> dict[str, Any]:
    """Everything `tune --json` prints."""
    return {
        "machine": tuning.machine.name,
        "hash": config_hash(tuning.machine),
        "method": tuning.method,
        "speed_average_s": tuning.bench.speed_average_s,
        "small_delays_s": tuning.bench.small_delays_s,
        "fast_inertia_kg_m2": tuning.bench.fast_inertia_kg_m2,
        "start": vars(tuning.tuned.start) if tuning.tuned else None,
        "log": [trial._asdict() for trial in tuning.tuned.log] if tuning.tuned else [],
        "candidates": {
            c.name: {"gains": vars(c.gains), "move": c.move._asdict(), "verdict": _verdict(c.verdict)}
            for c in (tuning.configured, tuning.proposal, tuning.paper)
            if c is not None
        },
        # Only of the reference machine the paper tells gains.
        **({} if tuning.paper is None else {"difference_to_paper": differences(tuning)}),
    }


def _verdict(verdict: GainsVerdict) -> dict[str, Any]:
    margins = verdict.margins
    return {
        "plants": len(margins.cases),
        "unstable": len(margins.unstable),
        "worst_damping": margins.worst_damping.zeta,
        "worst_damping_hz": margins.worst_damping.hz,
        "worst_phase_margin_deg": margins.worst_phase.phase_margin_deg,
        "worst_sensitivity": margins.worst_sensitivity.sensitivity,
        "damping_left": verdict.damping_left,
        "unstable_stiffness_nm_per_rad": plain(verdict.bands),
    }
