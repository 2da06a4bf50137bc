"""Checks of a command, before power is switched on and by the axis: the same refusals in the same words."""

from __future__ import annotations

import math

import pytest

from gantryctl.cli.axis.move import way_note
from gantryctl.cli.text import shown
from gantryctl.image import OperatorCommand
from gantryctl.machine import default_machine, with_values
from gantryctl.program import GantryProgram, Refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import (
    check_direction,
    check_jerk,
    check_ramp,
    check_setting,
    check_target,
)
from gantryctl.runtime import FixedOperator
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.program import speed_settings, travel_settings
from gantryctl.wiring.simulator import ideal_drive
from unit.program.rig import Rig, settings

MACHINE = default_machine()
TRAVEL, SPEED = travel_settings(MACHINE), speed_settings(MACHINE)


def check(here_deg: float, target_deg: float) -> Refusal | None:
    return check_target(rad(here_deg), rad(target_deg), TRAVEL)


@pytest.mark.parametrize(
    ("here", "target", "text"),
    [
        (90.0, 200.0, "target 200.00 deg is beyond +180.00 deg; you are at 90.00 deg, so 90.00 deg are left"),
        (90.0, -180.01, "target -180.01 deg is beyond -180.00 deg; you are at 90.00 deg, so 270.00 deg are left"),
        (-0.0004, 181.0, "target 181.00 deg is beyond +180.00 deg; you are at 0.00 deg, so 180.00 deg are left"),
        (182.0, 183.0, "target 183.00 deg is beyond +180.00 deg; you are at 182.00 deg, so 0.00 deg are left"),
        (0.0, 1e300, "target must be within -180.00 and 180.00 deg, got 1e+300 deg"),
        (0.0, math.nan, "target must be within -180.00 and 180.00 deg, got nan deg"),
    ],
)  # fmt: skip
def test_a_target_beyond_the_travel_is_refused_in_these_words(here: float, target: float, text: str) -> None:
    refused = check(here, target)
    assert refused is not None
    assert refused.text == text


@pytest.mark.parametrize(
    ("here", "target"), [(0.0, 180.0), (0.0, -180.0), (0.0, -0.0), (186.0, 185.0), (186.0, 0.0)]
)
def test_inside_the_travel_and_back_towards_it_is_open(here: float, target: float) -> None:
    assert check(here, target) is None


TARGETS = (0.0, -0.0, 179.99, 180.0, 180.01, 181.0, 184.0, 185.5, 187.0, 399.0, -180.0, -180.01, -185.5, -1e5)


@pytest.mark.parametrize("here", [0.0, 90.0, -179.5, 185.0, -185.0])
def test_the_axis_itself_refuses_the_same_targets_in_the_same_words(here: float) -> None:
    machine = with_values(MACHINE, {"drive.kind": "ideal"})
    engine = build_engine(machine, drive=ideal_drive(machine, here))
    assert isinstance(engine.operator, FixedOperator)
    assert isinstance(engine.program, GantryProgram)
    axis = engine.program.axis
    engine.operator.command = OperatorCommand(power=True)
    engine.run_for(2.0)
    for target in TARGETS:
        here = deg(axis.virtual.pos_ref_rad)
        command = axis.motion.move_absolute(rad(target), rad(6.0))
        assert command.refusal == check(here, target), target


@pytest.mark.parametrize("speed", [0.6, 6.0, 3.3])
def test_the_speed_setting_reaches_from_a_tenth_to_one_turn_a_minute(speed: float) -> None:
    assert check_setting(rad(speed), SPEED) is None


@pytest.mark.parametrize("speed", [0.59, 6.01, 0.0, -3.0, math.nan, math.inf])
def test_a_speed_outside_is_refused_never_clamped(speed: float) -> None:
    refused = check_setting(rad(speed), SPEED)
    assert refused is not None
    assert refused.text.startswith("speed must be within 0.60 and 6.00 deg/s, got")


def test_at_the_end_of_the_travel_only_the_way_back_is_open() -> None:
    for here, direction in ((180.0, 1.0), (-180.0, -1.0), (185.0, 1.0)):
        refused = check_direction(rad(here), direction, TRAVEL)
        assert refused is not None
        assert "only motion" in refused.text
        assert check_direction(rad(here), -direction, TRAVEL) is None
    assert check_direction(rad(179.9), 1.0, TRAVEL) is None


@pytest.mark.parametrize(
    ("here", "target", "note"),
    [
        (179.0, -179.0, "358 deg the long way: cable"),
        (-90.0, 91.0, "181 deg the long way: cable"),
        (-90.0, 90.0, None),
        (0.0, 180.0, None),
        (-90.0, 200.0, None),
    ],
)
def test_the_long_way_is_said(here: float, target: float, note: str | None) -> None:
    assert way_note(MACHINE, here, target) == note


def test_zero_is_shown_without_a_minus() -> None:
    assert f"{shown(-0.00001, 4):.4f}" == "0.0000"
    assert f"{shown(-0.0, 2):.2f}" == "0.00"
    assert shown(-1.23456, 2) == -1.23


@pytest.mark.parametrize(
    ("acc_deg_s2", "refused"), [(4.0, False), (2.0, False), (4.01, True), (0.0, True), (math.nan, True)]
)
def test_an_acceleration_is_at_most_the_machines_and_the_ramp_down_goes_with_it(acc_deg_s2, refused):
    rig = Rig(config=settings(acc=4.0, dec=2.0))
    rig.power_up()
    assert (rig.axis.set_acceleration(rad(acc_deg_s2)) is not None) is refused
    if not refused:
        assert deg(rig.axis.virtual.ramps.dec_rad_s2) == pytest.approx(0.5 * acc_deg_s2)
    rig.move(50.0)
    rig.run(0.2)
    assert rig.axis.set_acceleration(rad(1.0)) is not None, "at standstill only"


def test_the_ramps_of_the_machine_are_ramps_of_a_motion():
    assert check_ramp(Words.NAME_ACCELERATION, 1.0, 1.0) is None
    assert check_ramp(Words.NAME_ACCELERATION, 1.0001, 1.0) is not None
    assert check_jerk(1.0, 1.0) is None
    assert check_jerk(1.0001, 1.0) is not None
    assert check_jerk(math.inf, math.inf) is None
    for wrong in (0.0, -1.0, math.nan):
        assert check_jerk(wrong, math.inf) is not None
        assert check_ramp(Words.NAME_ACCELERATION, wrong, 1.0) is not None


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("left_rad", "shut"), [(0.0, True), (1e-9, True), (1e-8, False), (-0.1, True)])
def test_a_speed_towards_the_end_is_refused_where_less_than_a_count_is_left(
    way: float, left_rad: float, shut: bool
) -> None:
    here = way * (rad(180.0) - left_rad)
    assert (check_direction(here, way * 0.1, TRAVEL) is not None) is shut
    assert check_direction(here, -way * 0.1, TRAVEL) is None
