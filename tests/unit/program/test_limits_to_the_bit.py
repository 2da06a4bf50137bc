"""A value that is its limit to the last bit is permitted, and the next number beyond it is not; both ways.

A limit that people type is met to the bit more often than chance has it: a target at the end of travel, a speed at the
cap, a torque at the level of the test.
"""

from __future__ import annotations

import math

import pytest

from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import (
    check_jerk,
    check_ramp,
    check_setting,
    check_speed,
)
from gantryctl.program.monitors.thermal import MotorThermal
from gantryctl.units import rad
from unit.program.judges import FROM, MONITORS, POWER, READINGS
from unit.program.parts import BOTH, Parts


@BOTH
@pytest.mark.parametrize("name", [*POWER, *MONITORS, *READINGS])
def test_the_limit_itself_is_permitted_and_the_next_number_is_not(name: str, way: float) -> None:
    acts, limit = (POWER | MONITORS | READINGS)[name]
    assert not acts(Parts(), way * limit)
    assert acts(Parts(), way * math.nextafter(limit, math.inf))


@BOTH
@pytest.mark.parametrize("name", FROM)
def test_from_the_limit_itself_on_and_not_from_the_number_below(name: str, way: float) -> None:
    acts, limit = FROM[name]
    assert acts(Parts(), way * limit)
    assert not acts(Parts(), way * math.nextafter(limit, 0.0))


def test_the_range_of_a_setting_and_of_a_ramp_includes_its_ends() -> None:
    parts = Parts()
    speed = parts.settings.speed
    beyond, below = math.nextafter(rad(6.0), math.inf), math.nextafter(rad(0.6), 0.0)
    assert check_setting(rad(0.6), speed) is None
    assert check_setting(rad(6.0), speed) is None
    assert check_setting(below, speed) is not None
    assert check_setting(beyond, speed) is not None
    for check in (
        lambda x: check_speed(x, rad(6.0)),
        lambda x: check_jerk(x, rad(6.0)),
        lambda x: check_ramp(Words.NAME_ACCELERATION, x, rad(6.0)),
    ):
        assert check(rad(6.0)) is None
        assert check(math.ulp(0.0)) is None
        assert check(beyond) is not None
        assert check(0.0) is not None


@pytest.mark.parametrize(
    ("reading_c", "believed"), [(-30.0, True), (250.0, True), (-30.1, False), (250.1, False)]
)
def test_a_sensor_of_the_motor_reads_from_minus_30_to_250_c(reading_c: float, believed: bool) -> None:
    parts = Parts()
    thermal = MotorThermal(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.motor_temp_c = reading_c
    thermal.scan(0.0)
    thermal.scan(1.0)
    assert ("THM-02" in parts.codes) is not believed
