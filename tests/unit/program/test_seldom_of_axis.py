"""What comes seldom in the axis, in the state that a rare event leaves it in; figures by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import pytest

from gantryctl.image import (
    BufferMode,
    DigitalInputs,
    Direction,
    Mode,
)
from gantryctl.program import AxisProgram, AxisState
from gantryctl.program.alarms.codes import Code
from gantryctl.program.axis.command_checks import check_direction, inside_turn, way_to
from gantryctl.program.axis.motion_command import CommandStatus
from gantryctl.program.axis.reference import Reference
from gantryctl.program.axis.turns import Turns
from gantryctl.program.blocks import MoveAbsolute, Power
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import deg, rad
from unit.program.parts import BOTH, Parts
from unit.program.power_steps import P
from unit.program.rig import RATIO, Rig, moving_rig, powered, press, settings
from unit.program.test_modulo import modulo

approx = pytest.approx


def test_the_lamp_is_on_from_the_first_scan_of_power_to_the_last():
    """While torque is proven behind the closed brake nothing follows yet."""
    rig = Rig()
    rig.step()
    assert not rig.output.lamp
    rig.op(power=True)
    while rig.axis.power.phase is not P.ON:
        rig.step()
        assert rig.output.lamp, rig.axis.power.phase
    rig.op(power=False)
    while not rig.axis.is_off:
        assert rig.output.lamp, rig.axis.power.phase
        rig.step()
    assert not rig.output.lamp


@BOTH
@pytest.mark.parametrize("closed", [False, True])
def test_a_count_that_stands_under_torque_while_the_brake_closes_is_frozen_as_long_as_it_is_open(closed, way):
    """40 N m more than the load needs, 15 are permitted; behind the brake the torque turns nothing."""
    rig = Rig(config=settings(monitors={"torque_still_max_nm": 15.0}))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.CLOSING, 0.1)
    rig.spoil = lambda drive: drive._replace(torque_act_nm=way * 40.0, brake_open=not closed)
    rig.run(0.1)
    assert rig.axis.power.phase is (P.CLOSING if closed else P.TORQUE_OFF)
    assert rig.codes == ([] if closed else ["ENC-02"])


@BOTH
def test_a_count_that_stands_in_a_quick_stop_behind_a_contact_that_lies_is_frozen(way):
    """It says closed for 0.3 s of a free motion, so the brake explains no count that stands under 40 N m."""
    rig = moving_rig(config=settings(monitors={"torque_still_max_nm": 15.0, "speed_change_max_rad_s2": 1e9}))
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.until(lambda: rig.axis.power.phase is P.QUICK_STOPPING, 0.5)
    assert rig.codes == ["BRK-05"]
    # Slower than what any standing count is believed from, 0.12 deg/s: only the torque shows it.
    rig.until(lambda: abs(rig.axis.feedback.vel_rad_s) < rad(0.1), 1.5)
    counts = rig.axis.feedback.counts
    rig.spoil = lambda drive: drive._replace(
        brake_open=False, torque_act_nm=way * 40.0, pos_act_counts=counts, vel_act_rad_s=0.0
    )
    rig.run(0.035)
    assert rig.axis.power.phase is P.TORQUE_OFF
    assert "ENC-02" in rig.codes


def test_an_axis_that_does_not_follow_has_no_following_error():
    rig = moving_rig()
    rig.axis.pos_err_rad = rad(0.1)
    rig.axis.quick_stop()
    assert rig.axis.pos_err_rad == 0.0


@BOTH
def test_the_way_to_rest_is_that_of_a_released_key(way):
    """From 6 deg/s by 5 deg/s2 3.6 deg, and 0.15 deg more for the ramp of the deceleration by 100 deg/s3."""
    rig = moving_rig(at_deg=-50.0 * way)
    assert deg(rig.axis.stopping_angle_rad()) == approx(3.6 + 0.5 * 6.0 * 5.0 / 100.0, abs=0.01)


@BOTH
def test_what_waits_behind_a_motion_that_the_travel_ends_is_dropped(way):
    """Begun 2 deg before the end of travel: 6 deg/s are never reached, so what waits for them never begins."""
    rig = Rig(at_deg=178.0 * way)
    rig.power_up()
    motion = rig.axis.motion
    speed = motion.move_velocity(way * rad(6.0))
    back = motion.move_absolute(0.0, rad(6.0), buffer_mode=BufferMode.BUFFERED)
    rig.until(lambda: not speed.alive, 5.0)
    assert back.status is CommandStatus.ABORTED
    rig.run(1.0)
    assert abs(rig.ref_deg) == approx(180.0)


def test_a_motion_behind_a_stop_follows_the_override_again():
    rig = moving_rig()
    rig.op(stop=True)
    rig.until(lambda: rig.vel_deg_s == 0.0, 3.0)
    rig.op(stop=False)
    rig.run(0.1)
    rig.move(rig.ref_deg + 60.0)
    rig.run(2.5)
    rig.op(override=0.5)
    rig.run(1.5)
    assert rig.vel_deg_s == approx(3.0)


@pytest.mark.parametrize(("override", "moves"), [(0.001, True), (math.nextafter(0.001, 0.0), False)])
def test_an_override_of_a_thousandth_is_the_least_that_moves(override, moves):
    rig = powered()
    rig.op(override=override)
    rig.move(5.0)
    rig.run(0.5)
    assert rig.vel_deg_s == (approx(0.006) if moves else 0.0)
    assert rig.axis.paused is not moves


def test_a_turn_is_taken_back_at_constant_speed_only():
    """A speed is asked for as the set-point passes it on a ramp: it goes beyond, and comes back by its jerk."""
    virtual = VirtualAxis(modulo())
    virtual.follow_from(0.0, 0)
    speed = rad(100.0)
    virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2 = speed, rad(50.0)
    assert virtual.move_to(math.inf, speed, virtual.ramps.below(None, None, rad(100.0)), 0) is None
    assert virtual.vel_ref_rad_s == virtual.plan.vel_end == speed
    assert not virtual.cruising
    virtual.sample(60_000)
    assert virtual.cruising


def test_a_new_zero_begins_its_turns_anew():
    turns = Turns(Fraction(100), 0.0)
    assert turns.move_on(2) == 200.0
    assert turns.begin(50.0) == 50.0
    assert turns.move_on(1) == 150.0


@pytest.mark.parametrize(("counts", "kept"), [(20, 30), (79, 30), (81, 130), (-19, 1030), (-21, 930)])
def test_the_zero_is_kept_half_a_turn_at_most_from_where_the_axis_rests(counts, kept):
    """Turns of 100 counts, 0 deg at 30, a range of 1000: within it, -19 is 981 and -21 is 979."""
    assert Turns(Fraction(100), 30.0).kept_zero(counts, 1000) == kept


def test_at_rest_a_turn_is_taken_back_beyond_one_and_a_half():
    turns = Turns(Fraction(100), 0.0)
    for way in (1.0, -1.0):
        assert turns.due(way * 1.5 * math.pi, resting=True, cruising=False) == 0
        assert turns.due(way * math.nextafter(1.5 * math.pi, 9.0), resting=True, cruising=False) == way


def test_a_motion_without_an_end_is_taken_back_every_thousand_turns():
    turns = Turns(Fraction(100), 0.0)
    for way in (1.0, -1.0):
        assert turns.due(way * 999.9 * math.tau, resting=False, cruising=True) == 0
        assert turns.due(way * 1000.4 * math.tau, resting=False, cruising=True) == way * 1000
        assert turns.due(way * 5000.0 * math.tau, resting=False, cruising=False) == 0, "on a ramp"


def test_a_wrap_near_the_travel_is_told_in_degrees():
    """The encoder stands 0.1 deg of the gantry behind its own zero: called -180 deg, the end of travel is as near."""
    parts = Parts()
    turns = 0.1 / 360.0 * RATIO
    parts.feedback.counts = turns * 2048 * 2048
    refused = Reference(parts.settings, parts.feedback, None).check(rad(-180.0), standing=True)
    assert refused is not None
    assert refused.values["reason"].values == approx({"margin": 0.1, "limit": 5.0})


def test_half_a_turn_less_the_window_is_the_shortest_way_back():
    """An angle that lies less than the window beyond half a turn the other way is reached forward."""
    window = rad(0.005)
    limit = window - math.pi
    assert way_to(0.0, limit, Direction.SHORTEST, window) == limit
    assert way_to(0.0, math.nextafter(limit, -9.0), Direction.SHORTEST, window) == approx(math.pi + window)


def test_a_move_of_the_local_operator_needs_no_enabling_switch():
    """Above 1 deg/s a remote one does."""
    rig = powered()
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.run(0.01)
    rig.move(5.0)
    assert rig.axis.refusal is None
    rig.until(lambda: rig.program.move.done, 5.0)
    assert rig.pos_deg == approx(5.0, abs=0.005)


@pytest.mark.parametrize(("name", "level"), [("halt", "halt"), ("stop", "stop"), ("move", "move")])
def test_the_end_of_a_command_shows_while_its_level_stays_and_nothing_else_changes(name, level):
    rig = powered()
    rig.move(20.0)
    rig.run(2.0)
    rig.op(**{level: True}, target_rad=rad(21.0))
    assert getattr(rig.program, name).busy
    rig.run(6.0)
    assert getattr(rig.program, name).done
    assert not getattr(rig.program, name).busy


@BOTH
def test_a_way_begins_at_the_set_point_also_of_a_motion_under_way(way):
    """On the way to 20 deg; on from there goes MoveAdditive alone."""
    rig = powered()
    rig.move(way * 20.0)
    rig.run(3.0)
    here = rig.axis.virtual.pos_ref_rad
    command = rig.axis.motion.move_relative(way * rad(5.0), rad(6.0))
    assert command.target_rad == approx(here + way * rad(5.0))


@BOTH
def test_an_increment_may_be_the_whole_travel(way):
    rig = Rig(at_deg=-180.0 * way)
    rig.power_up()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(360.0))
    press(rig, **{"forward" if way > 0.0 else "reverse": True})
    assert rig.program.inch.busy
    assert rig.program.inch.command.target_rad == approx(rad(180.0) * way)


@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_an_increment_is_done_as_long_as_its_key_is_held(key):
    rig = powered()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(1.0))
    press(rig, **{key: True})
    rig.until(lambda: rig.program.inch.done, 3.0)
    rig.run(0.1)
    rig.op(override=0.9)
    assert rig.program.inch.done
    press(rig, **{key: False})
    assert not rig.program.inch.done


@BOTH
def test_at_the_edge_of_a_sector_it_is_named_by_the_edge_that_is_met(way):
    """Between sectors from 60 and from -60 deg on, with a speed below 1 rad/s."""
    sectors = ((rad(-120.0), rad(-60.0)), (rad(60.0), rad(120.0)))
    travel = replace(settings().travel, no_go_rad=sectors)
    refused = check_direction(way * rad(60.0), way * rad(6.0), travel)
    assert refused is not None
    assert refused.code is Code.CTL_18
    assert refused.values["measured"] == approx(way * 60.0)


@pytest.mark.parametrize("target_rad", [math.nan, math.inf, -math.inf, 10.0])
def test_an_angle_that_a_modulo_axis_does_not_have_is_refused(target_rad):
    rig = Rig(config=modulo())
    rig.step()
    refused = rig.axis.motion.move_absolute(target_rad, rad(6.0)).refusal
    assert refused is not None
    assert refused.code is Code.CTL_01


def test_a_move_by_hand_that_is_too_fast_is_refused_for_that():
    rig = powered()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(rig, forward=True)
    assert rig.program.jog.busy
    refused = rig.program._check_move(rig.operator._replace(speed_rad_s=rad(100.0)))
    assert refused.code is Code.CTL_01


def test_an_axis_that_is_off_is_in_no_position():
    rig = powered()
    assert rig.axis.in_position
    rig.op(power=False)
    rig.until(lambda: rig.axis.is_off, 2.0)
    assert not rig.axis.in_position


def test_no_way_at_all_is_forward():
    assert inside_turn(rad(10.0), rad(10.0), modulo().travel) is Direction.POSITIVE
    assert inside_turn(rad(10.0), rad(9.9), modulo().travel) is Direction.NEGATIVE
    assert inside_turn(rad(10.0), rad(9.9), settings().travel) is None


def test_a_guarded_command_is_followed_by_nothing_in_that_scan():
    rig = powered()
    assert rig.axis.virtual.following
    assert rig.axis._guard(math.nan, 0.0) == (0.0, 0.0)
    assert not rig.axis.virtual.following


@pytest.mark.parametrize("keep", [False, True])
def test_a_turn_that_is_taken_back_is_kept_where_plans_are(keep):
    virtual = VirtualAxis(modulo(), keep_plans=keep)
    virtual.follow_from(7.0, 0)
    before = len(virtual.plans)
    virtual.turn_back(1, 5)
    assert virtual.pos_ref_rad == approx(7.0 - math.tau)
    assert len(virtual.plans) == before + keep


def test_a_move_by_a_way_goes_that_way_and_to_no_angle():
    rig = Rig(at_deg=20.0)
    rig.power_up()
    rig.op(move=True, relative=True, target_rad=rad(5.0), speed_rad_s=rad(6.0))
    rig.run(4.0)
    assert rig.pos_deg == approx(25.0, abs=0.005)
    assert rig.program.move_by.done
    assert not rig.program.move.done


def test_a_reset_begins_the_counts_of_the_monitors_anew():
    """Of a warning in motion nothing stops, and nothing goes on that has led to it."""
    rig = powered()
    rig.axis.alarms.raise_(Code.CTL_12, measured=1.0, limit=1.0, trip=2.0)
    assert rig.axis.monitors.rest_scans > 100
    rig.op(reset=True)
    rig.run(0.003)
    assert rig.codes == []
    assert rig.axis.monitors.rest_scans < 10


class AtOnce(AxisProgram):
    """Moves in the scan in which power is on."""

    def __init__(self, axis):
        super().__init__(axis)
        self.power, self.move = Power(axis), MoveAbsolute(axis)

    def logic(self, image):
        self.power(enable=True)
        self.move(execute=self.power.status, position_rad=rad(5.0), velocity_rad_s=rad(6.0))


def test_a_motion_of_the_scan_in_which_power_comes_on_shows_one_scan_later():
    rig = Rig(AtOnce)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 3.0)
    assert rig.program.move.active
    rig.step()
    assert rig.axis.state is AxisState.DISCRETE_MOTION


@BOTH
def test_a_command_at_its_limit_is_sent_and_one_beyond_it_stops_the_axis(way):
    """6.3 deg/s at the gantry; 385 N m."""
    for vel, torque, alarms in (
        (rad(6.3) * RATIO, 385.0, []),
        (math.nextafter(rad(6.3) * RATIO, math.inf), 0.0, ["CTL-02"]),
        (0.0, math.nextafter(385.0, math.inf), ["CTL-02"]),
    ):
        rig = powered()
        axis = rig.axis
        axis._vel_next, axis.power.torque_ff_nm = way * vel, way * torque
        output = axis.end()
        assert rig.codes == alarms
        sent = 0.0 if alarms else 1.0
        assert output.vel_cmd_rad_s == sent * way * vel


@pytest.mark.parametrize("held", [False, True])
def test_no_angle_is_given_to_an_axis_that_is_held_by_a_stop_or_an_alarm(held):
    rig = powered()
    if held:
        rig.op(stop=True)
        rig.run(0.1)
        assert rig.axis.state is AxisState.STOPPING
    else:
        rig.op(quick_stop=True)
        rig.until(lambda: rig.axis.is_off, 3.0)
        rig.run(0.1)
        assert rig.axis.state is AxisState.ERROR_STOP
    assert rig.axis.at_rest
    assert rig.axis.set_position(rad(1.0)) is not None
    assert rig.pos_deg == approx(0.0, abs=0.001)


def test_power_off_in_a_brake_test_takes_the_torque_back_before_the_drive_is_disabled():
    rig = Rig()
    rig.op(power=False)
    rig.op(brake_test=True)
    rig.until(lambda: rig.axis.power.torque_ff_nm > 50.0, 5.0)
    assert rig.axis.power.phase is P.TESTING
    rig.axis.power_off()
    phases = []

    def over():
        phases.append((rig.axis.power.phase, abs(rig.axis.power.torque_ff_nm)))
        return rig.axis.is_off

    rig.until(over, 5.0)
    assert P.UNLOADING in [phase for phase, _ in phases]
    assert max(nm for phase, nm in phases if phase is not P.TESTING) < 1.0
    assert not rig.codes


def test_a_motion_has_its_torque_in_the_scan_in_which_it_is_taken():
    """Laws that answer 1 rad/s and 7 N m to a new plan, and nothing to the one before."""
    rig = powered()
    side = rig.axis.load_side = SimpleNamespace(torque_ff_nm=0.0, begin=lambda: None, watch=None)
    side.scan = lambda virtual, counts: (0.0, 0.0, 0.0)

    def scan_again(virtual, counts):
        side.torque_ff_nm = 7.0
        return 1.0, 0.0, 0.0

    side.scan_again = scan_again
    rig.step()
    before_nm = rig.output.torque_ff_nm
    rig.op(move=True, target_rad=rad(5.0), speed_rad_s=rad(6.0))
    assert rig.output.vel_cmd_rad_s == 1.0
    assert rig.output.torque_ff_nm == approx(before_nm + 7.0)


@pytest.mark.parametrize(("counts", "kept"), [(30, 30), (80, 30), (81, 131), (-20, 1030), (-21, 929)])
def test_the_zero_of_turns_of_an_odd_count_is_kept_to_the_count(counts, kept):
    """Turns of 101 counts: as far as 50 on either side it is the zero itself."""
    assert Turns(Fraction(101), 30.0).kept_zero(counts, 1000) == kept


def test_a_stop_of_a_brake_test_is_done_at_once():
    rig = Rig()
    rig.op(brake_test=True)
    rig.until(lambda: rig.axis.power.phase is P.TESTING, 2.0)
    assert rig.axis.stop().status is CommandStatus.DONE


def test_an_axis_that_is_off_is_switched_on_in_the_scan_in_which_it_was_switched_off_once_more():
    rig = Rig()
    rig.step()
    rig.axis.power_off()
    assert rig.axis.power_on() is None
    rig.run(1.5)
    assert rig.axis.power.phase is P.ON
