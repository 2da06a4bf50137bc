"""Who is the reference machine: decided by what the paper prints of it, not by a name."""

from __future__ import annotations

import pytest

from gantryctl.machine import configs_folder, default_machine, is_reference_machine, load_machine, with_values


@pytest.mark.parametrize("name", ["hust_gantry", "hust_improved", "hust_can", "hust_can_nodes"])
def test_the_files_of_the_reference_machine_are_it(name: str) -> None:
    assert is_reference_machine(load_machine(configs_folder() / f"{name}.toml"))


@pytest.mark.parametrize(
    "changes",
    [
        {"machine.name": "another_name"},
        {"plant.gear_error.scale": 0.5},
        {"plant.transmission.backlash_mm": 0.4},
        {"control.kpp_per_s": 9.0},
        {"required.angle_deg": 0.01},
    ],
    ids=str,
)
def test_names_gains_gears_and_requirements_decide_nothing(changes: dict[str, object]) -> None:
    assert is_reference_machine(with_values(default_machine(), changes))


@pytest.mark.parametrize(
    "changes",
    [
        {"axis.pos_max_deg": 170.0},
        {"axis.reducer_ratio": 87.0},
        {"plant.load.inertia_kg_m2": 2.0e6},
        {"motor.inertia_kg_m2": 0.23},
    ],
    ids=str,
)
def test_another_axis_under_the_same_name_is_not_it(changes: dict[str, object]) -> None:
    assert not is_reference_machine(with_values(default_machine(), changes))
