"""Gear errors of a draft: ISO 1328-1 gives their size by grade, module and diameter; their phases are drawn.

The formulas of F_p and f_pt are in `wiring.teeth`; run-out is F_r = 0.8 F_p.
"""

from __future__ import annotations

import hashlib
import math
from typing import Final

import numpy as np

from gantryctl.engineering.drafting.basis import Basis
from gantryctl.engineering.drafting.origin import Values, guessed, significant
from gantryctl.machine.tables.plant import PHASES, RING_HARMONICS
from gantryctl.wiring.teeth import pitch_deviation_um, single_pitch_um

# A pinion is ground where its ring is milled: one grade better.
_PINION_BETTER: Final = 1.0
# Of the single pitch deviation that varies from tooth to tooth, this part repeats with every tooth.
_MESH_PART: Final = 1.0 / 6.0
# Of a strain-wave or cycloidal reducer, at its output: amplitudes in rad, of 0.5 arcmin class.
_REDUCER_RAD: Final = {
    "reducer_2x_rad": 4e-5,
    "reducer_1x_rad": 1.5e-5,
    "reducer_4x_rad": 1e-5,
    "output_1x_rad": 9e-5,
}


def gear_error_values(basis: Basis) -> Values:
    """[plant.gear_error]: the geometry is the sheet's, the size the standard's, the phases are drawn by the name."""
    phases = drawn_phases(basis.sheet.sheet.name)
    at = "plant.gear_error"
    return {
        f"{at}.ring_radius_m": basis.of_sheet("teeth.ring_radius_m"),
        f"{at}.pinion_teeth": basis.of_sheet("teeth.pinion_teeth"),
        **{f"{at}.{key}": guessed(value, "reducer of 0.5 arcmin") for key, value in _REDUCER_RAD.items()},
        **graded_values(basis, basis.sheet.teeth.grade),
        f"{at}.scale": guessed(1.0, "the grade as it stands"),
        f"{at}.phases_rad": guessed(
            phases, "drawn at random by the name; `gantryctl identify` measures them"
        ),
    }


def graded_values(basis: Basis, grade: float) -> Values:
    """Of [plant.gear_error] what goes with the accuracy grade of the teeth."""
    teeth, ring = basis.sheet.teeth, basis.sheet.gears.ring_ratio
    module, diameter = 1e3 * basis.module_m, 2e3 * teeth.ring_radius_m
    total = pitch_deviation_um(module, diameter, grade)
    run_out = 0.8 * pitch_deviation_um(module, diameter / ring, grade - _PINION_BETTER)
    by_grade = f"ISO 1328-1 grade {grade:g}"
    at = "plant.gear_error"
    return {
        f"{at}.ring_um": guessed(
            ring_um(total, drawn_phases(basis.sheet.sheet.name)),
            f"F_p = {total:.3g} um peak to peak, {by_grade}; falls with 1/n",
        ),
        f"{at}.pinion_1x_um": guessed(
            significant(0.5 * run_out, 3), f"half the run-out, one grade better than {by_grade}"
        ),
        f"{at}.mesh_um": guessed(
            significant(_MESH_PART * single_pitch_um(module, diameter, grade), 3),
            f"a sixth of f_pt, {by_grade}",
        ),
    }


def drawn_phases(name: str) -> tuple[float, ...]:
    """Phases of all waves, evenly over the turn, by the name: the same name, the same gear."""
    seed = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
    drawn = np.random.default_rng(seed).uniform(-math.pi, math.pi, PHASES)
    return tuple(round(float(phase), 4) for phase in drawn)


def ring_um(total_um: float, phases_rad: tuple[float, ...]) -> tuple[float, ...]:
    """Amplitudes that fall with 1/n and whose sum with these phases is `total_um` peak to peak."""
    turn = np.linspace(0.0, 2.0 * math.pi, 2048, endpoint=False)
    waves = np.arange(1, RING_HARMONICS + 1)
    phases = np.array(phases_rad[:RING_HARMONICS])
    shape = np.sum(np.sin(np.outer(waves, turn) + phases[:, None]) / waves[:, None], axis=0)
    first = total_um / float(np.ptp(shape))
    return tuple(significant(first / int(n), 3) for n in waves)
