"""Studies, worst cases and measurements as plain data: rad/s, Hz, deg as the names say; None where no limit exists."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from gantryctl.engineering.analysis.measured.response import MeasuredResponse, Ratios
from gantryctl.engineering.analysis.models.linear import ComplexArray
from gantryctl.engineering.analysis.models.load_side import DiskMargin, LoadSideFigures
from gantryctl.engineering.analysis.models.mechanics import PlantKind
from gantryctl.engineering.analysis.models.paper_loop import (
    pairs,
    rigid_figures,
    rigid_loop,
    two_mass_figures,
)
from gantryctl.engineering.analysis.models.rigid import RigidLoop
from gantryctl.engineering.analysis.models.robust import Case, RobustReport
from gantryctl.engineering.analysis.models.sampled import Cut
from gantryctl.engineering.analysis.study import CutFigures, Study
from gantryctl.engineering.analysis.text import (
    EQUATION_5,
    equation_5_numbers,
    measured_sentence,
    robust_sentences,
    sentences,
)
from gantryctl.engineering.report.data import plain
from gantryctl.engineering.report.origin import Origin
from gantryctl.machine import config_hash


def study_data(study: Study) -> dict[str, Any]:
    """Everything `analyse --json` prints about one study."""
    data: dict[str, Any] = {
        "machine": study.machine.name,
        "hash": config_hash(study.machine),
        "origin": Origin.COMPUTED.value,
        "plant": study.kind.value,
        "friction": study.friction.value,
        "loop": asdict(study.settings),
        "equation_5": _equation_5(rigid_loop(study.machine)),
        "stable": study.stable,
        "cuts": {
            # Cut at the position error or behind its gain Kpp: the same loop.
            "position command": _cut(study.at(Cut.SPEED_COMMAND)),
            **{figures.cut.value: _cut(figures) for figures in study.cuts},
        },
        "closed_loops": {
            figures.name: {
                "bandwidth_rad_s": figures.bandwidth_rad_s,
                "last_bandwidth_rad_s": figures.last_rad_s,
                "peak": figures.peak.value,
                "peak_rad_s": figures.peak.w_rad_s,
            }
            for figures in study.closed
        },
        "poles_rad_s": pairs(study.loop.poles),
        "zeros_rad_s": pairs(study.plant.held_poles()),
        "modes": [
            {
                "name": mode.name,
                "held_hz": mode.held.hz,
                "held_zeta": mode.held.zeta,
                "closed_hz": mode.closed.hz,
                "closed_zeta": mode.closed.zeta,
                "damping_taken": mode.damping_taken,
                "followed": mode.followed,
            }
            for mode in study.modes
        ],
        "load_side": study.load_side and load_side_data(study.load_side),
        "sentences": sentences(study),
    }
    if study.kind is PlantKind.RIGID:
        data["figures"] = plain(rigid_figures(study.machine))
    if study.kind is PlantKind.TWO_MASS:
        data["figures"] = plain(two_mass_figures(study.machine))
    return data


def _equation_5(loop: RigidLoop) -> dict[str, Any]:
    """Coefficients from the highest power down, poles and zeros in rad/s."""
    return {
        "symbols": list(EQUATION_5),
        "numbers": list(equation_5_numbers(loop)),
        **asdict(loop),
        "numerator": list(loop.position.num),
        "denominator": list(loop.position.den),
        "poles": pairs(loop.position.poles),
        "zeros": pairs(loop.position.zeros),
    }


def _cut(figures: CutFigures) -> dict[str, Any]:
    phase = figures.phase
    return {
        "phase_margin_deg": phase and phase.margin_deg,
        "crossover_rad_s": phase and phase.crossover_rad_s,
        "delay_margin_s": phase and phase.delay_s,
        "gain_reduction_margin": figures.gain_down,
        "gain_margin": figures.gain_up,
        "sensitivity_peak": figures.sensitivity.value,
        "sensitivity_peak_rad_s": figures.sensitivity.w_rad_s,
    }


def load_side_data(figures: LoadSideFigures) -> dict[str, Any]:
    """The whole loop: stable, its least damped swing, disk margin by cut."""

    def disk(margin: DiskMargin) -> dict[str, float]:
        return {"alpha": margin.alpha, "rad_s": margin.w_rad_s}

    return {
        "stable": figures.stable,
        "zeta": figures.worst.zeta,
        "hz": figures.worst.hz,
        "disk_margins": {
            "speed command": disk(figures.command),
            "torque": disk(figures.torque),
            "both encoders": disk(figures.encoders),
        },
    }


def robust_data(report: RobustReport) -> dict[str, Any]:
    """The worst case and the unstable bands of stiffness."""
    margins = report.margins
    return {
        "plants": len(margins.cases),
        "unstable": len(margins.unstable),
        "worst_damping": _case(margins.worst_damping),
        "worst_phase_margin": _case(margins.worst_phase),
        "worst_sensitivity": _case(margins.worst_sensitivity),
        "unstable_stiffness_nm_per_rad": plain(report.bands),
        "load_side": [asdict(case.variation) | load_side_data(case.figures) for case in report.load_side],
        "sentences": robust_sentences(report),
    }


def _case(case: Case) -> dict[str, Any]:
    return {
        **asdict(case.variation),
        "stable": case.stable,
        "zeta": case.zeta,
        "hz": case.hz,
        "max_real_rad_s": case.max_real_rad_s,
        "phase_margin_deg": case.phase_margin_deg,
        "sensitivity_peak": case.sensitivity,
    }


def measured_data(result: MeasuredResponse) -> dict[str, object]:
    """Magnitude and phase of every ratio, measured and of the model."""

    def polar(values: ComplexArray) -> dict[str, list[float]]:
        return {"magnitude": np.abs(values).tolist(), "phase_deg": np.angle(values, deg=True).tolist()}

    measured = result.measured
    return {
        "origin": result.origin.value,
        "condition": result.condition.name,
        "torque_nm": result.condition.torque_nm,
        "vel_deg_s": result.condition.vel_deg_s,
        "angle_deg": result.condition.angle_deg,
        "model_friction": result.condition.friction.value,
        "hz": measured.hz.tolist(),
        "scatter": measured.scatter.tolist(),
        "measured": {name: polar(getattr(measured, name)) for name in Ratios._fields},
        "model": {name: polar(getattr(result.model, name)) for name in Ratios._fields},
        "typical_error": result.typical_error,
        "off_hz": result.off.tolist(),
        "sentence": measured_sentence(result),
    }
