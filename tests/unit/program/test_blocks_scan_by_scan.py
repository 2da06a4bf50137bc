"""Blocks call by call, on an axis that writes down what it is asked for."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.image import DigitalInputs, DriveState
from gantryctl.program import Code, Reaction
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.motion_command import CommandStatus, MotionCommand
from gantryctl.program.axis.states import AxisState
from gantryctl.program.blocks import (
    BrakeTest,
    Halt,
    Home,
    Inch,
    Jog,
    MoveAbsolute,
    MoveAdditive,
    MoveRelative,
    MoveVelocity,
    Power,
    ReadAxisError,
    ReadAxisInfo,
    ReadMotionState,
    Reset,
    SetOverride,
    SetPosition,
    Stop,
)
from gantryctl.program.power.brake_test import BrakeTestOutcome, BrakeTestPhase
from gantryctl.units import rad
from unit.program.asked_axis import REFUSED, Asked
from unit.program.block_bench import outputs
from unit.program.parts import BOTH

DONE, ABORTED, WAITING, ACTIVE = (
    CommandStatus.DONE,
    CommandStatus.ABORTED,
    CommandStatus.WAITING,
    CommandStatus.ACTIVE,
)


WAY = {"distance_rad": 1.0, "velocity_rad_s": 2.0}
EXECUTES = {
    MoveAbsolute: {"position_rad": 1.0, "velocity_rad_s": 2.0},
    MoveRelative: WAY,
    MoveAdditive: WAY,
    MoveVelocity: {"velocity_rad_s": 2.0},
    Halt: {},
    Stop: {},
    Home: {"position_rad": 1.0},
}


# --- every block with Execute -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", EXECUTES)
def test_a_command_is_begun_once_an_edge_and_never_without_execute(kind: Any) -> None:
    axis, inputs = Asked(), EXECUTES[kind]
    block = kind(axis)
    for execute, begun in ((False, 0), (False, 0), (True, 1), (True, 1), (False, 1), (True, 2), (True, 2)):
        block(execute=execute, **inputs)
        assert sum(order[0] != "release stop" for order in axis.orders) == begun
    assert outputs(block) == {"busy", "active"}
    assert axis.refusals == []


@pytest.mark.parametrize("kind", [MoveAbsolute, Halt, Stop])
def test_a_command_shows_waiting_active_and_its_end_while_execute_is_true(kind: Any) -> None:
    axis, inputs = Asked(), EXECUTES[kind]
    block = kind(axis)
    block(execute=True, **inputs)
    command = block.command
    assert block.attention is False, "it tells when its status changes"
    command.status = WAITING
    assert block.attention is True
    block(execute=True, **inputs)
    assert (outputs(block), block.attention) == ({"busy"}, False)
    command.status = ACTIVE
    block(execute=True, **inputs)
    assert outputs(block) == {"busy", "active"}
    command.status = DONE
    assert block.attention is True
    for _ in range(3):
        block(execute=True, **inputs)
        assert (outputs(block), block.attention, block.command) == ({"done"}, False, None)
    block(execute=False, **inputs)
    assert (outputs(block), block.attention) == (set(), False)


@pytest.mark.parametrize(
    ("status", "shown"), [(DONE, "done"), (ABORTED, "command_aborted"), (CommandStatus.ERROR, "error")]
)
def test_an_end_shows_for_one_call_where_execute_has_fallen_before(status: CommandStatus, shown: str) -> None:
    axis = Asked()
    block = Halt(axis)
    block(execute=True)
    block(execute=False)
    assert (outputs(block), block.attention) == ({"busy", "active"}, False)
    if status is CommandStatus.ERROR:
        block.command.fail(REFUSED)
    else:
        block.command.status = status
    block(execute=False)
    assert outputs(block) == {shown}
    assert block.attention, "it is to be called once more"
    if shown == "error":
        assert (block.error_id, block.error_text) == (Code.PWR_03, REFUSED.text)
    block(execute=False)
    assert (outputs(block), block.attention) == (set(), False)
    assert (block.error_id, block.error_text) == (None, "")


def test_a_refusal_is_reported_once_and_gone_with_the_next_edge() -> None:
    axis = Asked()
    axis.refused = REFUSED
    block = Halt(axis)
    for _ in range(3):
        block(execute=True)
        assert (outputs(block), block.error_id) == ({"error"}, Code.PWR_03)
    assert axis.refusals == [REFUSED]
    axis.refused = None
    block(execute=False)
    block(execute=True)
    assert outputs(block) == {"busy", "active"}
    assert axis.refusals == [REFUSED]


def test_an_edge_takes_the_end_of_the_command_before_away() -> None:
    axis = Asked()
    block = Halt(axis)
    block(execute=True)
    first = block.command
    block(execute=False)
    block(execute=True)
    second = block.command
    assert second is not first
    first.status = ABORTED
    block(execute=True)
    assert outputs(block) == {"busy", "active"}
    block(execute=False)
    second.status = DONE
    block(execute=False)
    assert outputs(block) == {"done"}
    block(execute=True)
    assert outputs(block) == {"busy", "active"}


# --- speed, stop ------------------------------------------------------------------------------------------------------


def test_a_speed_is_reached_while_it_has_the_axis_and_is_looked_at_in_every_call() -> None:
    axis = Asked()
    block = MoveVelocity(axis)
    block(execute=True, velocity_rad_s=2.0)
    assert (block.in_velocity, block.attention) == (False, True)
    axis.speed_is_reached = True
    block(execute=True, velocity_rad_s=2.0)
    assert block.in_velocity
    block.command.status = WAITING
    block(execute=True, velocity_rad_s=2.0)
    assert not block.in_velocity
    block.command.status = ABORTED
    block(execute=True, velocity_rad_s=2.0)
    assert (block.in_velocity, block.attention, outputs(block)) == (False, False, {"command_aborted"})
    block(execute=False, velocity_rad_s=2.0)
    block(execute=True, velocity_rad_s=2.0)
    block(execute=False, velocity_rad_s=2.0)
    block.command.status = ABORTED
    block(execute=False, velocity_rad_s=2.0)
    assert block.attention, "its end has been shown, and is to be taken away"


def test_only_a_speed_that_has_come_to_the_end_of_travel_is_an_error() -> None:
    for status, reason, shown in (
        (DONE, REFUSED, {"error"}),
        (DONE, None, {"done"}),
        (ABORTED, REFUSED, {"command_aborted"}),
        (ABORTED, None, {"command_aborted"}),
    ):
        block = MoveVelocity(Asked())
        block(execute=True, velocity_rad_s=2.0)
        command = block.command
        command.refusal = reason
        command.status = status
        block(execute=True, velocity_rad_s=2.0)
        assert outputs(block) == shown


def test_a_stop_is_let_go_once_as_execute_falls() -> None:
    axis = Asked()
    block = Stop(axis)
    block(execute=False)
    block(execute=True)
    command = block.command
    block(execute=True)
    assert axis.orders == [("stop",)]
    block(execute=False)
    block(execute=False)
    assert axis.orders == [("stop",), ("release stop", command)]
    assert outputs(block) == {"busy", "active"}
    command.status = DONE
    block(execute=False)
    assert outputs(block) == {"done"}


# --- by hand ----------------------------------------------------------------------------------------------------------


def keys(way: float, pressed: bool = True, other: bool = False) -> dict[str, bool]:
    forward, backward = (pressed, other) if way > 0.0 else (other, pressed)
    return {"forward": forward, "backward": backward}


@BOTH
def test_a_key_moves_its_way_while_it_is_held_and_is_let_go_once(way: float) -> None:
    axis = Asked()
    jog = Jog(axis)
    jog(**keys(way, False), velocity_rad_s=2.0)
    assert axis.orders == []
    for _ in range(3):
        jog(**keys(way), velocity_rad_s=2.0)
    command = jog.command
    assert axis.orders == [("velocity", way * 2.0, "held")]
    jog(**keys(way, False), velocity_rad_s=2.0)
    jog(**keys(way, False), velocity_rad_s=2.0)
    # Another way while it comes to rest: refused, and let go no second time.
    jog(**keys(-way), velocity_rad_s=2.0)
    assert axis.orders == [("velocity", way * 2.0, "held"), ("release", command)]
    assert axis.refusals[-1].values["reason"] is Words.REVERSAL_FROM_REST
    jog(**keys(way, False), velocity_rad_s=2.0)
    # The same way it may go on.
    jog(**keys(way), velocity_rad_s=2.0)
    assert axis.orders[2:] == [("velocity", way * 2.0, "held")]


@BOTH
def test_both_keys_let_go_and_the_one_that_stays_begins_nothing(way: float) -> None:
    axis = Asked()
    jog = Jog(axis)
    jog(**keys(way), velocity_rad_s=2.0)
    command = jog.command
    jog(forward=True, backward=True, velocity_rad_s=2.0)
    assert axis.orders[1:] == [("release", command)]
    command.status = ABORTED
    jog(**keys(way, False, True), velocity_rad_s=2.0)
    jog(**keys(way, False), velocity_rad_s=2.0)
    assert len(axis.orders) == 2
    # From rest the other way is open, also in the call that sees the end.
    jog(**keys(-way), velocity_rad_s=2.0)
    assert axis.orders[2:] == [("velocity", -way * 2.0, "held")]
    jog.command.status = DONE
    jog(**keys(way), velocity_rad_s=2.0)
    assert axis.orders[-1] == ("velocity", way * 2.0, "held")


@BOTH
def test_the_end_of_travel_shows_while_the_key_is_held_and_goes_with_the_next_motion(way: float) -> None:
    axis = Asked()
    jog = Jog(axis)
    assert jog.at_limit is False
    jog(**keys(way), velocity_rad_s=2.0)
    jog.command.refusal = REFUSED
    jog.command.status = DONE
    for _ in range(2):
        jog(**keys(way), velocity_rad_s=2.0)
        assert (jog.at_limit, outputs(jog)) == (True, {"done"})
    jog(**keys(way), velocity_rad_s=3.0)
    jog(**keys(way, False), velocity_rad_s=2.0)
    assert outputs(jog) == set()
    assert len(axis.orders) == 1, "of what has ended nothing is changed or let go"
    jog(**keys(-way), velocity_rad_s=2.0)
    assert not jog.at_limit
    for status, reason in ((DONE, None), (ABORTED, REFUSED)):
        jog.command.refusal = reason
        jog.command.status = status
        jog(**keys(-way), velocity_rad_s=2.0)
        assert not jog.at_limit
        jog(**keys(-way, False), velocity_rad_s=2.0)
        jog(**keys(-way), velocity_rad_s=2.0)


def test_a_key_begins_beside_no_other_motion_and_with_no_speed_that_is_none() -> None:
    axis = Asked()
    jog = Jog(axis)
    axis.current = MotionCommand(AxisState.DISCRETE_MOTION)
    jog(forward=True, backward=False, velocity_rad_s=2.0)
    assert axis.refusals[-1].values["reason"] is Words.JOG_FROM_REST
    axis.current = None
    jog(forward=False, backward=False, velocity_rad_s=2.0)
    jog(forward=True, backward=False, velocity_rad_s=-2.0)
    assert axis.refusals[-1] is REFUSED
    assert axis.orders == []


def test_another_speed_counts_while_the_key_is_held_and_once() -> None:
    axis = Asked()
    jog = Jog(axis)
    jog(forward=False, backward=False, velocity_rad_s=1.0)
    jog(forward=True, backward=False, velocity_rad_s=2.0)
    for speed in (2.0, 3.0, 3.0):
        jog(forward=True, backward=False, velocity_rad_s=speed)
    assert axis.orders[1:] == [("change", 3.0)]
    axis.refused = REFUSED
    jog(forward=True, backward=False, velocity_rad_s=4.0)
    assert axis.refusals == [REFUSED]
    jog(forward=False, backward=False, velocity_rad_s=4.0)
    jog(forward=False, backward=False, velocity_rad_s=5.0)
    assert [order[0] for order in axis.orders] == ["velocity", "change", "change", "release"]


@BOTH
def test_an_increment_is_one_edge_and_shows_its_end_while_the_key_is_held(way: float) -> None:
    axis = Asked()
    inch = Inch(axis)
    step = {"distance_rad": 0.5, "velocity_rad_s": 2.0}
    for _ in range(3):
        inch(**keys(way), **step)
    assert axis.orders == [("relative", way * 0.5, 2.0)]
    inch.command.status = DONE
    for _ in range(2):
        inch(**keys(way), **step)
        assert outputs(inch) == {"done"}
    inch(**keys(way, False), **step)
    assert outputs(inch) == set()
    inch(**keys(way), **step)
    assert len(axis.orders) == 2


def test_an_increment_that_is_none_is_told_in_degrees() -> None:
    axis = Asked()
    inch = Inch(axis)
    inch(forward=True, backward=False, distance_rad=rad(361.0), velocity_rad_s=2.0)
    (refused,) = axis.refusals
    assert refused.values["allowed"].values == {"high": pytest.approx(360.0)}
    assert refused.values["measured"].values == {"value": pytest.approx(361.0)}


# --- administration ---------------------------------------------------------------------------------------------------


def test_power_is_asked_for_by_edges_and_ends_with_the_first_alarm() -> None:
    axis = Asked()
    power = Power(axis)
    assert power.attention is False
    for enable in (False, True, True):
        power(enable=enable)
    assert axis.orders == [("on",)]
    axis.power.status = True
    assert power.attention is True
    power(enable=True)
    assert (power.status, power.attention) == (True, False)
    axis.alarms.raise_(Code.PWR_01, measured="at 0")
    assert power.attention is True
    power(enable=True)
    assert (power.error, power.error_id) == (True, Code.PWR_01)
    # Another one after a reset is not one of this power-up.
    axis.alarms.clear()
    axis.alarms.raise_(Code.DRV_07, measured=1.0, limit=1.0)
    power(enable=True)
    assert power.error_id == Code.PWR_01
    power(enable=False)
    assert (power.error, axis.orders) == (False, [("on",), ("off",)])
    axis.alarms.clear()
    axis.refused = REFUSED
    power(enable=True)
    assert (power.error_id, axis.refusals) == (Code.PWR_03, [REFUSED])


def test_a_reset_is_busy_until_the_drive_has_followed_and_shows_how_it_ended() -> None:
    axis = Asked()
    reset = Reset(axis)
    reset(execute=False, service=True)
    assert axis.orders == []
    for failure, shown in ((None, {"done"}), (REFUSED, {"error"})):
        axis.recovery.resetting, axis.recovery.failure = True, failure
        for _ in range(2):
            reset(execute=True, service=True)
            assert outputs_of(reset) == {"busy"}
        # It is not given up as Execute falls.
        reset(execute=False, service=True)
        axis.refused = REFUSED
        reset(execute=True, service=True)
        assert reset.busy, "a push that is refused takes nothing from it"
        axis.refused = None
        axis.recovery.resetting = False
        for _ in range(2):
            reset(execute=True, service=True)
            assert outputs_of(reset) == shown
        reset(execute=False, service=True)
        assert outputs_of(reset) == set()
    assert axis.orders == [("reset", True)] * 4
    # A new one takes the end of the one before away, also where that is shown for one call.
    axis.recovery.failure, axis.recovery.resetting = None, True
    reset(execute=True)
    axis.recovery.resetting = False
    reset(execute=False)
    assert outputs_of(reset) == {"done"}
    axis.recovery.resetting = True
    reset(execute=True)
    assert outputs_of(reset) == {"busy"}
    axis.recovery.resetting = False
    reset(execute=True)
    reset(execute=False)
    axis.refused = REFUSED
    reset(execute=True)
    assert outputs_of(reset) == {"error"}
    assert axis.orders[-1] == ("reset", False)


def outputs_of(reset: Reset) -> set[str]:
    return {name for name in ("busy", "done", "error") if getattr(reset, name)}


def test_an_override_is_set_where_it_changes_and_the_block_is_enabled() -> None:
    axis = Asked()
    override = SetOverride(axis)
    for enable, value in (
        (True, 1.0),
        (False, 0.5),
        (True, 0.5),
        (True, 0.5),
        (True, math.nan),
        (True, math.nan),
    ):
        override(enable=enable, override=value)
        assert override.enabled is enable
    assert [order[1] for order in axis.orders] == [0.5, pytest.approx(math.nan, nan_ok=True)]


def test_a_position_is_set_once_an_edge() -> None:
    axis = Asked()
    block = SetPosition(axis)
    for execute, done in ((False, False), (True, True), (True, True), (False, False)):
        block(execute=execute, position_rad=1.0)
        assert block.done is done
    assert axis.orders == [("position", 1.0)]
    axis.refused = REFUSED
    block(execute=True, position_rad=2.0)
    assert (block.done, block.error_id) == (False, Code.PWR_03)


@pytest.mark.parametrize(
    ("outcome", "shown"),
    [
        (BrakeTestOutcome.PASSED, {"done"}),
        (BrakeTestOutcome.ABORTED, {"command_aborted"}),
        (BrakeTestOutcome.FAILED, {"error"}),
    ],
)
@pytest.mark.parametrize("held", [True, False])
def test_a_brake_test_shows_its_figures_and_its_end(outcome: object, shown: set[str], held: bool) -> None:
    axis = Asked()
    block, test = BrakeTest(axis), axis.brake_test
    block(execute=False)
    assert (axis.orders, block.attention) == ([], False)
    for _ in range(2):
        block(execute=True)
        assert (outputs_of_test(block), block.attention) == ({"busy"}, True)
    test.phase, test.plus_nm, test.minus_nm, test.moved_rad = BrakeTestPhase.PLUS_RISING, 1.0, 2.0, 3.0
    block(execute=held)
    assert (block.phase, block.plus_nm, block.minus_nm, block.moved_rad) == (
        BrakeTestPhase.PLUS_RISING, 1.0, 2.0, 3.0,
    )  # fmt: skip
    test.count, test.outcome = 5, outcome
    block(execute=held)
    assert (outputs_of_test(block), block.attention) == (shown, not held)
    if outcome is BrakeTestOutcome.FAILED:
        assert block.error_id is Code.BRK_08
    block(execute=held)
    assert outputs_of_test(block) == (shown if held else set())
    block(execute=False)
    assert (outputs_of_test(block), block.attention) == (set(), False)
    assert axis.orders == [("test",)]
    # The next one knows nothing of it; a second edge on the way starts nothing.
    for execute in (True, False, True):
        block(execute=execute)
        assert (outputs_of_test(block), len(axis.orders)) == ({"busy"}, 2)
    block(execute=False)
    test.count = 6
    block(execute=False)
    assert outputs_of_test(block) == shown
    block(execute=True)
    assert (outputs_of_test(block), len(axis.orders)) == ({"busy"}, 3)


def test_a_brake_test_that_is_refused_shows_that_while_execute_is_true() -> None:
    axis = Asked()
    axis.refused = REFUSED
    block = BrakeTest(axis)
    for _ in range(2):
        block(execute=True)
        assert (outputs_of_test(block), block.attention) == ({"error"}, False)
    assert axis.orders == [("test",)]
    block(execute=False)
    assert outputs_of_test(block) == set()


def outputs_of_test(block: BrakeTest) -> set[str]:
    return {name for name in ("busy", "done", "command_aborted", "error") if getattr(block, name)}


# --- reading ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("enable", [True, False])
@pytest.mark.parametrize("at_rest", [True, False])
@BOTH
def test_the_state_of_motion_is_that_of_a_set_point_that_moves(
    way: float, at_rest: bool, enable: bool
) -> None:
    axis = Asked()
    motion = ReadMotionState(axis)
    for vel, acc, shown in (
        (0.5, 0.0, {"constant_velocity", "ahead"}),
        (0.5, 0.25, {"accelerating", "ahead"}),
        (0.5, -0.25, {"decelerating", "ahead"}),
        (0.0, 0.25, {"accelerating"}),
        (0.0, 0.0, {"constant_velocity"}),
    ):
        axis.virtual = SimpleNamespace(vel_ref_rad_s=way * vel, acc_ref_rad_s2=way * acc, at_rest=at_rest)
        motion(enable=enable)
        assert motion.valid is enable
        found = {
            name for name in ("constant_velocity", "accelerating", "decelerating") if getattr(motion, name)
        }
        ahead, back = motion.direction_positive, motion.direction_negative
        if way < 0.0:
            ahead, back = back, ahead
        assert not back
        assert found | ({"ahead"} if ahead else set()) == (shown if enable and not at_rest else set())


@pytest.mark.parametrize(
    "shown", ["limit_switch_pos", "limit_switch_neg", "axis_warning", "is_homed", "power_on"]
)
def test_each_of_what_an_axis_is_ready_for_is_told_by_itself(shown: str) -> None:
    axis = Asked()
    limits = DigitalInputs(
        limit_plus_ok=shown != "limit_switch_pos", limit_minus_ok=shown != "limit_switch_neg"
    )
    axis.feedback = SimpleNamespace(
        inputs=limits, state=DriveState.FAULT, state_old=True, position_valid=shown == "is_homed"
    )
    axis.power.status = shown == "power_on"
    if shown == "axis_warning":
        axis.alarms.raise_(Code.CTL_12, measured=1.0, limit=1.0, trip=2.0)
        assert axis.alarms.active[Code.CTL_12].reaction is Reaction.W
    else:
        axis.alarms.raise_(Code.DRV_07, measured=1.0, limit=1.0)
    info = ReadAxisInfo(axis)
    info(enable=False)
    names = (
        "limit_switch_pos",
        "limit_switch_neg",
        "axis_warning",
        "is_homed",
        "power_on",
        "communication_ready",
    )
    assert [name for name in names if getattr(info, name)] == []
    assert not info.valid
    info()
    assert [name for name in names if getattr(info, name)] == [shown]
    assert info.valid
    axis.feedback.state_old = False
    info()
    assert info.communication_ready
    axis.feedback.state = DriveState.UNKNOWN
    info()
    assert not info.communication_ready


def test_a_reader_is_valid_while_it_is_enabled() -> None:
    axis = Asked()
    error = ReadAxisError(axis)
    axis.alarms.raise_(Code.DRV_07, measured=1.0, limit=1.0)
    for enable, code in ((False, None), (True, Code.DRV_07)):
        error(enable=enable)
        assert (error.valid, error.axis_error_id) == (enable, code)
