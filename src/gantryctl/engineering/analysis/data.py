"""A study as plain data for JSON: rad/s, Hz, deg as the names say; None where a limit does not exist."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from gantryctl.engineering.analysis.models import equation5
from gantryctl.engineering.analysis.models.mechanics import PlantKind
from gantryctl.engineering.analysis.models.modes import Mode
from gantryctl.engineering.analysis.models.paper_loop import (
    pairs,
    rigid_figures,
    rigid_loop,
    two_mass_figures,
)
from gantryctl.engineering.analysis.models.sampled import Cut
from gantryctl.engineering.analysis.study import ClosedFigures, CutFigures, Study
from gantryctl.engineering.analysis.text import sentences
from gantryctl.machine import config_hash

_TWO_PI = 2.0 * math.pi


def study_data(study: Study) -> dict[str, Any]:
    """Everything `analyse --json` prints about one study."""
    data: dict[str, Any] = {
        "machine": study.machine.name,
        "hash": config_hash(study.machine),
        "plant": study.kind.value,
        "friction": study.friction.value,
        "loop": dataclasses.asdict(study.settings),
        "equation_5": equation5.as_dict(rigid_loop(study.machine)),
        "stable": study.stable,
        "cuts": {
            # cut at the position command's error or behind its gain Kpp: the same loop
            "position command": _cut(study.at(Cut.SPEED_COMMAND)),
            **{figures.cut.value: _cut(figures) for figures in study.cuts},
        },
        "closed_loops": {figures.name: _closed(figures) for figures in study.closed},
        "poles_rad_s": pairs(study.loop.poles),
        "zeros_rad_s": pairs(study.plant.held_poles()),
        "modes": [_mode(mode) for mode in study.modes],
        "sentences": sentences(study),
    }
    if study.kind is PlantKind.RIGID:
        data["figures"] = rigid_figures(study.machine)
    if study.kind is PlantKind.TWO_MASS:
        data["figures"] = two_mass_figures(study.machine)
    return data


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


def _closed(figures: ClosedFigures) -> dict[str, Any]:
    return {
        "bandwidth_rad_s": figures.bandwidth_rad_s,
        "last_bandwidth_rad_s": figures.last_rad_s,
        "peak": figures.peak.value,
        "peak_rad_s": figures.peak.w_rad_s,
    }


def _mode(mode: Mode) -> dict[str, Any]:
    return {
        "name": mode.name,
        "held_hz": mode.held.hz,
        "held_zeta": mode.held.zeta,
        "closed_hz": mode.closed.hz,
        "closed_zeta": mode.closed.zeta,
        "damping_taken": mode.damping_taken,
    }
