"""What is taken once, and only then: commands, keys, positions, stops; by the outputs on an ideal drive."""

import math

import pytest

from gantryctl.image import DigitalInputs, DriveState, Mode
from gantryctl.program import AxisState, Code, PowerPhase, Reaction
from gantryctl.program.axis.command_checks import check_speed
from gantryctl.program.settings import StandstillPolicy
from gantryctl.units import deg, rad
from unit.program.parts import BOTH, PERIODS, in_scans
from unit.program.power_steps import P, held_again, slip
from unit.program.rig import Rig, moving_rig, powered, press, settings

approx = pytest.approx
LOAD = {"measured": 1.0, "limit": 1.0, "torque": 1.0}

# --- taken once, and only then ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "levels", [{"move": True, "relative": True, "target_rad": rad(2.0)}], ids=["move by"]
)
def test_a_level_that_stays_is_one_command(levels):
    rig = powered()
    rig.op(speed_rad_s=rad(6.0), **levels)
    rig.run(4.0)
    rig.op(override=0.9)  # another level changes: the blocks are called again
    rig.run(2.0)
    assert rig.pos_deg == approx(2.0, abs=1e-3)
    rig.op(move=False)
    rig.run(0.5)
    assert rig.pos_deg == approx(2.0, abs=1e-3)
    rig.op(move=True)
    rig.run(4.0)
    assert rig.pos_deg == approx(4.0, abs=1e-3)


def test_a_move_that_was_refused_does_not_begin_when_the_level_stays_and_something_else_changes():
    rig = powered()
    rig.op(move=True, target_rad=rad(5.0), speed_rad_s=0.0)
    assert rig.refused()
    rig.op(speed_rad_s=rad(6.0))
    rig.op(relative=True)
    rig.run(1.0)
    assert rig.ref_deg == approx(0.0, abs=1e-6)
    rig.op(move=False, relative=False)
    rig.op(move=True)
    rig.run(3.0)
    assert rig.ref_deg == approx(5.0, abs=1e-6)
    # By way of the level that stays it would go on from there.
    rig.op(relative=True)
    rig.run(3.0)
    assert rig.ref_deg == approx(5.0, abs=1e-6)


@pytest.mark.parametrize("relative", [True, False])
def test_a_move_that_needs_the_enabling_switch_is_refused_by_angle_and_by_way(relative):
    """From a remote screen, at 6 deg/s: without the switch the cap is 0.6 deg/s."""
    rig = powered()
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.run(0.01)
    rig.op(remote=True, move=True, relative=relative, target_rad=rad(5.0), speed_rad_s=rad(6.0))
    assert rig.refused()
    rig.run(0.5)
    assert rig.ref_deg == approx(0.0, abs=1e-6)


def test_a_reset_that_stays_true_resets_once():
    rig = powered()
    rig.op(power=False)
    rig.run(1.0)
    rig.op(reset=True)
    rig.run(0.1)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(1.0)
    rig.drive.inputs = DigitalInputs()
    rig.op(override=0.9)
    rig.run(1.0)
    assert rig.codes == ["INT-03"], "the level was there before the alarm"
    rig.op(reset=False)
    rig.op(reset=True)
    rig.run(0.1)
    assert rig.codes == []


def test_a_second_push_that_is_refused_takes_nothing_from_the_reset_under_way():
    """The drive takes its time to clear its fault; meanwhile an alarm locks, and the second push is refused."""
    rig = powered()
    rig.spoil = lambda drive: drive._replace(state=DriveState.FAULT, error_code=0x7300)
    rig.run(2.0)
    rig.op(power=False, reset=True)
    rig.run(0.2)
    assert rig.program.reset.busy
    rig.op(reset=False)
    rig.axis.alarms.raise_(Code.BRK_08, measured="locked")
    rig.op(reset=True)
    assert rig.refused()
    assert rig.program.reset.busy
    assert not rig.program.reset.done
    rig.spoil = None
    rig.run(0.1)
    assert rig.program.reset.done


def test_a_quick_stop_that_stays_true_stops_once_and_holds_no_reset_back():
    rig = moving_rig()
    rig.op(quick_stop=True)
    rig.run(3.0)
    rig.op(power=False, reset=True)
    rig.run(0.1)
    rig.op(reset=False)
    assert rig.codes == []
    rig.op(power=True)
    rig.run(1.0)
    assert rig.axis.power.phase is P.ON
    rig.op(quick_stop=False)
    rig.op(quick_stop=True)
    assert rig.codes == ["INT-06"]


def test_a_brake_test_that_stays_asked_for_is_made_once():
    rig = Rig(config=settings(test_torque_nm=65.0, period_s=0.004))
    rig.run(0.05)
    rig.op(brake_test=True)
    rig.run(10.0)
    assert rig.program.brake_test.done, "shown without another command"
    rig.op(override=0.9)
    rig.run(1.0)
    assert rig.axis.brake_test.count == 1


# --- keys -------------------------------------------------------------------------------------------------------------


@pytest.fixture
def continuous():
    rig = powered()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    return rig


@pytest.mark.parametrize(("first", "second"), [("forward", "reverse"), ("reverse", "forward")])
def test_a_refused_key_stays_dead_until_both_are_released(continuous, first, second):
    """No lease at first; then the other key comes with one, and the first is released."""
    rig = continuous
    rig.run(0.3)
    rig.op(**{first: True})
    assert "hold-to-run was not renewed" in rig.refused()
    refusals = rig.axis.refusal_count
    rig.op(**{second: True})
    assert rig.axis.refusal_count == refusals, "judged once, when the first was pressed"
    press(rig, **{first: False})
    rig.hold_key(0.3)
    assert rig.vel_deg_s == 0.0
    press(rig, **{second: False})
    press(rig, **{second: True})
    rig.hold_key(0.3)
    assert abs(rig.vel_deg_s) > 0.5


@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_an_increment_that_is_too_fast_without_the_enabling_switch_does_not_begin(key):
    rig = powered()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(1.01), increment_rad=rad(2.0))
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.op(**{key: True})
    assert "enabling switch" in rig.refused()
    assert rig.axis.motion.current is None
    rig.drive.inputs = DigitalInputs()
    rig.op(override=0.9)
    rig.run(0.5)
    assert rig.ref_deg == approx(0.0, abs=1e-6), "the switch comes too late: the key must be pressed again"
    rig.op(**{key: False})
    rig.op(**{key: True})
    rig.run(3.0)
    assert abs(rig.ref_deg) == approx(2.0, abs=1e-5)


def test_a_key_that_the_lease_has_stopped_stays_dead_while_it_is_held(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(0.5)
    rig.run(3.0)  # no renewal
    assert rig.vel_deg_s == 0.0
    rig.hold_key(1.0)
    assert rig.vel_deg_s == 0.0


@PERIODS
@pytest.mark.parametrize(("age_s", "left_s"), [(0.0, 0.250), (0.100, 0.150)])
def test_a_lease_that_is_old_when_it_comes_is_shorter_by_that(period_s, age_s, left_s):
    rig = Rig(config=settings(period_s=period_s))
    rig.power_up()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(rig, forward=True, lease_age_s=age_s)
    text = "hold-to-run was not renewed for"
    start = rig.scan
    rig.until(lambda: "CTL-15" in [str(alarm.code) for alarm in rig.axis.alarms.history], 1.0)
    assert (rig.scan - start) * period_s == approx(left_s, abs=2.01 * period_s)
    told = rig.axis.alarms.history[-1].measured
    # 250 ms are 252 in scans of 4.
    limit_ms = 1e3 * in_scans(0.250, period_s)
    assert f"{text} {limit_ms:.0f} ms, limit {limit_ms:.0f} ms" in told


@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_a_refused_key_stays_dead_when_something_else_changes(continuous, key):
    rig = continuous
    rig.run(0.3)
    rig.op(**{key: True})
    assert "hold-to-run was not renewed" in rig.refused()
    rig.op(override=0.9, lease=rig.operator.lease + 1)
    rig.hold_key(0.3)
    assert rig.vel_deg_s == 0.0


@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_a_key_that_is_held_over_a_change_of_the_mode_is_dead(key):
    rig = powered()
    press(rig, speed_rad_s=rad(6.0), **{key: True})
    press(rig, mode=Mode.CONTINUOUS)
    rig.hold_key(0.3)
    assert rig.vel_deg_s == 0.0
    press(rig, **{key: False})
    press(rig, **{key: True})
    rig.hold_key(0.3)
    assert abs(rig.vel_deg_s) > 0.5


def test_the_longest_way_of_a_key_that_is_lost_is_the_lease_and_the_ramp():
    """6 deg/s for 0.25 s are 1.5 deg. Then the acceleration of 4 deg/s2 falls with 100 deg/s3: 0.242 deg in 40 ms,
    up to 6.08 deg/s, and from there 3.849 deg with 5 deg/s2.
    """
    rig = powered()
    program = rig.program
    rig.op(speed_rad_s=rad(6.0))
    assert deg(program.key_lost_angle_rad()) == approx(1.5 + 0.242 + 3.849, abs=0.002)
    rig.op(speed_rad_s=rad(0.6))
    slow = deg(program.key_lost_angle_rad())
    rig.op(override=0.5)
    assert deg(program.key_lost_angle_rad()) < slow
    rig.op(override=1.0)
    # What moves faster than the setting counts with its own speed.
    for target_deg in (100.0, -100.0):
        rig.move(target_deg, 6.0)
        rig.op(speed_rad_s=rad(0.6))
        rig.run(4.0)
        assert deg(program.key_lost_angle_rad()) == approx(5.591, abs=0.002)


@pytest.mark.parametrize(("missed", "stops"), [(100, False), (250, True)])
def test_scans_that_were_missed_are_time_of_the_lease(continuous, missed, stops):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(0.5)
    rig.missed = lambda _: missed - 1
    rig.step()
    rig.missed = lambda _: 0
    rig.step()
    assert ("CTL-15" in [str(alarm.code) for alarm in rig.axis.alarms.history]) is stops


@pytest.mark.parametrize(("speed_deg_s", "stops"), [(0.99, False), (1.0, False), (1.01, True)])
@pytest.mark.parametrize("way", ["forward", "reverse"])
def test_without_the_enabling_switch_a_key_is_stopped_above_1_deg_s(continuous, speed_deg_s, stops, way):
    rig = continuous
    rig.op(speed_rad_s=rad(speed_deg_s))
    press(rig, **{way: True})
    rig.hold_key(0.5)
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.hold_key(0.6)
    assert (rig.vel_deg_s == 0.0) is stops


@pytest.mark.parametrize(("remote", "switch", "speed_deg_s", "stops"), [
    (True, False, 1.01, True), (True, False, 0.99, False), (True, True, 6.0, False), (False, False, 6.0, False),
])  # fmt: skip
def test_a_move_from_a_remote_screen_needs_the_enabling_switch_all_the_way(
    remote, switch, speed_deg_s, stops
):
    rig = powered()
    rig.op(move=True, target_rad=rad(50.0), speed_rad_s=rad(speed_deg_s), remote=remote)
    rig.op(move=False, remote=False)  # it stays remote until it has ended
    rig.run(1.0)
    assert abs(rig.vel_deg_s) > 0.5
    rig.drive.inputs = DigitalInputs(enabling_switch=switch)
    rig.run(2.0)
    assert (rig.vel_deg_s == 0.0) is stops


# --- a position that is set anew ------------------------------------------------------------------------------------


def test_no_position_is_set_while_a_motion_waits_for_the_brake():
    rig = Rig(config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.5))
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is P.PARKED, 5.0)
    rig.move(5.0)
    assert rig.axis.state is AxisState.STANDSTILL
    assert rig.axis.motion.waiting is not None
    refused = rig.axis.set_position(rad(50.0))
    assert refused is not None
    rig.until(lambda: rig.program.move.done, 6.0)
    assert rig.pos_deg == approx(5.0, abs=1e-3)
    assert rig.axis.set_position(rad(50.0)) is None
    rig.run(0.1)
    assert rig.pos_deg == approx(50.0, abs=1e-6)


def test_a_position_that_is_set_anew_is_no_slip_of_the_brake():
    rig = Rig()
    rig.run(0.5)
    assert rig.axis.set_position(rad(50.0)) is None
    rig.run(0.5)
    assert rig.codes == []
    assert rig.pos_deg == approx(50.0, abs=1e-6)
    slip(rig, 0.021)
    rig.run(0.1)
    assert rig.codes[0] == "BRK-04"


@pytest.mark.parametrize(("speed_deg_s", "refused"), [(0.09, False), (0.11, True), (-0.11, True)])
def test_a_position_is_set_of_a_shaft_that_turns_no_faster_than_a_tenth_of_a_degree_per_second(
    speed_deg_s, refused
):
    rig = Rig()
    rig.run(0.1)
    rig.axis.feedback.vel_rad_s = rad(speed_deg_s)
    assert (rig.axis.set_position(rad(10.0)) is not None) is refused


@pytest.mark.parametrize("reaction", [Reaction.QUICK_STOP, Reaction.HOLD, Reaction.TORQUE_OFF])
def test_torque_that_holds_a_load_yields_to_torque_off_alone(reaction):
    rig = held_again()
    rig.axis.alarms.raise_(Code.BRK_03 if reaction is Reaction.HOLD else Code.CTL_06, reaction, **LOAD)
    rig.run(0.02)
    off = reaction is Reaction.TORQUE_OFF
    assert (rig.axis.power.phase is P.TORQUE_HOLD) is not off
    assert rig.output.torque_ff_nm == (0.0 if off else approx(12.0))


@pytest.mark.parametrize("held", [True, False])
def test_the_brake_takes_over_no_axis_whose_stop_is_held(held):
    """Half a second of rest, and then Stopping would end with the axis parked."""
    rig = Rig(config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.5))
    rig.power_up()
    rig.op(stop=held)
    rig.run(1.5)
    assert (rig.axis.power.phase is P.ON) is held
    assert (rig.axis.state is AxisState.STOPPING) is held
    rig.op(stop=False)
    rig.run(1.5)
    assert rig.axis.power.phase is P.PARKED


@pytest.mark.parametrize(("speed_deg_s", "refused"), [
    (6.0, False), (6.01, True), (0.0, True), (-1.0, True), (math.nan, True), (math.inf, True), (0.001, False),
])  # fmt: skip
def test_a_motion_has_a_speed_above_0_and_no_more_than_the_highest_setting(speed_deg_s, refused):
    assert (check_speed(rad(speed_deg_s), rad(6.0)) is not None) is refused


# --- stops ------------------------------------------------------------------------------------------------------------


@BOTH
def test_a_weaker_stop_does_not_take_over_a_stop_under_way_and_a_harder_one_does(way):
    """Stop at 5 deg/s2 after Halt at 2, and Halt after Stop: the axis comes to rest where the harder one ends."""
    ends = {}
    for first, second in (("stop", "halt"), ("halt", "stop"), ("stop", "stop"), ("halt", "halt")):
        rig = Rig(config=settings(dec=2.0))
        rig.power_up()
        rig.move(way * 100.0, 6.0)
        rig.run(3.0)
        begun = rig.ref_deg
        rig.op(**{first: True})
        rig.run(0.1)
        rig.op(**{second: True})
        rig.run(6.0)
        ends[first, second] = way * (rig.ref_deg - begun)
        assert rig.vel_deg_s == 0.0
    # 36 / 4 on the normal ramp; 36 / 10 and the ends of the ramp, 0.15, on the other.
    assert ends["halt", "halt"] == approx(9.0, abs=0.03)
    assert ends["stop", "stop"] == ends["stop", "halt"] == approx(3.75, abs=0.03)
    assert ends["halt", "stop"] == approx(0.59 + 5.8**2 / 10.0 + 0.15, abs=0.1)


def test_power_is_not_asked_for_twice_while_it_goes_on_or_is_taken_back():
    rig = Rig()
    assert rig.axis.power_on() is not None, "nothing was read yet"
    rig.run(0.1)
    assert rig.axis.power_on() is None
    assert rig.axis.power_on() is None, "accepted already"
    rig.run(1.0)
    assert rig.axis.power.phase is PowerPhase.ON
    rig.move(50.0)
    rig.run(1.0)
    rig.axis.power_off()
    refused = rig.axis.power_on()
    assert refused is not None, "it still comes to rest before it is switched off"
    assert refused.code is Code.PWR_04
    rig.run(4.0)
    assert rig.axis.is_off


@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_an_increment_ends_where_the_enabling_switch_is_released_on_its_way(key):
    rig = powered()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(10.0))
    rig.op(**{key: True})
    rig.run(1.0)
    assert abs(rig.vel_deg_s) > 3.0
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.run(2.0)
    assert rig.vel_deg_s == 0.0
    assert abs(rig.ref_deg) < 9.0
    assert Code.INT_05 in {alarm.code for alarm in rig.axis.alarms.history}


ORDERS = {
    "move": {"move": True, "target_rad": rad(5.0)},
    "way": {"move": True, "relative": True, "target_rad": rad(5.0)},
    "key": {"mode": Mode.CONTINUOUS, "forward": True, "lease": 1},
    "increment": {"mode": Mode.INCREMENTAL, "forward": True, "increment_rad": rad(1.0)},
}


@pytest.mark.parametrize("name", ORDERS)
def test_an_order_is_taken_in_the_scan_in_which_it_comes(name):
    rig = powered()
    order = dict(ORDERS[name])
    if "mode" in order:
        rig.op(mode=order.pop("mode"))
    rig.op(speed_rad_s=rad(3.0), **order)
    assert rig.axis.motion.current is not None
    rig.run(0.2)
    rig.op(halt=True)
    assert rig.axis.virtual.stopping


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
def test_a_move_that_was_refused_is_judged_again_only_with_a_new_edge(way):
    """7 deg/s is above the setting range; a speed that is possible comes while the level stays."""
    rig = powered()
    rig.op(move=True, target_rad=way * rad(5.0), speed_rad_s=rad(7.0))
    assert rig.axis.refusal_count == 1
    rig.op(speed_rad_s=rad(6.5))
    assert rig.axis.refusal_count == 1
    rig.op(speed_rad_s=rad(3.0))
    rig.run(0.1)
    assert rig.axis.motion.current is None
    rig.op(move=False)
    rig.op(move=True)
    assert rig.axis.motion.current is not None
