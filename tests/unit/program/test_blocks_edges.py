"""Blocks at the edges of their inputs: what is refused, what shows and for how long, and whose value is told."""

import math
from typing import Any

import pytest

from gantryctl.image import DigitalInputs, Direction
from gantryctl.program import AxisState, Code, PowerPhase
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import inside_turn
from gantryctl.program.axis.parameters import Parameter, read_parameter, write_parameter
from gantryctl.program.blocks import (
    BrakeTest,
    Cam,
    DigitalCamSwitch,
    Jog,
    MoveAdditive,
    MoveRelative,
    MoveVelocity,
    ReadActualPosition,
    ReadAxisError,
    ReadBoolParameter,
    ReadParameter,
    TouchProbe,
    WriteParameter,
)
from gantryctl.program.settings import StandstillPolicy, TravelSettings
from gantryctl.units import deg, rad
from unit.program.asked_axis import Asked
from unit.program.block_bench import Bench, call, outputs, standing
from unit.program.brake_rig import PASSED, TestRig
from unit.program.parts import BOTH
from unit.program.rig import Rig, moving_rig, powered, settings
from unit.program.test_blocks_position import modulo_rig


@pytest.fixture
def rig() -> Rig:
    return standing()


# --- what people see ------------------------------------------------------------------------------


def test_a_move_whose_key_is_released_is_shown_as_done_for_one_scan():
    rig = powered()
    rig.move(1.0)
    rig.until(lambda: rig.program.move.done)
    rig.step()
    assert outputs(rig.program.move) == set()


def test_an_alarm_while_power_comes_up_is_an_error_of_power():
    rig = Rig()
    rig.op(power=True)
    rig.run(0.02)
    assert rig.axis.power.phase not in (PowerPhase.OFF, PowerPhase.ON)
    rig.drive.inputs = DigitalInputs(mains_ready=False)
    rig.run(0.01)
    assert rig.program.power.error_id is Code.PWR_01
    assert not rig.program.power.status


def test_the_error_of_the_axis_is_the_first_alarm_and_not_the_last(rig: Rig) -> None:
    error = ReadAxisError(rig.axis)
    call(rig, error)
    rig.axis.quick_stop()
    rig.step()
    rig.drive.inputs = DigitalInputs(mains_ready=False)
    rig.step()
    assert rig.codes == ["INT-06", "PWR-01"]
    assert error.axis_error_id is Code.INT_06


def test_the_measured_angle_of_a_modulo_axis_is_told_within_its_turn() -> None:
    rig = modulo_rig()
    rig.program.calls[position := ReadActualPosition(rig.axis)] = {}
    move = MoveRelative(rig.axis)
    call(rig, move, execute=True, distance_rad=rad(-2.0), velocity_rad_s=rad(6.0))
    rig.until(lambda: move.done)
    assert deg(position.value) == pytest.approx(358.0, abs=1e-3)


def test_a_way_inside_the_turn_is_judged_by_the_angle_that_people_read() -> None:
    endless = TravelSettings(-math.inf, math.inf, -math.inf, math.inf, 0.0)
    for turns in (-2.0, 0.0, 3.0):
        here = rad(10.0) + turns * math.tau
        assert inside_turn(here, rad(20.0), endless) is Direction.POSITIVE
        assert inside_turn(here, rad(5.0), endless) is Direction.NEGATIVE


# --- by hand --------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad_deg_s", [-2.0, 7.0, math.nan])
def test_a_key_with_a_speed_that_is_none_moves_nothing(rig: Rig, bad_deg_s: float) -> None:
    """The keys give the sign: a negative speed is not the other direction."""
    jog = Jog(rig.axis)
    call(rig, jog, forward=True, backward=False, velocity_rad_s=rad(bad_deg_s))
    assert outputs(jog) == {"error"}
    rig.run(0.1)
    assert rig.vel_deg_s == 0.0


# --- ramps of one motion --------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [MoveRelative, MoveAdditive])
def test_a_motion_by_a_way_takes_the_ramps_that_it_was_given(rig: Rig, kind: type) -> None:
    block = kind(rig.axis)
    ramps = {"acceleration_rad_s2": rad(2.0), "deceleration_rad_s2": rad(1.0)}
    call(rig, block, execute=True, distance_rad=rad(1.0), velocity_rad_s=rad(6.0), **ramps)
    most, least = 0.0, 0.0
    while block.busy:
        rig.step()
        most = max(most, deg(rig.axis.virtual.acc_ref_rad_s2))
        least = min(least, deg(rig.axis.virtual.acc_ref_rad_s2))
    assert (most, least) == (pytest.approx(2.0), pytest.approx(-1.0))


def test_a_speed_takes_the_ramp_that_it_was_given(rig: Rig) -> None:
    block = MoveVelocity(rig.axis)
    call(rig, block, execute=True, velocity_rad_s=rad(3.0), acceleration_rad_s2=rad(2.0))
    rig.run(1.0)
    # 2 deg/s2 for 1 s.
    assert rig.vel_deg_s == pytest.approx(2.0, abs=0.01)


# --- probe, cams, parameters ----------------------------------------------------------------------


def test_a_level_that_rose_before_the_probe_was_armed_is_no_edge(rig: Rig) -> None:
    probe = TouchProbe(rig.axis)
    for trigger in (False, True, True):
        call(rig, probe, execute=False, trigger=trigger)
    call(rig, probe, execute=True, trigger=True)
    assert outputs_of(probe) == (True, False)


def outputs_of(probe: TouchProbe) -> tuple[bool, bool]:
    return probe.busy, probe.done


def test_the_probe_keeps_what_was_measured_and_not_what_was_asked_for(rig: Rig) -> None:
    probe, move = TouchProbe(rig.axis), MoveRelative(rig.axis)
    call(rig, move, execute=True, distance_rad=rad(5.0), velocity_rad_s=rad(6.0))
    rig.run(0.3)
    call(rig, probe, execute=True, trigger=False)
    call(rig, probe, execute=True, trigger=True)
    assert probe.recorded_position_rad == rig.axis.pos_act_rad
    assert probe.recorded_position_rad != rig.axis.virtual.pos_ref_rad


@pytest.mark.parametrize("set_point", [True, False])
def test_cams_of_the_set_point_need_no_reading(rig: Rig, set_point: bool) -> None:
    cams = DigitalCamSwitch(rig.axis, [[Cam(rad(-5.0), rad(5.0))]], set_point=set_point)
    call(rig, cams)
    assert cams.outputs == (True,)
    rig.spoil = lambda feedback: feedback._replace(pos_act_counts=feedback.pos_act_counts + 1e9)
    rig.run(0.1)
    # Without power the set-point goes where the reading goes, out of the cam.
    assert (cams.in_operation, cams.outputs) == (set_point, (False,))


def test_the_error_of_a_parameter_goes_with_execute(rig: Rig) -> None:
    write = WriteParameter(rig.axis)
    call(rig, write, execute=True, parameter_number=-1, value=1.0)
    assert write.error
    call(rig, write, execute=False, parameter_number=-1, value=1.0)
    assert not write.error


def test_no_parameter_changes_while_a_motion_waits_for_the_brake() -> None:
    rig = Rig(Bench, config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.3))
    rig.until(lambda: rig.axis.power.parked, 5.0)
    write, move = WriteParameter(rig.axis), MoveRelative(rig.axis)
    call(rig, move, execute=True, distance_rad=rad(1.0), velocity_rad_s=rad(6.0))
    assert (move.busy, move.active) == (True, False)
    call(rig, write, execute=True, parameter_number=Parameter.MAX_VELOCITY_APPL, value=rad(1.0))
    assert (write.error, write.done) == (True, False)


# --- brake test -----------------------------------------------------------------------------------


def test_a_second_key_during_a_brake_test_changes_nothing() -> None:
    rig = TestRig()
    rig.begin()
    rig.run(0.2)
    rig.op(brake_test=True)
    block = rig.program.brake_test
    assert (block.busy, block.error) == (True, False)
    rig.until(lambda: not block.busy)
    assert block.done
    assert rig.result.outcome is PASSED


def test_a_refused_brake_test_is_shown_until_its_key_is_released(rig: Rig) -> None:
    test = BrakeTest(rig.axis)
    call(rig, test, execute=True)
    assert test.error
    call(rig, test, execute=True)
    assert test.error
    call(rig, test, execute=False)
    assert not test.error
    assert rig.axis.state is AxisState.STANDSTILL


# --- what has ended does not begin again ----------------------------------------------------------


@pytest.mark.parametrize("key", [{"forward": True}, {"backward": True}])
def test_a_new_speed_after_the_key_was_released_moves_nothing_on(rig: Rig, key: dict[str, bool]) -> None:
    jog = Jog(rig.axis)
    pressed = {"forward": False, "backward": False} | key
    call(rig, jog, **pressed, velocity_rad_s=rad(4.0))
    rig.run(1.5)
    call(rig, jog, forward=False, backward=False, velocity_rad_s=rad(4.0))
    rig.run(0.1)
    before = abs(rig.vel_deg_s)
    call(rig, jog, forward=False, backward=False, velocity_rad_s=rad(6.0))
    rig.run(0.1)
    assert abs(rig.vel_deg_s) < before
    rig.run(1.0)
    assert rig.vel_deg_s == 0.0


@BOTH
def test_the_following_error_that_trips_is_told_for_either_direction_and_in_motion_no_number_is_taken_for_another(
    way,
):
    """0.03 deg, and 12 ms of 6 deg/s."""
    rig = moving_rig(at_deg=-50.0 * way)
    assert deg(read_parameter(rig.axis, Parameter.MAX_POSITION_LAG)) == pytest.approx(0.03 + 0.012 * 6.0)
    assert write_parameter(rig.axis, 99, 1.0).values["reason"] == Words.NO_PARAMETER(number=99)


@pytest.mark.parametrize(
    ("kind", "number", "value"), [(ReadParameter, 8, rad(6.0)), (ReadBoolParameter, 4, True)]
)
def test_a_parameter_is_valid_where_it_is_one_and_the_block_enabled(
    kind: Any, number: int, value: object
) -> None:
    block = kind(Asked())
    for enable, asked, valid in (
        (True, number, True),
        (False, number, False),
        (True, 99, False),
        (False, 99, False),
    ):
        block(enable=enable, parameter_number=asked)
        assert (block.valid, block.error) == (valid, enable and not valid)
        if valid:
            assert block.value == pytest.approx(value)
        else:
            assert block.value is False or math.isnan(block.value)
