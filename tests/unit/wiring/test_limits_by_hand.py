"""Limits that commissioning and the drive lower on their way from file to program."""

from __future__ import annotations

import math

import pytest

from gantryctl.machine import default_machine, with_values
from gantryctl.wiring.program import _ramps, position_law, speed_settings

MACHINE = default_machine()


@pytest.mark.parametrize(("proven_deg_s", "setting_deg_s"), [(1.5, 1.5), (100.0, None), (math.inf, None)])
def test_the_highest_setting_is_the_proven_one(proven_deg_s: float, setting_deg_s: float | None) -> None:
    found = speed_settings(MACHINE, proven_deg_s).setting_max_rad_s
    assert math.degrees(found) == pytest.approx(setting_deg_s or MACHINE.speed.setting_max_deg_s)


def test_the_trip_is_at_the_speed_of_the_file() -> None:
    speed = MACHINE.speed
    assert math.degrees(speed_settings(MACHINE).overspeed_trip_rad_s) == pytest.approx(
        speed.overspeed_trip_deg_s
    )
    higher = 1.1 * speed.overspeed_trip_deg_s
    machine = with_values(MACHINE, {"speed.overspeed_trip_deg_s": higher})
    assert math.degrees(speed_settings(machine).overspeed_trip_rad_s) == pytest.approx(higher)


@pytest.mark.parametrize(("own", "used"), [(3.0, 3.0), (None, None)])
def test_the_ramp_of_a_drive_with_its_own_counts(own: float | None, used: float | None) -> None:
    found = math.degrees(_ramps(MACHINE, own).quick_dec_rad_s2)
    assert found == pytest.approx(used or MACHINE.virtual_axis.quick_dec_deg_s2)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_position_loop_commands_no_more_than_the_clamp(direction: float) -> None:
    """90 deg of following error: 6.3 deg/s through 1144 turns of the motor."""
    command_rad_s, _, _ = position_law(MACHINE).scan(direction * math.pi / 2.0, 0.0, 0.0)
    assert math.degrees(command_rad_s) / 1144.0 == pytest.approx(direction * 6.3)
