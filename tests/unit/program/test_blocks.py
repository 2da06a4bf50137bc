"""Blocks: PLCopen's rules for Execute and the outputs, and what each block does."""

import itertools
import math

import pytest

from gantryctl.program import AxisProgram, AxisState, blocks
from gantryctl.program.blocks import (
    Halt,
    Home,
    Jog,
    MoveAbsolute,
    MoveRelative,
    MoveVelocity,
    SetOverride,
    SetPosition,
    Stop,
)
from gantryctl.units import deg, rad
from unit.program.block_bench import FINAL, Bench, call, outputs, standing
from unit.program.rig import Rig


@pytest.fixture
def rig():
    return standing()


# --- Execute, Busy, Active, Done, CommandAborted, Error -------------------------------------------


def test_done_stays_while_execute_is_true(rig):
    move = MoveAbsolute(rig.axis)
    call(rig, move, execute=True, position_rad=rad(1.0), velocity_rad_s=rad(6.0))
    assert outputs(move) == {"busy", "active"}, "in the scan of the rising edge"
    rig.until(lambda: not move.busy)
    for _ in range(10):
        assert outputs(move) == {"done"}
        rig.step()
    call(rig, move, execute=False, position_rad=0.0, velocity_rad_s=0.0)
    assert outputs(move) == set()


def test_done_shows_for_one_scan_when_execute_fell_before(rig):
    move = MoveAbsolute(rig.axis)
    call(rig, move, execute=True, position_rad=rad(1.0), velocity_rad_s=rad(6.0))
    call(rig, move, execute=False, position_rad=rad(5.0), velocity_rad_s=rad(6.0))
    assert outputs(move) == {"busy", "active"}, "a falling edge does not end the motion"
    rig.until(lambda: not move.busy)
    assert outputs(move) == {"done"}
    rig.step()
    assert outputs(move) == set()
    assert rig.pos_deg == pytest.approx(1.0, abs=1e-4), "inputs count at the rising edge only"


def test_inputs_count_at_the_rising_edge_only(rig):
    move = MoveAbsolute(rig.axis)
    call(rig, move, execute=True, position_rad=rad(1.0), velocity_rad_s=rad(6.0))
    call(rig, move, execute=True, position_rad=rad(math.nan), velocity_rad_s=-1.0)
    rig.until(lambda: move.done)
    assert rig.pos_deg == pytest.approx(1.0, abs=1e-4)


def test_a_second_block_aborts_the_first(rig):
    first, second = MoveAbsolute(rig.axis), MoveAbsolute(rig.axis)
    call(rig, first, execute=True, position_rad=rad(50.0), velocity_rad_s=rad(6.0))
    rig.run(2.0)
    call(rig, second, execute=True, position_rad=rad(-3.0), velocity_rad_s=rad(6.0))
    rig.step()
    assert outputs(first) == {"command_aborted"}
    assert outputs(second) == {"busy", "active"}
    rig.until(lambda: second.done)
    assert rig.pos_deg == pytest.approx(-3.0, abs=1e-4)
    assert outputs(first) == {"command_aborted"}, "for as long as its Execute stays TRUE"


def test_a_rising_edge_again_starts_again(rig):
    move = MoveAbsolute(rig.axis)
    for target in (1.0, -1.0):
        call(rig, move, execute=True, position_rad=rad(target), velocity_rad_s=rad(6.0))
        rig.until(lambda: move.done)
        assert rig.pos_deg == pytest.approx(target, abs=1e-4)
        call(rig, move, execute=False, position_rad=0.0, velocity_rad_s=0.0)


def test_exactly_one_final_output(rig):
    """Over a whole life of a block: never two of done, aborted, error, and none with busy."""
    move, halt = MoveAbsolute(rig.axis), Halt(rig.axis)
    script = [(True, 5.0), (False, 0.0), (True, 400.0), (False, 0.0), (True, -2.0)]
    for execute, target in script:
        call(rig, move, execute=execute, position_rad=rad(target), velocity_rad_s=rad(6.0))
        call(rig, halt, execute=target == -2.0)
        for _ in range(400):
            rig.step()
            for block in (move, halt):
                shown = [name for name in FINAL if getattr(block, name)]
                assert len(shown) + block.busy <= 1
                assert not block.active or block.busy


BAD_NUMBERS = [math.nan, math.inf, -math.inf, 1e300, -1e300]


@pytest.mark.parametrize("bad", BAD_NUMBERS)
def test_bad_numbers_are_errors_and_no_motion(rig, bad):
    before = rig.ref_deg
    blocks = [
        (MoveAbsolute(rig.axis), {"position_rad": bad, "velocity_rad_s": rad(1.0)}),
        (MoveAbsolute(rig.axis), {"position_rad": 0.1, "velocity_rad_s": bad}),
        (MoveRelative(rig.axis), {"distance_rad": bad, "velocity_rad_s": rad(1.0)}),
        (MoveRelative(rig.axis), {"distance_rad": 0.1, "velocity_rad_s": bad}),
        (MoveVelocity(rig.axis), {"velocity_rad_s": bad}),
        (SetPosition(rig.axis), {"position_rad": bad}),
        (Home(rig.axis), {"position_rad": bad}),
    ]
    for block, inputs in blocks:
        refusals = rig.axis.refusal_count
        call(rig, block, execute=True, **inputs)
        assert block.error, block
        assert block.error_id is not None
        assert block.error_text
        assert rig.axis.refusal_count == refusals + 1
        rig.run(0.01)
        assert rig.ref_deg == before
        assert rig.axis.state is AxisState.STANDSTILL


@pytest.mark.parametrize("speed_deg_s", [0.0, -1.0, 6.000001, 100.0])
def test_a_speed_outside_the_range_is_refused_not_clamped(rig, speed_deg_s):
    move = MoveAbsolute(rig.axis)
    call(rig, move, execute=True, position_rad=rad(5.0), velocity_rad_s=rad(speed_deg_s))
    assert move.error_id == "CTL-01"
    assert "speed must be above 0 and at most 6 deg/s" in move.error_text


def test_no_motion_without_power():
    rig = Rig(AxisProgram)
    for motion in (
        rig.axis.motion.move_absolute(0.1, 0.01),
        rig.axis.motion.move_relative(0.1, 0.01),
        rig.axis.motion.move_velocity(0.01),
        rig.axis.motion.halt(),
        rig.axis.motion.stop(),
    ):
        assert motion.refusal is not None
        assert motion.refusal.text == "power is off"
    rig.run(0.1)
    assert rig.output.vel_cmd_rad_s == 0.0


# --- motion blocks --------------------------------------------------------------------------------


def test_move_relative_adds_to_the_set_point(rig):
    move = MoveRelative(rig.axis)
    for _ in range(3):
        call(rig, move, execute=True, distance_rad=rad(-1.5), velocity_rad_s=rad(6.0))
        rig.until(lambda: move.done)
        call(rig, move, execute=False, distance_rad=0.0, velocity_rad_s=0.0)
    assert rig.ref_deg == pytest.approx(-4.5, abs=1e-6)


def test_move_velocity_reaches_its_speed_and_goes_on(rig):
    run = MoveVelocity(rig.axis)
    call(rig, run, execute=True, velocity_rad_s=rad(-4.0))
    assert rig.axis.state is AxisState.CONTINUOUS_MOTION
    assert not run.in_velocity
    rig.run(0.95)
    assert not run.in_velocity
    rig.run(0.1)  # 4 deg/s at 4 deg/s2: 1 s
    assert run.in_velocity
    assert rig.vel_deg_s == pytest.approx(-4.0)
    call(rig, run, execute=False, velocity_rad_s=0.0)
    rig.run(1.0)
    assert run.in_velocity
    assert not run.done


def test_move_velocity_ends_at_the_end_of_travel_with_a_word():
    rig = Rig(Bench, at_deg=170.0)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 5.0)
    run = MoveVelocity(rig.axis)
    call(rig, run, execute=True, velocity_rad_s=rad(6.0))
    rig.until(lambda: not run.busy)
    assert run.error_id == "LIM-01"
    assert run.error_text == "stopped at 180.00 deg, the end of travel"
    assert rig.axis.virtual.pos_ref_rad == rad(180.0)
    rig.step()
    assert rig.axis.state is AxisState.STANDSTILL, "no alarm: the axis goes on to follow commands"


def test_halt_takes_the_normal_ramp_and_another_motion_may_take_over(rig):
    run, halt, move = MoveVelocity(rig.axis), Halt(rig.axis), MoveAbsolute(rig.axis)
    call(rig, run, execute=True, velocity_rad_s=rad(6.0))
    rig.run(2.0)
    before = rig.ref_deg
    call(rig, halt, execute=True)
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    rig.until(lambda: halt.done)
    assert rig.ref_deg - before == pytest.approx(36.0 / 8.0, abs=0.01), "v^2 / 2a at 4 deg/s2"
    call(rig, run, execute=False, velocity_rad_s=0.0)
    call(rig, halt, execute=False)
    call(rig, run, execute=True, velocity_rad_s=rad(6.0))
    rig.run(2.0)
    call(rig, halt, execute=True)
    rig.run(0.5)
    call(rig, move, execute=True, position_rad=0.0, velocity_rad_s=rad(6.0))
    rig.step()
    assert halt.command_aborted
    rig.until(lambda: move.done)


def test_halt_at_standstill_is_done_at_once(rig):
    halt = Halt(rig.axis)
    call(rig, halt, execute=True)
    rig.step()
    assert halt.done
    rig.step()
    assert rig.axis.state is AxisState.STANDSTILL


def test_stop_holds_stopping_while_execute_is_true(rig):
    run, stop, move = MoveVelocity(rig.axis), Stop(rig.axis), MoveAbsolute(rig.axis)
    call(rig, run, execute=True, velocity_rad_s=rad(6.0))
    rig.run(2.0)
    before = rig.ref_deg
    call(rig, stop, execute=True)
    rig.step()
    assert run.command_aborted
    assert rig.axis.state is AxisState.STOPPING
    rig.until(lambda: stop.done)
    # 5 deg/s2 with 100 deg/s3: v^2 / 2a + v a / 2j.
    assert rig.ref_deg - before == pytest.approx(3.6 + 0.15, abs=0.01)
    rig.run(1.0)
    assert rig.axis.state is AxisState.STOPPING
    call(rig, move, execute=True, position_rad=0.0, velocity_rad_s=rad(6.0))
    assert move.error_id == "CTL-14"
    assert "held by Stop" in move.error_text
    call(rig, move, execute=False, position_rad=0.0, velocity_rad_s=0.0)
    call(rig, stop, execute=False)
    rig.step()
    assert rig.axis.state is AxisState.STANDSTILL


def test_stop_released_early_still_comes_to_rest(rig):
    run, stop = MoveVelocity(rig.axis), Stop(rig.axis)
    call(rig, run, execute=True, velocity_rad_s=rad(6.0))
    rig.run(2.0)
    call(rig, stop, execute=True)
    call(rig, stop, execute=False)
    rig.run(0.5)
    assert rig.axis.state is AxisState.STOPPING
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL)
    assert rig.vel_deg_s == 0.0


def test_halt_does_not_weaken_a_stop_under_way(rig):
    jog, halt = Jog(rig.axis), Halt(rig.axis)
    call(rig, jog, forward=True, backward=False, velocity_rad_s=rad(6.0))
    rig.run(2.0)
    before = rig.ref_deg
    call(rig, jog, forward=False, backward=False, velocity_rad_s=rad(6.0))
    call(rig, halt, execute=True)
    rig.until(lambda: halt.done)
    assert rig.ref_deg - before == pytest.approx(3.75, abs=0.02)


# --- override -------------------------------------------------------------------------------------


def test_override_acts_on_the_motion_under_way(rig):
    move, override = MoveAbsolute(rig.axis), SetOverride(rig.axis)
    call(rig, move, execute=True, position_rad=rad(60.0), velocity_rad_s=rad(6.0))
    rig.run(2.0)
    rig.keep_rows = True
    call(rig, override, override=0.5)
    rig.run(1.0)
    assert rig.vel_deg_s == pytest.approx(3.0)
    call(rig, override, override=0.0)
    rig.run(1.5)
    assert rig.vel_deg_s == 0.0
    assert move.busy
    assert not move.done
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    call(rig, override, override=1.0)
    rig.until(lambda: move.done)
    assert rig.ref_deg == pytest.approx(60.0)
    speeds = [deg(row[1]) for row in rig.rows]
    steps = [abs(after - before) for before, after in itertools.pairwise(speeds)]
    assert max(steps) <= 4.0 * 0.001 * (1 + 1e-9), "never a jump: at most the ramp in one scan"


def test_override_zero_before_a_motion_holds_it_back(rig):
    move, override = MoveAbsolute(rig.axis), SetOverride(rig.axis)
    call(rig, override, override=0.0)
    call(rig, move, execute=True, position_rad=rad(5.0), velocity_rad_s=rad(6.0))
    rig.run(1.0)
    assert move.busy
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-6)
    call(rig, override, override=0.25)
    rig.run(1.0)
    assert rig.vel_deg_s == pytest.approx(1.5)
    rig.until(lambda: move.done)


@pytest.mark.parametrize("bad", [-0.01, 1.01, math.nan, math.inf])
def test_override_outside_its_range_is_refused_once(rig, bad):
    override = SetOverride(rig.axis)
    before = rig.axis.refusal_count
    call(rig, override, override=bad)
    rig.run(0.1)
    assert override.error
    assert rig.axis.refusal_count == before + 1
    assert rig.axis.virtual.override == 1.0


def test_override_does_not_act_on_a_stop(rig):
    run, stop, override = MoveVelocity(rig.axis), Stop(rig.axis), SetOverride(rig.axis)
    call(rig, run, execute=True, velocity_rad_s=rad(6.0))
    rig.run(2.0)
    call(rig, stop, execute=True)
    end = rig.axis.virtual.plan.pos_end
    call(rig, override, override=0.1)
    rig.until(lambda: stop.done)
    assert rig.axis.virtual.pos_ref_rad == end


BLOCKS = (
    "BrakeTest Halt Home Inch Jog MoveAbsolute MoveAdditive MoveRelative MoveVelocity Power ReadActualPosition "
    "ReadAxisError ReadAxisInfo ReadBoolParameter ReadMotionState ReadParameter ReadStatus Reset SetOverride "
    "SetPosition Stop TouchProbe WriteParameter"
)


@pytest.mark.parametrize("name", BLOCKS.split())
def test_a_block_that_was_never_called_shows_nothing(name):
    block = getattr(blocks, name)(Rig().axis)
    shown = {
        each for kind in type(block).__mro__ for each in getattr(kind, "__slots__", ()) if each[0] != "_"
    }
    for each in shown - {"axis"}:
        value = getattr(block, each)
        assert not value or math.isnan(value), each
