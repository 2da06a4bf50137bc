"""A value that is its limit to the last bit is permitted, and the next number beyond it is not; both ways.

A limit that people type is met to the bit more often than chance has it: a target at the end of travel, a speed at the
cap, a torque at the level of the test.
"""

from __future__ import annotations

import math

import pytest

from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.command_checks import (
    check_jerk,
    check_ramp,
    check_setting,
    check_speed,
)
from gantryctl.program.monitors.drag import DragWatch
from gantryctl.program.monitors.thermal import MotorThermal
from gantryctl.units import rad
from unit.program.judges import FROM, MONITORS, POWER, READINGS
from unit.program.parts import BOTH, Parts
from unit.program.rig import RATIO


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


@BOTH
def test_a_drag_that_is_the_level_of_the_halt_itself_is_a_warning(way: float) -> None:
    """30 % of 257 N m for a second; the mean is held at the level."""
    for drag, reaction in (
        (0.30 * 257.0, Reaction.W),
        (math.nextafter(0.30 * 257.0, math.inf), Reaction.HLT),
    ):
        parts = Parts()
        watch = DragWatch(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
        parts.virtual.vel_ref_rad_s = way * rad(3.0)
        watch._mean_nm, watch._mean_share = drag, 0.0
        parts.after(lambda watch=watch: watch.scan(0.0), most_s=1.1)
        assert parts.reaction("BRK-02") is reaction
        assert parts.alarms.active[Code.BRK_02].values["share"] == pytest.approx(30.0)


@BOTH
@pytest.mark.parametrize("wrong", ["torque", "speed"])
def test_of_two_commands_the_one_beyond_its_limit_is_named(wrong: str, way: float) -> None:
    """The other one is its limit to the bit."""
    parts = Parts()
    axis = Axis(parts.settings, 0.0)
    torque, speed = way * 385.0, way * rad(6.3) * RATIO
    beyond = axis._guard(speed * (1.0 + (wrong == "speed")), torque * (1.0 + (wrong == "torque")))
    assert beyond == (0.0, torque if wrong == "speed" else 0.0)
    words = Words.SPEED_COMMAND if wrong == "speed" else Words.TORQUE_COMMAND
    assert axis.alarms.active[Code.CTL_02].values["measured"].words is words
