"""Ways of stops that the drive makes by itself, its controller silent, by figures of hand."""

from __future__ import annotations

import pytest

from gantryctl.engineering.stops.run import unbraked_stop_deg
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from gantryctl.machine.rules.reaction import (
    permitted_speed_deg_s,
    ramp_angle_deg,
    ramp_speed_max_deg_s,
    silent_speed_max_deg_s,
    silent_way_deg,
)

MACHINE = default_machine()


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_way_of_a_silent_controller_is_that_of_either_direction(way: float) -> None:
    """3 deg/s: 0.3 deg in 100 ms, and 9 / 10.8 of the quick stop."""
    assert silent_way_deg(MACHINE, way * 3.0, 100.0) == pytest.approx(0.3 + 9.0 / 10.8)


def test_the_highest_speed_of_a_brake_stop_uses_the_permitted_angle_and_no_more() -> None:
    """A load of 50 kN m drives while the brake closes; 4 deg are permitted."""
    fastest = silent_speed_max_deg_s(MACHINE, 200.0, brake=True)
    assert 0.0 < fastest < 6.0
    assert silent_way_deg(MACHINE, fastest, 200.0, brake=True) == pytest.approx(4.0)


def test_a_load_drives_a_silent_axis_while_its_brake_closes() -> None:
    """3 deg/s, s = 1.07952 deg/s2, n = 8.80025, 0.15 s to close, 0.2 s of delay; 0.16193 deg/s more when it is closed:
    0.51135 + 3 x 0.36840 + 0.01214 + 0.00149 deg.
    """
    assert silent_way_deg(MACHINE, 3.0, 200.0, brake=True) == pytest.approx(1.63018, rel=1e-5)


@pytest.mark.parametrize(
    ("owner", "speed", "way_deg"),
    [
        ("drive", 6.0, 0.0),
        ("object_60FE", 6.0, 0.1713),
        ("object_60FE", 0.3, 0.0586),
        ("object_60FE", -0.3, 0.0586),
    ],
)
def test_the_motor_goes_with_the_load_until_a_brake_that_nobody_works_has_closed(
    owner: str, speed: float, way_deg: float
) -> None:
    """A load of 2 Hz behind 5.4 deg/s2: 0.859 deg/s, behind a ramp of 56 ms sin(0.349) of it; 120 ms and a twist of
    0.0684 deg, which throws the motor twice as far: as the sides of a right angle 0.199 s of that speed.

    A drive that owns its brake closes it before its torque goes.
    """
    machine = with_values(
        MACHINE,
        {
            "brake.owner": owner, "brake.close_time_ms": 120.0, "control.compensation.first_mode_hz": 2.0,
            "virtual_axis.quick_dec_deg_s2": 5.4,
        },
    )  # fmt: skip
    ramp_deg = 0.1 * abs(speed) + speed**2 / 10.8
    for given in ({}, {"dec_deg_s2": 5.4}):
        assert silent_way_deg(machine, speed, 100.0, **given) == pytest.approx(ramp_deg + way_deg, abs=1e-4)
    # The drive that takes its torque off at once, and its brake falls.
    assert silent_way_deg(machine, speed, 100.0, brake=True) == pytest.approx(
        silent_way_deg(with_values(machine, {"brake.owner": "drive"}), speed, 100.0, brake=True)
    )


@pytest.mark.parametrize(("owner", "fastest"), [("drive", 6.0548), ("controller_output", 5.9130)])
def test_the_speed_that_silence_permits_leaves_room_for_what_the_load_drags_the_motor_on(
    owner: str, fastest: float
) -> None:
    """4 deg = 0.1 v + v^2 / 10.8, or 4 deg less 0.1713 deg of it: v = 5.4 (sqrt(0.01 + 4 / 2.7) - 0.1)."""
    machine = with_values(
        MACHINE,
        {
            "brake.owner": owner, "brake.close_time_ms": 120.0, "control.compensation.first_mode_hz": 2.0,
            "virtual_axis.quick_dec_deg_s2": 5.4, "required.stopping_angle_deg": 4.0,
        },
    )  # fmt: skip
    assert silent_speed_max_deg_s(machine, 100.0) == pytest.approx(fastest, abs=1e-3)
    assert silent_way_deg(machine, silent_speed_max_deg_s(machine, 100.0), 100.0) == pytest.approx(4.0)
    # A controller that lives closes the brake while the drive holds: 60 ms, and the ramp of the drive alone.
    assert ramp_speed_max_deg_s(machine, 60.0, 4.5) == pytest.approx(5.7360, abs=1e-4)
    assert ramp_angle_deg(machine, 60.0, 4.5) == pytest.approx(4.36)


@pytest.mark.parametrize("speed", [0.6, 6.0])
def test_the_way_that_is_told_is_not_shorter_than_that_of_the_plant(speed: float) -> None:
    """A brake that hangs on the controller's node, on the plant with gears: 0.05 to 0.09 deg behind the ramp.

    The bound behind a long ramp is 0.185 deg: it takes the worst swing of the load, which the plant may not meet.
    """
    machine = load_machine(configs_folder() / "hust_can_nodes.toml")
    told, way = silent_way_deg(machine, speed, 0.0), unbraked_stop_deg(machine, speed)
    assert way <= told <= way + 0.185


@pytest.mark.parametrize(
    ("speed_deg_s", "told"),
    [(12.38, 12.3), (8.97, 8.9), (1.09, 1.0), (0.897, 0.89), (0.0897, 0.089), (0.00897, 0.0089), (0.0, 0.0)],
)
def test_a_highest_speed_is_told_in_tenths_or_two_digits_and_never_higher(
    speed_deg_s: float, told: float
) -> None:
    assert permitted_speed_deg_s(speed_deg_s) == pytest.approx(told, abs=1e-12)
