"""Axes of ten decades of inertia are described by the same keys, and the rules refuse what is wrong at each size."""

from collections.abc import Callable

import pytest

from gantryctl.errors import ConfigError
from gantryctl.machine import Machine, with_values
from support.axes import dish, stage, table, tilt

AXES = (stage, table, tilt, dish)


@pytest.mark.parametrize("axis", AXES)
def test_an_axis_of_any_size_is_valid(axis: Callable[[], Machine]) -> None:
    assert 0.01 <= axis().plant.load.inertia_kg_m2 <= 1e8


# What a machine of the size of a gantry may have: each of these is a mistake on some other axis.
@pytest.mark.parametrize(
    ("axis", "changes", "key"),
    [
        (stage, {"plant.load.mass_kg": 900.0}, "inertia_kg_m2"),  # grams for kilograms: 3 mm of gyration
        (dish, {"plant.load.mass_kg": 800.0}, "inertia_kg_m2"),  # tonnes: 354 m
        (stage, {"plant.motor.torque_ripple_nm": 1.9}, "torque_ripple_nm"),
        (stage, {"plant.transmission.hysteresis_torque_nm": 2000.0}, "hysteresis_torque_nm"),
        (stage, {"plant.transmission.reducer_torque_2_nm": 6680.0}, "reducer_torque_2_nm"),
        (dish, {"plant.roller_friction.presliding_rad": 1e-3}, "presliding_rad"),  # 8 mm at its ring
        (table, {"plant.roller_friction.viscous_nm_s_per_rad": 2e4}, "viscous_nm_s_per_rad"),
        (table, {"speed.creep_deg_s": 3.0}, "creep_deg_s"),
    ],
)
def test_a_value_of_another_size_is_refused(
    axis: Callable[[], Machine], changes: dict[str, object], key: str
) -> None:
    with pytest.raises(ConfigError) as error:
        with_values(axis(), changes)
    assert any(key in line for line in error.value.problems)
