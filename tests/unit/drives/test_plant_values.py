"""A parameter of the simulated plant that is changed while it runs: refused, or a plant that can be computed."""

from __future__ import annotations

import math

import pytest

from gantryctl._core import PlantParams
from gantryctl.drives.plant_values import with_value
from gantryctl.errors import DeviceError, UsageError
from gantryctl.image import DriveRequest, OutputImage
from gantryctl.machine import configs_folder, default_machine, load_machine
from gantryctl.wiring.simulator import plant_params, sim_drive
from gantryctl.wiring.virtual import virtual_bus

MACHINE = default_machine()
PLANT = plant_params(MACHINE)
NAMES = [
    name
    for name in dir(PlantParams)
    if not name.startswith("_") and isinstance(getattr(PLANT, name), bool | int | float)
]
VEL_RAD_S = math.radians(1.0) * MACHINE.axis.ratio


def test_every_parameter_is_tried() -> None:
    assert len(NAMES) > 70


@pytest.mark.parametrize("name", NAMES)
def test_no_value_makes_a_reading_that_is_no_number(name: str) -> None:
    """60 ms at 1 deg/s: every reading is finite, or the value or the drive is refused by name."""
    for value in (-1e12, -1.0, 0.0, 1e12, math.nan):
        drive, said = sim_drive(MACHINE, 30.0), name
        try:
            for _ in range(5):
                drive.write(OutputImage(DriveRequest.ENABLE, 0.0, brake_open=True))
            drive.change_plant(name, value)
            for _ in range(60):
                reading = drive.read()
                shown = (
                    reading.pos_act_counts,
                    reading.vel_act_rad_s,
                    reading.torque_act_nm,
                    reading.pos_ring_rad,
                )
                assert all(map(math.isfinite, shown)), (value, shown)
                drive.write(OutputImage(DriveRequest.ENABLE, VEL_RAD_S, brake_open=True))
        except UsageError as wrong:
            said = str(wrong)
        except DeviceError as wrong:
            said = str(wrong).replace("parameters", name)
        assert name in said


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("motor_coulomb_nm", -0.001),
        ("roller_viscous_nm_s_per_rad", -1.0),
        ("inertia_load_kg_m2", 0.0),
        ("stiffness_2_nm_per_rad", -1.0),
        ("friction_ep_ratio", 1.0),
        ("eccentric_moment_nm", math.nan),
        ("wind_moment_nm", math.inf),
        ("pinion_teeth", 0.0),
    ],
)
def test_what_no_plant_can_have_is_refused(name: str, value: float) -> None:
    with pytest.raises(UsageError, match=name):
        with_value(PLANT, name, value)


def test_a_load_that_hangs_the_other_way_is_no_mistake() -> None:
    before = PLANT.eccentric_moment_nm
    assert with_value(PLANT, "eccentric_moment_nm", -50_000.0).eccentric_moment_nm == -50_000.0
    # What was there stays as it was: another drive may still have it.
    assert PLANT.eccentric_moment_nm == before


def test_a_plant_on_a_bus_that_swings_up_is_a_lost_device() -> None:
    """A load of a gram behind a gear of 1e9 N m/rad: 30 kHz, four times the cycle of the drive."""
    _, node, _ = virtual_bus(load_machine(configs_folder() / "hust_can.toml"), 30.0)
    node.plant.change_plant("inertia_load_kg_m2", 1e-3)
    with pytest.raises(DeviceError, match="cannot be computed"):
        node.advance(5_000_000)


@pytest.mark.parametrize("present", [True, False])
def test_a_second_pinion_comes_and_goes_with_no_running_plant(present: bool) -> None:
    plant = PLANT.copy()
    plant.second_pinion = present
    assert with_value(plant, "second_pinion", float(present)).second_pinion is present
    with pytest.raises(UsageError, match="'second_pinion' cannot change while the plant runs"):
        with_value(plant, "second_pinion", float(not present))
