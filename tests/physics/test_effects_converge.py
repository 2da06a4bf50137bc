"""Half the step changes A by less than 1 %, with every effect of the plant on: slow, minutes on a busy computer."""

from __future__ import annotations

import numpy as np
import pytest

from gantryctl.engineering.accuracy.procedure.on_batch import run_procedure
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure, evaluate
from gantryctl.engineering.accuracy.statistics import accuracy_a
from physics.plants import machine

EFFECTS = ("tooth_pitch", "thermal", "ageing", "cogging", "encoder_errors", "cable")
ALL = {f"plant.switches.{name}": True for name in EFFECTS} | {
    "plant.thermal.gears_start_k": -5.0,
    "plant.thermal.gears_end_k": -5.0,
    "plant.thermal.motor_end_k": 60.0,
}


TWO = {"plant.switches.second_pinion": True}


@pytest.mark.slow
@pytest.mark.parametrize("changes", [ALL, TWO], ids=["all", "two pinions"])
def test_half_the_step_changes_a_by_less_than_one_percent(changes: dict[str, object]) -> None:
    procedure = chord_procedure("A")
    schemes = [
        {"plant.integration.scheme": "one_evaluation"},
        {"plant.integration.scheme": "rk4", "plant.integration.rk4_steps": 2},
        {"plant.integration.scheme": "rk4", "plant.integration.rk4_steps": 4},
    ]
    machines = [machine(changes | scheme) for scheme in schemes]
    angles = run_procedure(machines, procedure).load_rad
    found = [float(accuracy_a(np.array([evaluate(procedure, row, 2.5).errors_deg]))[0]) for row in angles]
    print("A, deg: " + ", ".join(f"{a:.6f}" for a in found))
    assert found[1] == pytest.approx(found[2], rel=0.01)
    assert found[0] == pytest.approx(found[2], rel=0.01)
