"""Buffered motions, MoveAdditive, and ramps of one motion below the machine's."""

from __future__ import annotations

import math

import pytest

from gantryctl.image import BufferMode
from gantryctl.program import AxisState
from gantryctl.program.blocks import Halt, Jog, MoveAbsolute, MoveAdditive, MoveRelative, MoveVelocity, Stop
from gantryctl.program.settings import StandstillPolicy
from gantryctl.units import rad
from unit.program.block_bench import Bench, call, outputs, standing
from unit.program.rig import Rig, settings

BUFFERED = {"buffer_mode": BufferMode.BUFFERED}
FAST = {"velocity_rad_s": rad(6.0)}


@pytest.fixture
def rig() -> Rig:
    return standing()


def to(rig: Rig, angle_deg: float, **inputs: object) -> MoveAbsolute:
    block = MoveAbsolute(rig.axis)
    call(rig, block, execute=True, position_rad=rad(angle_deg), **{**FAST, **inputs})
    return block


# --- Buffered -------------------------------------------------------------------------------------


def test_a_buffered_move_begins_when_the_one_before_is_in_position(rig: Rig) -> None:
    first, second = to(rig, 3.0), to(rig, -2.0, **BUFFERED)
    assert outputs(first) == {"busy", "active"}
    assert outputs(second) == {"busy"}, "waits: PLCopen has Busy without Active"
    rig.until(lambda: not first.busy)
    assert outputs(first) == {"done"}
    assert outputs(second) == {"busy", "active"}, "in the same scan: the state goes from motion to motion"
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    assert rig.pos_deg == pytest.approx(3.0, abs=0.005), "the window of in position: nothing was cut short"
    rig.until(lambda: not second.busy)
    assert outputs(second) == {"done"}
    assert rig.pos_deg == pytest.approx(-2.0, abs=1e-4)


def test_the_axis_does_not_turn_round_before_the_end_of_the_first_move(rig: Rig) -> None:
    to(rig, 3.0)
    to(rig, -2.0, **BUFFERED)
    highest = 0.0
    for _ in range(6000):
        rig.step()
        highest = max(highest, rig.ref_deg)
    assert highest == pytest.approx(3.0, abs=1e-9)


def test_nothing_under_way_begins_at_once(rig: Rig) -> None:
    assert outputs(to(rig, 1.0, **BUFFERED)) == {"busy", "active"}


def test_there_is_one_place(rig: Rig) -> None:
    _, second, third = to(rig, 3.0), to(rig, -2.0, **BUFFERED), to(rig, 1.0, **BUFFERED)
    assert outputs(second) == {"busy"}
    assert outputs(third) == {"error"}
    assert "one place" in third.error_text


@pytest.mark.parametrize("ender", ["abort", "halt", "stop", "power", "quick stop", "fault"])
def test_whatever_ends_the_motion_drops_what_waits(rig: Rig, ender: str) -> None:
    """Nothing that was asked for before a stop moves the axis after it."""
    first, second = to(rig, 30.0), to(rig, -20.0, **BUFFERED)
    rig.run(1.0)
    match ender:
        case "abort":
            to(rig, 1.0)
        case "halt":
            call(rig, Halt(rig.axis), execute=True)
        case "stop":
            call(rig, Stop(rig.axis), execute=True)
        case "power":
            rig.axis.power_off()
        case "quick stop":
            rig.axis.quick_stop()
        case "fault":
            rig.spoil = lambda feedback: feedback._replace(inputs=feedback.inputs._replace(estop_ok=False))
    rig.step()
    assert not first.active
    rig.run(12.0)
    assert outputs(second) in ({"command_aborted"}, {"error"})
    assert rig.axis.motion.buffered is None
    assert rig.ref_deg > 0.0, "it never went where the second one wanted to"


def test_a_move_that_does_not_come_into_position_drops_what_waits() -> None:
    rig = standing()
    first, second = to(rig, 1.0), to(rig, -2.0, **BUFFERED)
    counts = 1144.0 * 2048 * 2048 / 360.0
    # A reading that swings by 0.008 deg, beyond the window of 0.005 deg and far below what trips, at every other dwell.
    rig.spoil = lambda feedback: feedback._replace(
        pos_act_counts=feedback.pos_act_counts + (0.008 * counts if rig.scan // 100 % 2 else 0.0)
    )
    rig.until(lambda: not first.busy, 20.0)
    assert str(first.error_id) == "CTL-11"
    assert outputs(second) == {"command_aborted"}


def test_the_way_is_judged_from_where_the_first_move_ends(rig: Rig) -> None:
    to(rig, 170.0)
    by = MoveRelative(rig.axis)
    call(rig, by, execute=True, distance_rad=rad(20.0), **FAST, **BUFFERED)
    assert outputs(by) == {"error"}, "from 170 deg by 20 deg leaves the travel, from 0 deg it would not"
    assert "190.00" in by.error_text
    on = MoveRelative(rig.axis)
    call(rig, on, execute=True, distance_rad=rad(-20.0), **FAST, **BUFFERED)
    rig.until(lambda: not on.busy, 60.0)
    assert outputs(on) == {"done"}
    assert rig.pos_deg == pytest.approx(150.0, abs=1e-4)


def test_it_is_judged_again_when_its_turn_comes(rig: Rig) -> None:
    first, second = to(rig, 3.0), to(rig, 8.0, **BUFFERED)
    rig.axis.judge_brake(overdue=True)
    rig.until(lambda: not first.busy)
    assert outputs(second) == {"error"}
    assert str(second.error_id) == "BRK-12", "the brake test became overdue meanwhile: 6 deg/s is too fast"
    assert rig.pos_deg == pytest.approx(3.0, abs=0.005)


def test_behind_a_speed_it_begins_once_that_is_reached(rig: Rig) -> None:
    on = MoveVelocity(rig.axis)
    call(rig, on, execute=True, velocity_rad_s=rad(2.0))
    second = to(rig, 20.0, **BUFFERED)
    assert outputs(second) == {"busy"}
    rig.until(lambda: second.active)
    assert rig.vel_deg_s == pytest.approx(2.0, rel=1e-9)
    rig.step()
    assert outputs(on) == {"command_aborted"}
    rig.until(lambda: not second.busy)
    assert rig.pos_deg == pytest.approx(20.0, abs=1e-4)


def test_nothing_waits_behind_a_key(rig: Rig) -> None:
    """A motion by hand ends when the key is released, and nothing begins by that."""
    jog = Jog(rig.axis)
    call(rig, jog, forward=True, backward=False, velocity_rad_s=rad(2.0))
    second = to(rig, 20.0, **BUFFERED)
    assert outputs(second) == {"error"}
    assert "key" in second.error_text


def test_override_0_holds_both(rig: Rig) -> None:
    first, second = to(rig, 3.0), to(rig, -2.0, **BUFFERED)
    rig.run(0.3)
    rig.axis.set_override(0.0)
    rig.run(20.0)
    assert (outputs(first), outputs(second)) == ({"busy", "active"}, {"busy"})
    rig.axis.set_override(1.0)
    rig.until(lambda: second.done)
    assert rig.pos_deg == pytest.approx(-2.0, abs=1e-4)


def test_behind_a_move_that_waits_for_the_brake() -> None:
    rig = Rig(Bench, config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.5))
    rig.until(lambda: rig.axis.power.parked, 10.0)
    first, second = to(rig, 1.0), to(rig, -1.0, **BUFFERED)
    assert (outputs(first), outputs(second)) == ({"busy"}, {"busy"}), "the brake is still closed"
    assert outputs(to(rig, 5.0, **BUFFERED)) == {"error"}
    rig.until(lambda: first.active)
    assert outputs(second) == {"busy"}
    rig.until(lambda: second.active)
    assert rig.pos_deg == pytest.approx(1.0, abs=0.005)
    rig.until(lambda: second.done)
    assert rig.pos_deg == pytest.approx(-1.0, abs=1e-4)


def test_a_stop_while_both_wait_for_the_brake_drops_both() -> None:
    rig = Rig(Bench, config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.5))
    rig.until(lambda: rig.axis.power.parked, 10.0)
    first, second = to(rig, 1.0), to(rig, -1.0, **BUFFERED)
    call(rig, Stop(rig.axis), execute=True)
    rig.run(10.0)
    assert (outputs(first), outputs(second)) == ({"command_aborted"}, {"command_aborted"})
    assert rig.pos_deg == 0.0


# --- MoveAdditive ---------------------------------------------------------------------------------


@pytest.mark.parametrize("after_s", [0.05, 0.8])
def test_additive_goes_on_from_the_target(rig: Rig, after_s: float) -> None:
    first = to(rig, 5.0)
    rig.run(after_s)
    add = MoveAdditive(rig.axis)
    call(rig, add, execute=True, distance_rad=rad(2.0), **FAST)
    rig.until(lambda: not add.busy)
    assert outputs(first) == {"command_aborted"}
    assert rig.pos_deg == pytest.approx(7.0, abs=1e-4)


def test_additive_at_rest_or_in_a_halt_goes_from_the_set_point(rig: Rig) -> None:
    add = MoveAdditive(rig.axis)
    call(rig, add, execute=True, distance_rad=rad(2.0), **FAST)
    rig.until(lambda: add.done)
    assert rig.pos_deg == pytest.approx(2.0, abs=1e-4)
    to(rig, 30.0)
    rig.run(2.0)
    call(rig, Halt(rig.axis), execute=True)
    here = rig.ref_deg
    again = MoveAdditive(rig.axis)
    call(rig, again, execute=True, distance_rad=rad(10.0), **FAST)
    rig.until(lambda: not again.busy)
    # One scan at 6 deg/s lies between reading the set-point and the command.
    assert rig.pos_deg == pytest.approx(here + 10.0, abs=0.007)


# --- ramps of one motion --------------------------------------------------------------------------


def accelerations(rig: Rig, block: MoveAbsolute) -> tuple[float, float]:
    """Largest acceleration and deceleration of the set-point until the block ends, deg/s2."""
    most, least = 0.0, 0.0
    while block.busy:
        rig.step()
        most = max(most, math.degrees(rig.axis.virtual.acc_ref_rad_s2))
        least = min(least, math.degrees(rig.axis.virtual.acc_ref_rad_s2))
    return most, least


def test_a_motion_takes_the_ramps_that_it_was_given_and_the_next_one_the_machines(rig: Rig) -> None:
    gentle = to(rig, 10.0, acceleration_rad_s2=rad(1.0), deceleration_rad_s2=rad(0.5))
    assert accelerations(rig, gentle) == (pytest.approx(1.0), pytest.approx(-0.5))
    # 4 deg/s2 both ways is the machine of the rig.
    assert accelerations(rig, to(rig, 30.0)) == (pytest.approx(4.0), pytest.approx(-4.0))


def test_a_new_speed_keeps_the_ramps_of_the_motion(rig: Rig) -> None:
    gentle = to(rig, 20.0, acceleration_rad_s2=rad(1.0))
    rig.run(0.5)
    rig.axis.set_override(0.5)
    most, _ = accelerations(rig, gentle)
    assert most == pytest.approx(1.0)


def test_override_0_and_halt_stop_on_the_ramp_of_the_machine(rig: Rig) -> None:
    """Somebody who turns the override down does not wait 60 s for the ramp of a gentle motion."""
    to(rig, 150.0, deceleration_rad_s2=rad(0.1))
    rig.run(3.0)
    rig.axis.set_override(0.0)
    rig.run(6.0 / 4.0 + 0.01)
    assert rig.vel_deg_s == 0.0
    rig.axis.set_override(1.0)
    rig.run(3.0)
    call(rig, Halt(rig.axis), execute=True)
    rig.run(6.0 / 4.0 + 0.01)
    assert rig.vel_deg_s == 0.0


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf, rad(4.1)])
@pytest.mark.parametrize("name", ["acceleration_rad_s2", "deceleration_rad_s2"])
def test_ramps_above_the_machines_are_refused(rig: Rig, name: str, bad: float) -> None:
    block = to(rig, 10.0, **{name: bad})
    assert outputs(block) == {"error"}
    assert "at most 4 deg/s2" in block.error_text
    assert rig.axis.state is AxisState.STANDSTILL


def test_a_jerk_rounds_trapezoids(rig: Rig) -> None:
    block = to(rig, 10.0, jerk_rad_s3=rad(2.0))
    rig.step()
    # After two scans of 1 ms, and not 4 deg/s2 at once.
    assert math.degrees(rig.axis.virtual.acc_ref_rad_s2) <= 2.0 * 0.002 + 1e-9
    for bad in (0.0, -1.0, math.nan):
        assert outputs(to(rig, 1.0, jerk_rad_s3=bad)) == {"error"}
    assert block.busy
