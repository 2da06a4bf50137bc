"""GantryProgram: the operator's levels, the two modes, and everything that is refused."""

import math

import pytest

from gantryctl.image import DigitalInputs, Mode
from gantryctl.program import AxisState
from gantryctl.units import rad
from unit.program.rig import Rig, moving_rig, powered, press, settings


@pytest.fixture
def rig():
    return powered()


@pytest.fixture
def continuous(rig):
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(2.0))
    return rig


@pytest.fixture
def incremental(rig):
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(1.5))
    return rig


# --- start ----------------------------------------------------------------------------------------


def test_after_a_start_the_mode_is_none_and_nothing_moves(rig):
    assert rig.program.mode is Mode.NONE
    press(rig, forward=True, speed_rad_s=rad(2.0))
    assert rig.refused() == "no motion mode is chosen"
    rig.hold_key(1.0)
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-6)


def test_levels_that_are_true_from_the_first_scan_move_nothing():
    rig = Rig()
    rig.operator = rig.operator._replace(
        power=True, mode=Mode.CONTINUOUS, forward=True, move=True, target_rad=rad(20.0), speed_rad_s=rad(6.0)
    )
    rig.hold_key(3.0)
    assert rig.axis.state is AxisState.STANDSTILL
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-6)


# --- move -----------------------------------------------------------------------------------------


def test_move_works_in_any_mode(rig):
    for mode, target in ((Mode.NONE, 2.0), (Mode.CONTINUOUS, -2.0), (Mode.INCREMENTAL, 3.0)):
        rig.op(mode=mode)
        rig.move(target)
        rig.until(lambda: rig.program.move.done or not rig.program.move.busy)
        assert rig.pos_deg == pytest.approx(target, abs=1e-4)


def test_move_takes_over_from_a_move():
    rig = moving_rig()
    rig.move(-10.0)
    assert rig.axis.refusal is None
    rig.until(lambda: not rig.program.move.busy)
    assert rig.pos_deg == pytest.approx(-10.0, abs=1e-4)


@pytest.mark.parametrize(
    ("at_deg", "target_deg", "text"),
    [
        (90.0, 200.0, "target 200.00 deg is beyond +180.00 deg; you are at 90.00 deg, so 90.00 deg are left"),
        (
            -90.0,
            -180.01,
            "target -180.01 deg is beyond -180.00 deg; you are at -90.00 deg, so 90.00 deg are left",
        ),
        (0.0, math.nan, "target must be within -180.00 and 180.00 deg, got nan deg"),
        (0.0, -math.inf, "target must be within -180.00 and 180.00 deg, got -inf deg"),
    ],
)
def test_a_target_that_cannot_be(at_deg, target_deg, text):
    rig = Rig(at_deg=at_deg)
    rig.power_up()
    rig.move(target_deg)
    assert rig.refused() == text
    rig.run(0.1)
    assert rig.ref_deg == pytest.approx(at_deg, abs=1e-5)
    assert rig.axis.state is AxisState.STANDSTILL


def test_from_179_to_minus_179_the_long_way():
    rig = Rig(at_deg=179.0, config=settings(period_s=0.01))
    rig.power_up()
    rig.move(-179.0)
    rig.run(1.0)
    assert rig.vel_deg_s < 0.0
    rig.until(lambda: not rig.program.move.busy, 100.0)
    assert rig.pos_deg == pytest.approx(-179.0, abs=1e-3)


def test_move_to_the_very_limits():
    rig = Rig(config=settings(period_s=0.01))
    rig.power_up()
    for limit in (180.0, -180.0):
        rig.move(limit)
        rig.until(lambda: not rig.program.move.busy, 100.0)
        assert rig.axis.virtual.pos_ref_rad == rad(limit)
    assert not rig.codes


@pytest.mark.parametrize("speed_deg_s", [0.0, 0.59, 6.01, -1.0, math.nan, math.inf])
def test_a_speed_setting_outside_its_range_is_refused(rig, speed_deg_s):
    rig.move(5.0, speed_deg_s)
    assert rig.refused().startswith("speed must be within 0.6 and 6 deg/s, got ")
    rig.run(0.1)
    assert rig.axis.state is AxisState.STANDSTILL


@pytest.mark.parametrize("speed_deg_s", [0.6, 6.0])
def test_the_ends_of_the_range_are_in_it(rig, speed_deg_s):
    rig.move(5.0, speed_deg_s)
    assert rig.axis.refusal is None


def test_refusals_are_counted(rig):
    for expected in (1, 2, 3):
        rig.move(400.0)
        assert rig.axis.refusal_count == expected


# --- continuous mode ------------------------------------------------------------------------------


@pytest.mark.parametrize(("key", "sign"), [("forward", 1.0), ("reverse", -1.0)])
def test_continuous_moves_while_the_key_is_held(continuous, key, sign):
    rig = continuous
    press(rig, **{key: True})
    rig.hold_key(2.0)
    assert rig.vel_deg_s == pytest.approx(sign * 2.0)
    assert rig.axis.state is AxisState.CONTINUOUS_MOTION
    before = rig.ref_deg
    rig.op(**{key: False})
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL)
    # Jog-release ramp: v^2 / 2a + v a / 2j at 5 deg/s2, 100 deg/s3.
    assert abs(rig.ref_deg - before) == pytest.approx(0.4 + 0.05, abs=0.005)
    assert not rig.axis.alarms.history, "the lease may run out once the key is released"


def test_the_lease_is_250_ms(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(1.0)
    rig.run(0.22)  # the last renewal is 30 ms old
    assert rig.program.jog.busy
    assert rig.vel_deg_s == pytest.approx(2.0)
    rig.until(lambda: rig.program.jog.error, 0.002)
    assert rig.program.jog.error_id == "CTL-15"
    assert rig.program.jog.error_text == "hold-to-run was not renewed for 250 ms, limit 250 ms"
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 1.0)


def test_a_lease_that_counts_round_is_a_renewal(continuous):
    rig = continuous
    rig.op(forward=True, lease=255)
    rig.run(0.2)
    rig.op(lease=0)
    rig.run(0.2)
    assert rig.program.jog.busy
    assert not rig.axis.alarms.history


def test_an_ended_lease_is_dead(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(1.0)
    rig.run(1.5)
    here = rig.ref_deg
    rig.hold_key(1.0)
    assert rig.ref_deg == here, (
        "a renewal after the end does not start anything; the key must be pressed again"
    )
    press(rig, forward=False)
    press(rig, forward=True)
    rig.hold_key(0.5)
    assert rig.ref_deg > here


def test_a_key_without_a_living_lease_is_refused(continuous):
    rig = continuous
    rig.run(1.0)
    rig.op(forward=True)
    assert "hold-to-run was not renewed" in rig.refused()
    rig.run(0.5)
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-6)


def test_the_lease_is_counted_in_scans_of_any_period():
    rig = Rig(config=settings(period_s=0.004))
    rig.power_up()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(2.0))
    press(rig, forward=True)
    pressed = rig.scan - 1
    rig.until(lambda: rig.program.jog.error)
    assert (rig.scan - 1 - pressed) * 0.004 == pytest.approx(0.252, abs=1e-9), "250 ms are 63 scans of 4 ms"


def test_both_keys_stop(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(1.0)
    press(rig, reverse=True)
    rig.hold_key(1.0)
    assert rig.axis.state is AxisState.STANDSTILL
    press(rig, forward=False)
    rig.hold_key(0.5)
    assert rig.axis.state is AxisState.STANDSTILL, "the key left over starts nothing"


def test_reversal_only_from_standstill(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(1.0)
    press(rig, forward=False, reverse=True)
    assert "reversal only from standstill" in rig.refused()
    rig.hold_key(2.0)
    assert rig.vel_deg_s == 0.0


def test_continuous_stops_at_the_end_of_travel():
    rig = Rig(at_deg=178.0)
    rig.power_up()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(rig, forward=True)
    rig.hold_key(4.0)
    assert rig.axis.virtual.pos_ref_rad == rad(180.0)
    assert rig.axis.state is AxisState.STANDSTILL
    assert rig.program.jog.at_limit
    assert rig.axis.alarms.history[-1].code == "LIM-01"
    assert not rig.codes


def test_another_speed_while_the_key_is_held(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(1.0)
    press(rig, speed_rad_s=rad(1.0))
    rig.hold_key(1.0)
    assert rig.vel_deg_s == pytest.approx(1.0)
    press(rig, speed_rad_s=rad(7.0))
    assert "speed must be within 0.6 and 6 deg/s, got 7 deg/s" in rig.refused()
    rig.hold_key(0.5)
    assert rig.vel_deg_s == pytest.approx(1.0)


def test_move_while_jogging_is_refused(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(0.5)
    press(rig, move=True, target_rad=0.0)
    assert "release the key first" in rig.refused()
    rig.hold_key(0.5)
    assert rig.axis.state is AxisState.CONTINUOUS_MOTION


def test_a_key_held_over_a_stop_does_not_start_again(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(0.5)
    press(rig, stop=True)
    rig.hold_key(1.5)
    press(rig, stop=False)
    rig.hold_key(1.0)
    assert rig.axis.state is AxisState.STANDSTILL


# --- incremental mode -----------------------------------------------------------------------------


def test_one_edge_is_one_increment(incremental):
    rig = incremental
    rig.op(forward=True)
    rig.run(4.0)
    assert rig.ref_deg == pytest.approx(1.5, abs=1e-5)
    rig.op(forward=False)
    rig.op(reverse=True)
    rig.op(reverse=False)
    rig.run(4.0)
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-5), "the increment goes to its end without the key"


def test_an_edge_while_moving_is_refused_not_queued(incremental):
    rig = incremental
    rig.op(forward=True)
    rig.run(0.3)
    rig.op(forward=False)
    rig.op(forward=True)
    assert "increments from standstill only" in rig.refused()
    rig.run(5.0)
    assert rig.ref_deg == pytest.approx(1.5, abs=1e-5)


@pytest.mark.parametrize("increment_deg", [0.0, -1.0, math.nan, 400.0])
def test_an_increment_that_cannot_be(incremental, increment_deg):
    rig = incremental
    rig.op(increment_rad=rad(increment_deg))
    rig.op(forward=True)
    assert "increment must be above 0" in rig.refused()
    rig.run(0.5)
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-6)


def test_an_increment_past_the_limit_is_refused_whole():
    rig = Rig(at_deg=-179.0)
    rig.power_up()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(1.5))
    rig.op(reverse=True)
    assert rig.refused() == (
        "target -180.50 deg is beyond -180.00 deg; you are at -179.00 deg, so 1.00 deg are left"
    )
    rig.run(1.0)
    assert rig.ref_deg == pytest.approx(-179.0, abs=1e-5)


# --- modes ----------------------------------------------------------------------------------------


def test_the_mode_changes_at_standstill_only(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(0.5)
    press(rig, mode=Mode.INCREMENTAL)
    assert rig.refused() == "the mode changes at standstill only"
    assert rig.program.mode is Mode.CONTINUOUS
    assert rig.axis.state is AxisState.CONTINUOUS_MOTION


def test_a_refused_mode_change_does_not_come_later(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(0.5)
    press(rig, mode=Mode.INCREMENTAL)
    press(rig, forward=False)
    rig.run(2.0)
    assert rig.program.mode is Mode.CONTINUOUS, "refused is not queued"
    rig.op(mode=Mode.CONTINUOUS)
    rig.op(mode=Mode.INCREMENTAL)
    assert rig.program.mode is Mode.INCREMENTAL


def test_a_key_does_not_act_in_a_mode_that_the_operator_has_left(incremental):
    """Chosen in motion and refused: the level says continuous, and an increment would go on when the key is let go."""
    rig = incremental
    press(rig, forward=True)
    rig.op(mode=Mode.CONTINUOUS)
    assert rig.refused() == "the mode changes at standstill only"
    rig.run(6.0)
    at_deg = rig.ref_deg
    press(rig, forward=True)
    assert rig.refused() == "the mode changes at standstill only"
    rig.hold_key(1.0)
    assert rig.ref_deg == pytest.approx(at_deg, abs=1e-6)
    rig.op(forward=False, mode=Mode.INCREMENTAL)
    rig.op(mode=Mode.CONTINUOUS)
    rig.op(forward=True)
    rig.hold_key(1.0)
    assert rig.axis.state is AxisState.CONTINUOUS_MOTION


def test_a_key_held_over_a_mode_change_starts_nothing(incremental):
    rig = incremental
    rig.op(forward=True)
    rig.run(4.0)
    press(rig, mode=Mode.CONTINUOUS)
    rig.hold_key(1.0)
    assert rig.ref_deg == pytest.approx(1.5, abs=1e-5)


# --- enabling switch ------------------------------------------------------------------------------


def test_without_the_enabling_switch_only_slow_motion_by_hand(continuous):
    rig = continuous
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    press(rig, forward=True)
    assert "the enabling switch is off: up to 1.00 deg/s only" in rig.refused()
    press(rig, forward=False, speed_rad_s=rad(1.0))
    press(rig, forward=True)
    rig.hold_key(1.0)
    assert rig.vel_deg_s == pytest.approx(1.0)


def test_letting_go_of_the_enabling_switch_stops(continuous):
    rig = continuous
    press(rig, forward=True)
    rig.hold_key(1.0)
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.step()
    assert rig.program.jog.error_id == "INT-05"
    rig.hold_key(0.6)
    assert rig.axis.state is AxisState.STANDSTILL
    assert rig.axis.alarms.history[-1].code == "INT-05"
    rig.drive.inputs = DigitalInputs()
    rig.hold_key(0.5)
    assert rig.axis.state is AxisState.STANDSTILL, "the key must be pressed again"


def test_a_remote_key_that_was_let_go_is_not_stopped_once_more_by_the_switch():
    rig = powered()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0), remote=True)
    press(rig, forward=True)
    rig.hold_key(1.5)
    press(rig, forward=False)
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.run(2.0)
    # Nor by its lease, which runs out on the ramp.
    assert not {"INT-05", "CTL-15"} & {str(alarm.code) for alarm in rig.axis.alarms.history}
    assert rig.vel_deg_s == 0.0


def test_both_keys_at_once_are_no_increment():
    rig = powered()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(1.0))
    rig.op(forward=True, reverse=True)
    assert "both" in rig.refused()
    rig.run(0.5)
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_a_key_that_is_pressed_in_a_mode_that_was_refused_is_refused(key):
    rig = powered()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(1.0))
    rig.op(**{key: True})
    rig.op(mode=Mode.CONTINUOUS)
    rig.op(**{key: False})
    rig.run(3.0)
    at_deg, refusals = rig.ref_deg, rig.axis.refusal_count
    assert abs(at_deg) == pytest.approx(1.0, abs=1e-5)
    press(rig, **{key: True})
    assert rig.axis.refusal_count == refusals + 1
    rig.hold_key(0.5)
    assert rig.ref_deg == at_deg


def test_the_cap_of_an_increment_goes_by_the_speed_set_and_not_by_the_override():
    """3 deg/s at 30 % are below 1 deg/s, and 3 as soon as somebody raises the override."""
    rig = powered()
    rig.op(mode=Mode.INCREMENTAL, increment_rad=rad(5.0), speed_rad_s=rad(3.0), override=0.3)
    press(rig, forward=True)
    rig.run(1.0)
    assert rig.vel_deg_s == pytest.approx(0.9)
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.run(0.5)
    assert rig.vel_deg_s == 0.0
    assert rig.axis.alarms.history[-1].code == "INT-05"
