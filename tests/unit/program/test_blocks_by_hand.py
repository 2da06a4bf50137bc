"""Blocks by hand, of the reference and for reading: what each does."""

import math

import pytest

from gantryctl.program import AxisState
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.reference import Reference
from gantryctl.program.blocks import (
    Home,
    Inch,
    Jog,
    MoveAbsolute,
    MoveVelocity,
    ReadActualPosition,
    ReadActualTorque,
    ReadActualVelocity,
    ReadAxisError,
    ReadMotionState,
    ReadStatus,
    Reset,
    SetPosition,
)
from gantryctl.units import deg, rad
from unit.program.block_bench import Bench, call, outputs, standing
from unit.program.parts import Parts
from unit.program.rig import COUNTS_PER_DEG, ZERO_COUNTS, Rig


@pytest.fixture
def rig():
    return standing()


# --- by hand --------------------------------------------------------------------------------------


def keys(rig, block, forward=False, backward=False, **inputs):
    call(rig, block, forward=forward, backward=backward, **inputs)


def test_jog_moves_while_the_key_is_held(rig):
    jog = Jog(rig.axis)
    keys(rig, jog, backward=True, velocity_rad_s=rad(2.0))
    rig.run(1.0)
    assert rig.vel_deg_s == pytest.approx(-2.0)
    keys(rig, jog, velocity_rad_s=rad(2.0))
    assert jog.busy
    rig.until(lambda: jog.done)
    rig.step()
    assert rig.axis.state is AxisState.STANDSTILL
    assert outputs(jog) == set()


def test_jog_both_keys_stop_and_both_must_be_released(rig):
    jog = Jog(rig.axis)
    speed = {"velocity_rad_s": rad(2.0)}
    keys(rig, jog, forward=True, **speed)
    rig.run(1.0)
    keys(rig, jog, forward=True, backward=True, **speed)
    rig.until(lambda: rig.vel_deg_s == 0.0)
    here = rig.ref_deg
    keys(rig, jog, backward=True, **speed)
    rig.run(0.5)
    assert rig.ref_deg == here, "one of the two released starts nothing"
    keys(rig, jog, **speed)
    keys(rig, jog, backward=True, **speed)
    rig.run(0.5)
    assert rig.ref_deg < here


def test_jog_reverses_only_from_standstill(rig):
    jog = Jog(rig.axis)
    speed = {"velocity_rad_s": rad(6.0)}
    keys(rig, jog, forward=True, **speed)
    rig.run(2.0)
    keys(rig, jog, **speed)
    keys(rig, jog, backward=True, **speed)
    assert jog.error
    assert "reversal only from standstill" in jog.error_text
    rig.run(3.0)
    assert rig.vel_deg_s == 0.0, "the refused key is dead until it is pressed again"
    keys(rig, jog, **speed)
    keys(rig, jog, backward=True, **speed)
    rig.run(0.5)
    assert rig.vel_deg_s < 0.0


def test_jog_goes_on_the_same_way_before_rest(rig):
    jog = Jog(rig.axis)
    speed = {"velocity_rad_s": rad(6.0)}
    keys(rig, jog, forward=True, **speed)
    rig.run(2.0)
    keys(rig, jog, **speed)
    rig.run(0.5)
    keys(rig, jog, forward=True, **speed)
    rig.run(2.0)
    assert rig.vel_deg_s == pytest.approx(6.0)


def test_jog_speed_may_change_under_way(rig):
    jog = Jog(rig.axis)
    keys(rig, jog, forward=True, velocity_rad_s=rad(2.0))
    rig.run(1.0)
    keys(rig, jog, forward=True, velocity_rad_s=rad(5.0))
    rig.run(1.0)
    assert rig.vel_deg_s == pytest.approx(5.0)
    before = rig.axis.refusal_count
    keys(rig, jog, forward=True, velocity_rad_s=rad(50.0))
    rig.run(0.1)
    assert rig.axis.refusal_count == before + 1
    assert rig.vel_deg_s == pytest.approx(5.0), "refused, not clamped"


def test_jog_stops_at_the_end_of_travel():
    rig = Rig(Bench, at_deg=-175.0)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 5.0)
    jog = Jog(rig.axis)
    keys(rig, jog, backward=True, velocity_rad_s=rad(6.0))
    rig.until(lambda: not jog.busy)
    assert jog.at_limit
    assert rig.axis.virtual.pos_ref_rad == rad(-180.0)
    keys(rig, jog, velocity_rad_s=rad(6.0))
    keys(rig, jog, backward=True, velocity_rad_s=rad(6.0))
    assert jog.error_text == "at -180.00 deg only motion forward is open"
    keys(rig, jog, velocity_rad_s=rad(6.0))
    keys(rig, jog, forward=True, velocity_rad_s=rad(6.0))
    rig.run(1.0)
    assert rig.ref_deg > -180.0, "the way back is open"


def test_jog_does_not_take_over_another_motion(rig):
    move, jog = MoveAbsolute(rig.axis), Jog(rig.axis)
    call(rig, move, execute=True, position_rad=rad(50.0), velocity_rad_s=rad(6.0))
    keys(rig, jog, backward=True, velocity_rad_s=rad(6.0))
    assert jog.error
    assert move.active


def test_inch_moves_one_increment_per_edge(rig):
    inch = Inch(rig.axis)
    arguments = {"distance_rad": rad(2.0), "velocity_rad_s": rad(6.0)}
    keys(rig, inch, forward=True, **arguments)
    rig.until(lambda: inch.done)
    rig.run(1.0)
    assert rig.ref_deg == pytest.approx(2.0, abs=1e-5), "a held key is one increment"
    keys(rig, inch, **arguments)
    keys(rig, inch, backward=True, **arguments)
    rig.until(lambda: inch.done)
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-5)
    for key in ("forward", "backward"):
        keys(rig, inch, **{key: True}, **arguments)
        rig.until(lambda: inch.done)
        rig.run(0.1)
        assert inch.done, "as long as its key is held"
        keys(rig, inch, **arguments)
        rig.step()
        assert not inch.done


def test_inch_edges_while_moving_are_refused_not_queued(rig):
    inch = Inch(rig.axis)
    arguments = {"distance_rad": rad(2.0), "velocity_rad_s": rad(6.0)}
    keys(rig, inch, forward=True, **arguments)
    rig.run(0.2)
    keys(rig, inch, **arguments)
    keys(rig, inch, forward=True, **arguments)
    assert "increments from standstill only" in rig.refused()
    rig.run(5.0)
    assert rig.ref_deg == pytest.approx(2.0, abs=1e-5)


def test_inch_past_the_travel_is_refused_whole():
    rig = Rig(Bench, at_deg=179.0)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 5.0)
    inch = Inch(rig.axis)
    keys(rig, inch, forward=True, distance_rad=rad(1.5), velocity_rad_s=rad(6.0))
    assert (
        inch.error_text
        == "target 180.50 deg is beyond +180.00 deg; you are at 179.00 deg, so 1.00 deg are left"
    )
    rig.run(1.0)
    assert rig.ref_deg == pytest.approx(179.0, abs=1e-5)


@pytest.mark.parametrize("bad", [0.0, -1.0, 361.0, math.nan, math.inf])
def test_inch_distance_must_be_above_zero_and_within_travel(rig, bad):
    inch = Inch(rig.axis)
    keys(rig, inch, forward=True, distance_rad=rad(bad), velocity_rad_s=rad(6.0))
    assert inch.error_id == "CTL-01"
    assert "increment must be above 0 and at most 360.00 deg" in inch.error_text


# --- reference ------------------------------------------------------------------------------------


def test_set_position_changes_the_zero_and_nothing_moves(rig):
    block, motor = SetPosition(rig.axis), rig.drive.pos_motor_rad
    call(rig, block, execute=True, position_rad=rad(12.5))
    assert block.done
    rig.run(1.0)
    assert rig.pos_deg == pytest.approx(12.5, abs=1e-6)
    assert rig.drive.pos_motor_rad == pytest.approx(motor, abs=1e-6)
    assert rig.axis.zero_counts == pytest.approx(ZERO_COUNTS - 12.5 * COUNTS_PER_DEG, abs=1.0)
    assert not rig.codes


def test_what_torque_was_learned_stays_with_the_place(rig):
    """A moment with its largest torque, 14 N m, at 90 deg, which is called 12.5 deg: BRK-02 asks for the same there."""
    model = rig.axis.monitors.drag.model
    rig.axis.pos_act_rad = rad(90.0)
    model.restore((14.0, 0.0, 5.0, 1.0, 2.0))
    assert rig.axis.set_position(rad(12.5)) is None
    assert model.expected_nm(rad(12.5), 0.0, 0.0) == pytest.approx(14.0)
    assert model.expected_nm(rad(12.5 - 90.0), 0.0, 0.0) == pytest.approx(0.0, abs=1e-9)


def test_where_the_angle_was_not_known_no_learned_torque_stays(rig):
    """Nobody can say what place the moment stood at: BRK-02 begins anew instead of asking for it somewhere."""
    model = rig.axis.monitors.drag.model
    model.restore((14.0, 0.0, 5.0, 1.0, 2.0))
    rig.axis.pos_act_rad = math.nan
    assert rig.axis.set_position(rad(12.5)) is None
    assert not model.learned


def test_set_position_is_refused_in_motion_and_outside(rig):
    move, block = MoveAbsolute(rig.axis), SetPosition(rig.axis)
    call(rig, block, execute=True, position_rad=rad(180.5))
    assert block.error_id == "CTL-01"
    call(rig, block, execute=False, position_rad=0.0)
    assert not block.error, "an error is told until Execute is released"
    call(rig, move, execute=True, position_rad=rad(20.0), velocity_rad_s=rad(6.0))
    call(rig, block, execute=True, position_rad=0.0)
    assert "needs standstill" in block.error_text


def test_set_position_is_refused_where_the_encoder_would_wrap():
    """4096 turns are 1289 deg; the travel of +-180 deg needs 185 deg to each end, 5 deg of margin included."""
    rig = Rig(Bench)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 5.0)
    for raw_deg, refused in ((184.0, True), (186.0, False), (1289.0 - 184.0, True)):
        counts = raw_deg * COUNTS_PER_DEG
        rig.axis.feedback.counts = counts
        result = Reference(rig.axis.settings, rig.axis.feedback, None).check(0.0, standing=True)
        assert (result is not None) == refused, raw_deg
        if result is not None:
            assert "the encoder would wrap" in result.text


def test_home_is_direct_and_shows_homing_for_a_scan(rig):
    home = Home(rig.axis)
    call(rig, home, execute=True, position_rad=rad(-90.0))
    assert rig.axis.state is AxisState.HOMING
    rig.step()
    assert home.done
    assert rig.axis.state is AxisState.STANDSTILL
    assert rig.pos_deg == pytest.approx(-90.0, abs=1e-6)


def test_home_needs_standstill():
    rig = Rig(Bench)
    home = Home(rig.axis)
    call(rig, home, execute=True, position_rad=0.0)
    assert home.error
    assert "Home needs Standstill" in home.error_text


# --- reading --------------------------------------------------------------------------------------


def test_read_status_shows_exactly_one_state(rig):
    status, move = ReadStatus(rig.axis), MoveAbsolute(rig.axis)
    names = (
        "error_stop", "disabled", "stopping", "homing", "standstill", "discrete_motion", "continuous_motion",
        "synchronized_motion",
    )  # fmt: skip

    def shown():
        return [name for name in names if getattr(status, name)]

    call(rig, status)
    assert shown() == ["standstill"]
    call(rig, move, execute=True, position_rad=rad(5.0), velocity_rad_s=rad(6.0))
    rig.step()
    assert shown() == ["discrete_motion"]
    call(rig, status, enable=False)
    assert shown() == []
    assert not status.valid


def test_read_axis_error(rig):
    error = ReadAxisError(rig.axis)
    call(rig, error)
    assert error.axis_error_id is None
    rig.axis.quick_stop()
    rig.step()
    assert error.axis_error_id == "INT-06"
    assert error.axis_error_text.startswith("INT-06 STOP")


def test_read_motion_state(rig):
    state, move = ReadMotionState(rig.axis), MoveAbsolute(rig.axis)
    call(rig, state)
    assert not state.accelerating
    assert not state.constant_velocity
    assert not state.decelerating
    call(rig, move, execute=True, position_rad=rad(-20.0), velocity_rad_s=rad(6.0))
    seen = []
    while move.busy:
        rig.step()
        now = [name for name in ("accelerating", "constant_velocity", "decelerating") if getattr(state, name)]
        assert len(now) <= 1
        if now and (not seen or seen[-1] != now[0]):
            seen.append(now[0])
        assert not state.direction_positive
    assert seen == ["accelerating", "constant_velocity", "decelerating"]


def test_read_actual_values(rig):
    blocks = [ReadActualPosition(rig.axis), ReadActualVelocity(rig.axis), ReadActualTorque(rig.axis)]
    run = MoveVelocity(rig.axis)
    call(rig, run, execute=True, velocity_rad_s=rad(3.0))
    for block in blocks:
        call(rig, block)
    rig.run(2.0)
    position, velocity, torque = blocks
    assert position.value == rig.axis.pos_act_rad
    assert deg(velocity.value) == pytest.approx(3.0, abs=0.01)
    assert torque.value == 0.0
    assert all(block.valid for block in blocks)


def test_reset_block_has_nothing_to_do(rig):
    reset = Reset(rig.axis)
    call(rig, reset, execute=True)
    assert reset.done
    assert not reset.busy
    call(rig, reset, execute=False)
    assert not reset.done


def test_a_reference_outside_the_travel_is_refused_with_its_range():
    parts = Parts()
    refused = Reference(parts.settings, parts.feedback, None).check(rad(200.0), standing=True)
    assert refused is not None
    assert refused.text == "position must be within -180.00 and 180.00 deg, got 200 deg"


def test_jog_back_from_the_end_of_travel_is_not_at_the_limit_any_more():
    rig = Rig(Bench, at_deg=178.0)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 5.0)
    block = Jog(rig.axis)
    call(rig, block, forward=True, backward=False, velocity_rad_s=rad(6.0))
    rig.run(3.0)
    assert block.at_limit
    call(rig, block, forward=False, backward=True, velocity_rad_s=rad(6.0))
    assert not block.at_limit
    rig.run(0.5)
    assert not block.at_limit


@pytest.mark.parametrize("spoilt", [{"in_doubt": True}, {"counts": math.nan}])
def test_no_reference_is_set_where_the_angle_is_not_known(spoilt):
    parts = Parts()
    for name, value in spoilt.items():
        setattr(parts.feedback, name, value)
    refused = Reference(parts.settings, parts.feedback, None).check(0.0, standing=True)
    assert refused is not None
    assert refused.values["reason"] is Words.POSITION_NOT_VALID
