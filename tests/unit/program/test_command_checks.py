"""Checks of a command, before power is switched on and by the axis: the same refusals in the same words."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gantryctl.cli.axis.move import way_note
from gantryctl.cli.text import shown
from gantryctl.image import Direction, OperatorCommand
from gantryctl.machine import default_machine, with_values
from gantryctl.program import Code, GantryProgram, Refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import (
    check_destination,
    check_direction,
    check_dynamics,
    check_jerk,
    check_ramp,
    check_setting,
    check_target,
    check_way,
    way_to,
)
from gantryctl.program.axis.motion_command import Dynamics
from gantryctl.program.axis.permission import why_no_brake_test
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.settings import TravelSettings
from gantryctl.runtime import FixedOperator
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.program import speed_settings, travel_settings
from gantryctl.wiring.simulator import ideal_drive
from unit.program.parts import BOTH, Parts
from unit.program.rig import Rig, settings
from unit.program.test_modulo import modulo

MACHINE = default_machine()
MODULO = modulo().travel
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


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_increments_reach_the_end_of_travel_that_they_sum_up_to(way: float) -> None:
    """As doubles 720 times 0.25 deg are 3e-14 rad more than 180; a fine count is 1.3e-9."""
    before, end = 0.0, 0.0
    for _ in range(720):
        before, end = end, end + way * rad(0.25)
    assert abs(end) > rad(180.0)
    assert check_target(before, end, TRAVEL) is None
    assert check_target(before, end + way * 1.3e-9, TRAVEL) is not None


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
    assert refused.text.startswith("speed must be within 0.6 and 6 deg/s, got")


def test_speeds_of_a_slow_axis_are_told_so_that_they_can_be_typed() -> None:
    """A yaw drive of 0.3488 deg/s: told as 0.35 its own limit would be refused."""
    slow = replace(SPEED, setting_min_rad_s=rad(0.03488), setting_max_rad_s=rad(0.3488))
    refused = check_setting(rad(0.35), slow)
    assert refused is not None
    assert refused.text.startswith("speed must be within 0.03488 and 0.3488 deg/s, got 0.35")


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


@pytest.mark.parametrize(
    ("angle_deg", "open_"), [(360.0, True), (-360.0, True), (360.01, False), (-360.01, False)]
)
def test_an_angle_of_a_modulo_axis_is_one_of_a_turn_either_way_and_told_in_degrees(angle_deg, open_):
    refused = check_destination(0.0, rad(angle_deg), None, MODULO)
    assert (refused is None) is open_
    if refused is not None:
        assert refused.values["allowed"].values == {"low": -360.0, "high": 360.0}
        assert refused.values["measured"].values == {"value": pytest.approx(angle_deg)}


def test_an_angle_within_the_window_the_other_way_counts_as_reached():
    """A window of a quarter of a rad: at it the way back, beyond it once round."""
    window = 0.25
    assert way_to(0.0, -window, Direction.POSITIVE, window) == -window
    assert way_to(0.0, math.nextafter(-window, -9.0), Direction.POSITIVE, window) == pytest.approx(
        math.tau - window
    )
    assert way_to(0.0, window, Direction.NEGATIVE, window) == window
    assert way_to(0.0, math.nextafter(window, 9.0), Direction.NEGATIVE, window) == pytest.approx(
        window - math.tau
    )


@BOTH
def test_the_way_round_a_sector_goes_the_other_way_and_may_end_at_its_edge(way):
    """From 0 rad, a sector from 1 to 2 rad: to 1 rad there is a way back, to 1.5 there is none."""
    sector = (1.0, 2.0) if way > 0.0 else (-2.0, -1.0)
    travel = TravelSettings(-math.inf, math.inf, -math.inf, math.inf, no_go_rad=(sector,))
    beyond = check_target(0.0, way * 2.5, travel)
    assert beyond.values["round"].values == {"way": pytest.approx(deg(way * (2.5 - math.tau)))}
    edge = way * (1.0 - math.tau)
    assert edge + way * math.tau == way
    behind = check_target(0.0, edge, travel)
    assert behind.values["round"].values == {"way": pytest.approx(deg(way))}
    assert check_target(0.0, way * 1.5, travel).values["round"] is Words.NO_WAY_ROUND
    # Back from 5 rad past a sector from 3 to 4 rad to 2.5: forward it is 2.5 and a turn.
    travel = replace(travel, no_go_rad=((3.0, 4.0) if way > 0.0 else (-4.0, -3.0),))
    back = check_target(way * 5.0, way * 2.5, travel)
    assert back.values["round"].values == {"way": pytest.approx(deg(way * (2.5 + math.tau - 5.0)))}


@pytest.mark.parametrize("target_rad", [1e300, math.inf, -1e300])
def test_an_angle_without_measure_is_told_as_that_behind_a_sector_too(target_rad):
    sectors = ((rad(-120.0), rad(-60.0)), (rad(60.0), rad(120.0)))
    travel = replace(settings().travel, no_go_rad=sectors)
    assert check_target(0.0, target_rad, travel).code is Code.CTL_01


def test_an_angle_of_nearly_zero_is_read_without_a_minus():
    """-0.004 deg, of the axis and of the edge of a sector."""
    here, travel = rad(-0.004), settings().travel
    assert str(check_target(here, rad(200.0), travel).values["position"]) == "0.0"
    from_zero = replace(travel, no_go_rad=((rad(-0.004), rad(60.0)),))
    refused = check_target(rad(-50.0), rad(10.0), from_zero)
    assert str(refused.values["limit"]) == "0.0"
    sector = replace(travel, no_go_rad=((rad(60.0), rad(120.0)),))
    assert str(check_target(here, rad(90.0), sector).values["position"]) == "0.0"
    assert check_target(rad(1.234), rad(90.0), sector).values["position"] == 1.23
    assert check_target(rad(1.234), rad(200.0), travel).values["position"] == 1.23
    sixth = replace(travel, no_go_rad=((rad(60.126), rad(120.0)),))
    assert check_target(0.0, rad(90.0), sixth).values["limit"] == 60.13


@BOTH
def test_towards_an_open_limit_switch_less_than_a_count_is_no_way(way):
    parts = Parts()
    interlocks = Interlocks(parts.settings, parts.feedback, parts.alarms)
    interlocks.plus_open, interlocks.minus_open = way < 0.0, way > 0.0
    travel = parts.settings.travel
    for way_rad, shut in ((0.0, False), (1e-9, False), (1.4e-9, True)):
        refused = check_way(0.0, way * way_rad, travel, interlocks)
        assert (refused is not None) is shut
        if shut:
            assert refused.values["side"] is (Words.REVERSE if way > 0.0 else Words.FORWARD)


@BOTH
@pytest.mark.parametrize("speed_rad_s", [0.1, 2.0])
def test_at_the_end_of_travel_and_of_a_sector_the_open_side_is_named(way, speed_rad_s):
    travel = settings().travel
    refused = check_direction(way * rad(180.0), way * speed_rad_s, travel)
    assert refused.values["side"] is (Words.REVERSE if way > 0.0 else Words.FORWARD)
    assert refused.values["measured"] == pytest.approx(way * 180.0)
    sectors = ((rad(-120.0), rad(-60.0)), (rad(60.0), rad(120.0)))
    edge = check_direction(way * rad(60.0), way * speed_rad_s, replace(travel, no_go_rad=sectors))
    assert edge.values["limit"] == way * 60.0
    assert edge.values["begin"] == pytest.approx(min(way * 60.0, way * 120.0))


@pytest.mark.parametrize(
    ("dynamics", "name"),
    [
        (Dynamics(rad(4.1), rad(4.0), rad(50.0)), Words.NAME_ACCELERATION),
        (Dynamics(rad(4.0), rad(4.1), rad(50.0)), Words.NAME_DECELERATION),
        (Dynamics(rad(4.0), rad(4.0), rad(51.0)), Words.NAME_JERK),
    ],
)
def test_each_ramp_of_a_motion_is_at_most_that_of_the_machine(dynamics, name):
    config = settings(jerk=50.0)
    refused = check_dynamics(dynamics, config.ramps)
    assert refused.values["name"] is name
    high, got = (50.0, 51.0) if name is Words.NAME_JERK else (4.0, 4.1)
    assert refused.values["allowed"].values == {"high": pytest.approx(high)}
    assert refused.values["measured"].values == {"value": pytest.approx(got)}
    assert check_dynamics(Dynamics(rad(4.0), rad(4.0), rad(50.0)), config.ramps) is None
    rig = Rig(config=config)
    rig.power_up()
    command = rig.axis.motion.move_absolute(rad(5.0), rad(6.0), dynamics=dynamics)
    assert command.refusal == refused


def test_a_jerk_without_a_limit_is_above_0():
    assert check_jerk(0.0, math.inf).values["allowed"] is Words.ABOVE_ZERO


@pytest.mark.parametrize(
    ("holds_nm", "refused"), [(-315.0, False), (315.0, False), (-315.1, True), (315.1, True)]
)
def test_a_brake_test_may_take_all_of_the_torque_that_the_load_leaves(holds_nm, refused):
    """70 N m of 385."""
    parts = Parts()
    power = PowerSequence(parts.settings, parts.feedback, parts.alarms)
    power.holding.mean_nm = holds_nm
    found = why_no_brake_test(parts.settings.power, power, parts.feedback, parts.alarms)
    too_high = found is not None and found.values["reason"] == Words.TEST_TORQUE_TOO_HIGH(level=70.0)
    assert too_high is refused


# --- commands ---------------------------------------------------------------------------------------------------------
