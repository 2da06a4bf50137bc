"""Motions that wait, are taken over, ended or refused on their way: what becomes of each."""

import math
from dataclasses import replace

import pytest

from gantryctl.image import BufferMode, DigitalInputs, Direction, Mode
from gantryctl.program import AxisState, Code
from gantryctl.program.axis.motion_command import Aim, CommandStatus, Dynamics, Goal, MotionCommand
from gantryctl.program.axis.parameters import Parameter, read_parameter, write_parameter
from gantryctl.program.blocks import MoveAbsolute, MoveVelocity, SetOverride, Stop
from gantryctl.program.settings import StandstillPolicy, TravelSettings
from gantryctl.units import deg, rad
from unit.program.block_bench import Bench, call, standing
from unit.program.parts import BOTH
from unit.program.power_steps import P
from unit.program.rig import Rig, moving_rig, powered, press, settings
from unit.program.test_modulo import modulo

approx = pytest.approx
PARKS = {"standstill": StandstillPolicy.BRAKE, "hold_brake_after_s": 0.3}


@pytest.fixture
def parked():
    rig = Rig(config=settings(**PARKS))
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is P.PARKED, 5.0)
    return rig


def test_a_key_that_is_released_before_the_brake_is_open_moves_nothing(parked):
    parked.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(parked, forward=True)
    assert parked.axis.motion.waiting is not None
    parked.run(0.05)
    press(parked, forward=False)
    assert parked.axis.motion.waiting is None
    parked.run(2.0)
    assert parked.ref_deg == approx(0.0, abs=1e-4)


def test_what_waits_behind_a_motion_that_cannot_begin_is_dropped_with_it(parked):
    """The permit is taken away between the command and the open brake."""
    motion = parked.axis.motion
    first = motion.move_absolute(rad(5.0), rad(6.0))
    second = motion.move_absolute(rad(8.0), rad(6.0), buffer_mode=BufferMode.BUFFERED)
    assert motion.waiting is first
    assert motion.buffered is second
    parked.axis.interlocks.permitted = False
    parked.until(lambda: not first.alive, 3.0)
    assert first.status is CommandStatus.ERROR
    assert second.status is CommandStatus.ABORTED
    parked.run(1.0)
    assert parked.ref_deg == approx(0.0, abs=1e-4)


def test_paused_is_a_motion_that_override_0_holds_back_under_way_or_before_the_brake(parked):
    assert not parked.axis.paused
    parked.op(override=0.0)
    assert not parked.axis.paused, "nothing is under way"
    parked.move(5.0)
    assert parked.axis.paused
    parked.op(override=0.001)
    assert not parked.axis.paused, "the least that moves"
    parked.op(override=1.0)
    assert not parked.axis.paused
    parked.until(lambda: abs(parked.vel_deg_s) > 1.0, 5.0)
    parked.op(override=0.0)
    parked.run(2.0)
    assert parked.axis.paused
    assert parked.vel_deg_s == 0.0


def test_a_paused_motion_that_is_ended_is_over_at_once():
    rig = moving_rig()
    rig.op(override=0.0)
    rig.run(3.0)
    rig.axis.stop_by(Code.INT_05, measured=2.0, limit=1.0)
    assert rig.axis.motion.current is None
    assert rig.program.move.command is None or not rig.program.move.command.alive
    rig.op(override=1.0)
    at_deg = rig.ref_deg
    rig.run(1.0)
    assert rig.ref_deg == at_deg


def test_a_second_stop_takes_over_the_first():
    rig = standing()
    first, second = Stop(rig.axis), Stop(rig.axis)
    call(rig, first, execute=True)
    held = rig.axis.motion.stop_command
    call(rig, second, execute=True)
    assert held is not None
    assert held.status is CommandStatus.ABORTED
    assert rig.axis.motion.stop_command is second.command or second.done
    call(rig, first, execute=False)
    rig.run(0.1)
    assert rig.axis.state is AxisState.STOPPING, "the second one holds it"
    call(rig, second, execute=False)
    rig.run(0.1)
    assert rig.axis.state is AxisState.STANDSTILL


def test_an_end_of_motions_at_standstill_ends_nothing():
    rig = powered()
    rig.axis.stop_by(Code.INT_05, measured=2.0, limit=1.0)
    rig.step()
    assert rig.axis.state is AxisState.STANDSTILL
    assert rig.axis.motion.current is None


def test_no_motion_is_taken_while_power_goes_off():
    rig = moving_rig()
    rig.op(power=False)
    rig.move(10.0)
    assert rig.refused()
    rig.run(4.0)
    assert rig.axis.is_off


@BOTH
def test_a_motion_that_cannot_stop_before_the_end_of_travel_is_refused(way):
    """At 6 deg/s, 10 deg before the end, a ramp of 0.5 deg/s2 takes 36 deg."""
    rig = Rig(Bench, at_deg=way * 150.0)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 5.0)
    move = MoveAbsolute(rig.axis)
    call(rig, move, execute=True, position_rad=rad(way * 179.0), velocity_rad_s=rad(6.0))
    rig.until(lambda: way * rig.ref_deg > 170.0, 5.0)
    gentle = MoveAbsolute(rig.axis)
    call(
        rig, gentle, execute=True, position_rad=rad(way * 175.0), velocity_rad_s=rad(6.0),
        deceleration_rad_s2=rad(0.5),
    )  # fmt: skip
    assert gentle.error_id == "CTL-17"
    # Half of 36 / 0.5 beyond where it is.
    assert rig.axis.refusal.values["reason"].values["angle"] == approx(
        way * (36.0 + abs(rig.ref_deg)), abs=1.0
    )
    rig.until(lambda: move.done, 5.0)
    assert rig.pos_deg == approx(way * 179.0, abs=1e-3)


@BOTH
def test_a_stop_that_would_leave_the_travel_has_the_ramp_of_the_motion(way):
    """From 6 deg/s the motion stops with 5.4 deg/s2 in 3.33 deg, Stop with 5 in 3.6: 3.4 deg are left."""
    rig = Rig(at_deg=way * 160.0, config=settings(dec=5.4))
    rig.power_up()
    rig.move(way * 180.0)
    rig.until(lambda: way * rig.ref_deg > 176.6, 6.0)
    here, speed = way * rig.ref_deg, way * rig.vel_deg_s
    assert speed == approx(6.0, abs=0.01)
    rig.op(stop=True)
    rig.run(3.0)
    assert rig.codes == []
    assert way * rig.ref_deg == approx(here + 36.0 / (2.0 * 5.4), abs=0.01)
    assert rig.axis.state is AxisState.STOPPING


# 4 deg/s2 without a limit of jerk, for 1 deg: half of it is made when 2 deg/s are reached, after 0.5 s.
SOFT = replace(settings().ramps, jog_release_jerk_rad_s3=rad(20.0))
TAKES_LONGER = replace(settings(), ramps=SOFT)


@BOTH
@pytest.mark.parametrize("ends", [{"stop": True}, {"power": False}, {"lease": 0}])
def test_no_stop_leads_beyond_the_target_of_a_motion_that_gains_speed(way, ends):
    """After 0.4 s 0.32 deg are made and 1.6 deg/s reached: on the ramp of the motion 0.32 deg more.

    At 20 deg/s3 of its own the ramp of Stop turns the acceleration round in 0.2 s, 0.37 deg, and takes 0.65 more from
    2 deg/s: 0.34 deg beyond the target.
    """
    rig = Rig(config=TAKES_LONGER)
    rig.power_up()
    rig.move(way * 1.0)
    rig.until(lambda: abs(rig.vel_deg_s) >= 1.6 - 1e-9, 0.5)
    assert rig.ref_deg == approx(way * 0.32, abs=0.003)
    told_deg = deg(rig.axis.stopping_angle_rad())
    if "lease" in ends:
        rig.axis.stop_by(Code.CTL_15, measured=251.0, limit=250.0)
        rig.step()
    else:
        rig.op(**ends)
    rig.run(1.5)
    assert rig.ref_deg == approx(way * 0.64, abs=0.005)
    assert told_deg == approx(0.32, abs=0.005)


@BOTH
def test_a_stop_that_ends_before_the_target_has_its_own_ramp(way):
    """The same motion over 3 deg: 0.32 deg are made, and 0.373 and 0.65 more lead to 1.343."""
    rig = Rig(config=TAKES_LONGER)
    rig.power_up()
    rig.move(way * 3.0)
    rig.until(lambda: abs(rig.vel_deg_s) >= 1.6 - 1e-9, 0.5)
    rig.op(stop=True)
    rig.run(2.5)
    assert rig.ref_deg == approx(way * 1.343, abs=0.006)


def test_an_override_that_would_leave_the_travel_stays_what_it_was():
    rig = moving_rig()
    virtual = rig.axis.virtual
    virtual._travel = TravelSettings(rad(-1.0), rad(1.0), rad(-2.0), rad(2.0))
    virtual.pos_ref_rad = rad(0.5)
    refused = rig.axis.set_override(0.5)
    assert refused is not None
    assert virtual.override == 1.0


def test_an_override_that_is_no_number_is_refused_once_and_the_next_one_is_taken():
    rig = Rig()
    override = SetOverride(rig.axis)
    for _ in range(2):
        override(override=math.nan)
    assert rig.axis.refusal_count == 1
    override(override=0.5)
    assert rig.axis.virtual.override == 0.5
    assert not override.error
    override(enable=False, override=1.0)
    assert rig.axis.virtual.override == 0.5


def test_the_speed_is_reached_from_the_scan_on_in_which_it_is():
    rig = standing()
    block = MoveVelocity(rig.axis)
    call(rig, block, execute=True, velocity_rad_s=rad(-2.0))
    for _ in range(1000):
        rig.step()
        assert block.in_velocity is (abs(rig.vel_deg_s) >= 2.0 * (1.0 - 1e-9))
    assert block.in_velocity
    assert block.attention, "it may lose its speed at any time"


def test_ramps_are_set_at_rest_and_not_on_the_ramp_of_a_stop():
    rig = moving_rig()
    rig.op(stop=True)
    rig.run(0.2)
    assert rig.axis.motion.current is None
    assert abs(rig.vel_deg_s) > 1.0
    assert rig.axis.set_acceleration(rad(1.0)) is not None
    rig.op(stop=False)
    rig.run(2.0)
    assert rig.axis.set_acceleration(rad(1.0)) is None


def test_a_lower_acceleration_leaves_the_jerk_that_a_program_has_lowered():
    axis = Rig(config=settings(jerk=20.0)).axis
    assert write_parameter(axis, Parameter.MAX_JERK_APPL, rad(5.0)) is None
    assert axis.set_acceleration(0.5 * axis.settings.ramps.acc_rad_s2) is None
    assert deg(read_parameter(axis, Parameter.MAX_JERK_APPL)) == approx(5.0)
    assert axis.virtual.ramps.acc_rad_s2 == approx(0.5 * axis.settings.ramps.acc_rad_s2)


@BOTH
def test_a_key_that_was_let_go_has_not_come_to_the_end_of_travel(way):
    rig = powered()
    key = "forward" if way > 0.0 else "reverse"
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(rig, **{key: True})
    rig.hold_key(1.0)
    press(rig, **{key: False})
    rig.run(3.0)
    assert rig.vel_deg_s == 0.0
    assert not rig.program.jog.at_limit
    assert not [alarm for alarm in rig.axis.alarms.history if alarm.code is Code.LIM_01]


def test_a_motion_that_an_alarm_ends_lasts_until_the_axis_is_at_rest():
    rig = moving_rig()
    rig.axis.stop_by(Code.INT_05, measured=2.0, limit=1.0)
    while rig.vel_deg_s:
        rig.step()
        assert rig.axis.state is AxisState.DISCRETE_MOTION or not rig.vel_deg_s
    rig.run(0.01)
    assert rig.axis.state is AxisState.STANDSTILL


@pytest.mark.parametrize("left_deg", [3.0, 0.05])
def test_a_stop_is_not_taken_back_by_the_override_however_near_the_end_it_comes(left_deg):
    """Its own ramp of 5.4 deg/s2 is the nearer one near the end, Stop's has 5; it is a stop from then on."""
    rig = Rig(config=settings(dec=5.4))
    rig.power_up()
    rig.move(10.0)
    rig.until(lambda: rig.ref_deg > 10.0 - left_deg, 5.0)
    rig.op(stop=True)
    ends_at = rig.axis.virtual.plan.pos_end
    rig.op(override=0.0)
    rig.run(2.0)
    assert rig.axis.virtual.pos_ref_rad == approx(ends_at)
    assert not rig.axis.paused
    assert rig.program.stop.done
    rig.op(override=1.0)
    rig.run(0.5)
    assert rig.axis.virtual.pos_ref_rad == approx(ends_at)


def test_a_new_speed_is_that_of_the_command_from_then_on():
    rig = moving_rig()
    command = rig.axis.motion.current
    assert rig.axis.motion.change_speed(command, rad(3.0)) is None
    assert command.speed_rad_s == rad(3.0)
    assert rig.axis.motion.change_speed(command, rad(7.0)) is not None
    assert command.speed_rad_s == rad(3.0)


@BOTH
def test_a_relative_motion_counts_from_the_set_point_and_an_additive_one_from_the_target(way):
    rig = moving_rig(at_deg=0.0 if way > 0.0 else 60.0)
    motion, target_rad = rig.axis.motion, rig.axis.motion.current.target_rad
    here = rig.axis.virtual.pos_ref_rad
    assert motion.move_additive(way * rad(2.0), rad(6.0)).target_rad == approx(target_rad + way * rad(2.0))
    assert motion.move_relative(way * rad(20.0), rad(6.0)).target_rad == approx(here + way * rad(20.0))


def test_no_motion_is_taken_in_the_scan_of_an_alarm_that_stops_the_axis():
    """Raised by the program's own logic: the axis acts on it in the next scan."""
    rig = moving_rig()
    rig.axis.alarms.raise_(Code.CTL_02, measured="a test")
    command = rig.axis.motion.move_absolute(rad(5.0), rad(6.0))
    assert command.status is CommandStatus.ERROR
    assert rig.axis.motion.halt().status is CommandStatus.ERROR


def test_what_comes_to_rest_has_no_speed_that_a_cap_could_forbid():
    rig = moving_rig()
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.op(halt=True, remote=True)
    assert rig.axis.motion.current.speed_rad_s == 0.0
    rig.until(lambda: rig.program.halt.done, 5.0)
    assert Code.INT_05 not in {alarm.code for alarm in rig.axis.alarms.history}


def test_a_motion_that_override_0_holds_back_is_judged_again_before_it_goes_on():
    rig = moving_rig()
    assert rig.axis.set_override(1.0) is None
    rig.op(override=0.0)
    rig.run(3.0)
    rig.axis.interlocks.permitted = False
    assert rig.axis.set_override(1.0) is not None
    assert rig.axis.virtual.override == 0.0
    rig.axis.interlocks.permitted = True
    assert rig.axis.set_override(1.0) is None
    rig.run(0.5)
    assert abs(rig.vel_deg_s) > 1.0


def test_a_motion_under_way_is_made_slower_also_where_it_would_not_be_begun():
    rig = moving_rig()
    rig.axis.interlocks.permitted = False
    assert rig.axis.set_override(0.5) is None
    assert rig.axis.virtual.override == 0.5


def test_a_stop_at_standstill_begins_no_stop_and_moves_no_end_of_the_last_motion():
    rig = powered()
    rig.move(1.0)
    rig.run(4.0)
    end_s = rig.axis.plan_end_s
    rig.op(halt=True)
    assert not rig.axis.virtual.stopping
    assert rig.axis.plan_end_s == end_s


@pytest.mark.parametrize(("override", "moves"), [(0.0011, True), (0.0009, False)])
def test_an_override_below_a_thousandth_holds_the_motion_back(override, moves):
    rig = powered()
    rig.op(override=override)
    rig.move(1.0)
    rig.run(0.1)
    assert (rig.ref_deg > 0.0) is moves
    assert rig.axis.paused is not moves


def test_an_alarm_takes_the_place_of_power_that_is_going_off():
    rig = powered()
    rig.move(50.0)
    rig.run(2.0)
    rig.op(power=False)
    assert rig.axis.motion.switching_off
    rig.axis.alarms.raise_(Code.CTL_03)
    rig.step()
    assert not rig.axis.motion.switching_off
    rig.run(3.0)
    assert rig.axis.is_off


def test_a_command_that_has_not_begun_goes_nowhere():
    command = MotionCommand(AxisState.STANDSTILL)
    assert (command.target_rad, command.speed_rad_s, command.refusal, command.follower) == (
        0.0,
        0.0,
        None,
        None,
    )
    assert command.alive
    assert (command.endless, command.settles, command.held) == (False, False, False)


def test_half_of_the_speed_is_the_speed_at_half_of_the_override():
    rig = standing()
    assert rig.axis.set_override(0.5) is None
    block = MoveVelocity(rig.axis)
    call(rig, block, execute=True, velocity_rad_s=rad(2.0))
    for _ in range(1000):
        rig.step()
        assert block.in_velocity is (rig.vel_deg_s >= 1.0 * (1.0 - 1e-9))
    assert block.in_velocity


def test_a_new_speed_of_a_gentle_motion_keeps_its_ramps():
    """1 deg/s2 of 4: from 1 to 3 deg/s in 2 s."""
    rig = standing()
    rig.axis.motion.move_absolute(rad(100.0), rad(1.0), dynamics=Dynamics(acc_rad_s2=rad(1.0)))
    rig.run(2.0)
    assert rig.vel_deg_s == approx(1.0)
    assert rig.axis.motion.change_speed(rig.axis.motion.current, rad(3.0)) is None
    rig.run(1.0)
    assert rig.vel_deg_s == approx(2.0, abs=0.002)


def test_the_point_of_rest_is_that_of_the_ramp_of_the_machine():
    """From 2 deg/s at 4 deg/s2 half a degree on, however gently the motion itself would end."""
    rig = standing()
    rig.axis.motion.move_absolute(rad(100.0), rad(2.0), dynamics=Dynamics(dec_rad_s2=rad(0.5)))
    rig.run(2.0)
    virtual = rig.axis.virtual
    assert math.degrees(virtual.rest_point_rad() - virtual.pos_ref_rad) == approx(0.5, abs=1e-6)


def test_a_motion_that_waits_for_the_brake_is_no_rest(parked):
    """Neither the mode nor the angle is changed between a key and the motion that it begins."""
    parked.op(mode=Mode.INCREMENTAL)
    parked.move(5.0)
    assert parked.axis.motion.waiting is not None
    assert not parked.axis.at_rest
    assert parked.axis.set_position(rad(1.0)) is not None
    parked.op(mode=Mode.CONTINUOUS)
    assert parked.program.mode is Mode.INCREMENTAL


def test_a_way_from_a_new_zero_counts_from_there(parked):
    """In one scan, behind the brake."""
    assert parked.axis.set_position(rad(5.0)) is None
    assert parked.axis.motion.move_relative(rad(1.0), rad(6.0)).target_rad == approx(rad(6.0))


def test_what_was_asked_for_ends_with_the_alarm_that_stops_the_axis(parked):
    """Under way and behind it; and what waits for the brake."""
    rig = moving_rig()
    motion = rig.axis.motion
    commands = [motion.current, motion.move_relative(rad(1.0), rad(6.0), buffer_mode=BufferMode.BUFFERED)]
    rig.op(quick_stop=True)
    commands.append(parked.axis.motion.move_absolute(rad(5.0), rad(6.0)))
    parked.op(quick_stop=True)
    for command in commands:
        assert command.status is CommandStatus.ERROR
        assert command.refusal.code is Code.INT_06
    assert (motion.current, motion.buffered, parked.axis.motion.waiting) == (None, None, None)
    held = moving_rig()
    held.op(stop=True)
    command = held.axis.motion.stop_command
    held.op(quick_stop=True)
    assert command.status is CommandStatus.ERROR
    assert held.axis.motion.stop_command is None


def test_an_acceleration_is_not_changed_while_override_0_holds_a_motion_back():
    rig = moving_rig()
    rig.op(override=0.0)
    rig.until(lambda: rig.vel_deg_s == 0.0, 3.0)
    rig.run(0.5)
    assert rig.axis.virtual.at_rest
    assert rig.axis.set_acceleration(rad(1.0)) is not None


def test_a_stop_that_is_done_is_not_made_an_error_by_an_alarm():
    rig = powered()
    rig.op(stop=True)
    rig.run(0.1)
    assert rig.program.stop.done
    command = rig.axis.motion.stop_command
    rig.op(quick_stop=True)
    assert command.status is CommandStatus.DONE


def test_a_motion_that_waits_for_the_brake_has_no_speed_at_override_0(parked):
    parked.op(override=0.0)
    command = parked.axis.motion.move_velocity(rad(6.0))
    assert parked.axis.motion.waiting is command
    assert not parked.axis.motion.in_velocity(command)


def test_a_motion_that_override_0_holds_back_is_not_at_its_speed():
    rig = powered()
    command = rig.axis.motion.move_velocity(rad(6.0))
    rig.run(2.0)
    assert rig.axis.motion.in_velocity(command)
    rig.op(override=0.0)
    rig.run(2.0)
    assert rig.axis.motion.current is command
    assert rig.axis.virtual.at_rest
    assert not rig.axis.motion.in_velocity(command)


def test_an_end_of_motions_ends_what_waits_for_the_brake_too(parked):
    command = parked.axis.motion.move_absolute(rad(5.0), rad(6.0))
    reason = parked.axis.alarms.note(Code.INT_05, measured=2.0, limit=1.0)
    parked.axis.motion.stop_by(reason)
    assert command.status is CommandStatus.ERROR
    assert command.refusal is reason
    assert parked.axis.motion.waiting is None
    parked.run(1.0)
    assert parked.ref_deg == approx(0.0, abs=1e-4)


def test_a_speed_that_is_ended_shows_as_a_speed_until_the_axis_rests():
    rig = powered()
    rig.axis.motion.move_velocity(rad(6.0))
    rig.run(2.0)
    rig.axis.motion.stop_by(rig.axis.alarms.note(Code.INT_05, measured=2.0, limit=1.0))
    rig.run(0.5)
    assert rig.vel_deg_s > 0.5
    assert rig.axis.state is AxisState.CONTINUOUS_MOTION


def test_an_end_of_motions_leaves_a_stop_that_holds_the_axis():
    rig = moving_rig()
    rig.op(stop=True)
    rig.run(0.1)
    rig.axis.motion.stop_by(rig.axis.alarms.note(Code.INT_05, measured=2.0, limit=1.0))
    rig.run(0.1)
    assert rig.axis.state is AxisState.STOPPING
    assert rig.program.stop.busy
    assert rig.axis.motion.stop_command is not None


@pytest.mark.parametrize("speed_rad_s", [0.0, -1.0, math.nan])
def test_a_speed_that_is_none_is_refused_while_the_brake_test_is_overdue_too(speed_rad_s):
    rig = powered()
    rig.axis.judge_brake(overdue=True)
    assert rig.axis.motion.check_speed(speed_rad_s).code is Code.CTL_01
    assert rig.axis.motion.check_speed(rad(1.0)) is None
    assert rig.axis.motion.check_speed(rad(1.01)).code is Code.BRK_12


def test_of_two_ways_of_half_a_turn_a_move_without_a_direction_takes_the_positive_one():
    rig = Rig(config=modulo())
    rig.power_up()
    command = rig.axis.motion.move_absolute(-math.pi, rad(6.0))
    assert command.target_rad == approx(math.pi)


@BOTH
def test_the_direction_is_that_of_the_turning_axis_and_at_rest_that_of_its_last_motion(way):
    back_way, on_way = (
        (Direction.NEGATIVE, Direction.POSITIVE) if way > 0.0 else (Direction.POSITIVE, Direction.NEGATIVE)
    )
    rig = Rig(at_deg=100.0 * way, config=modulo())
    rig.power_up()
    motion = rig.axis.motion
    back = motion.move_absolute(way * rad(50.0), rad(6.0), back_way)
    rig.until(lambda: back.status is CommandStatus.DONE, 20.0)
    at_rest = motion.move_absolute(way * rad(80.0), rad(6.0), Direction.CURRENT)
    assert deg(at_rest.target_rad) == approx(way * (80.0 - 360.0))
    rig.run(0.1)
    assert way * rig.vel_deg_s < 0.0
    # Turned round, it still goes on for a moment.
    motion.move_absolute(way * rad(200.0), rad(6.0), on_way)
    assert way * rig.vel_deg_s < 0.0
    turning = motion.move_absolute(way * rad(80.0), rad(6.0), Direction.CURRENT)
    assert deg(turning.target_rad) == approx(way * (80.0 - 360.0))


@pytest.mark.parametrize(
    ("aim", "endless", "settles"),
    [
        (None, False, False),
        (Aim(Goal.SPEED, 1.0), True, False),
        *((Aim(goal, 1.0), False, True) for goal in list(Goal)[:3]),
    ],
)
def test_a_motion_to_an_angle_settles_and_one_with_a_speed_has_no_end(aim, endless, settles):
    command = MotionCommand(AxisState.DISCRETE_MOTION, aim)
    assert (command.endless, command.settles) == (endless, settles)
