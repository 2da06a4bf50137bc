"""TouchProbe, DigitalCamSwitch, parameters and ReadAxisInfo."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gantryctl.errors import UsageError
from gantryctl.program import AxisState, Code, Reaction
from gantryctl.program.axis.parameters import Parameter, read_bool_parameter, read_parameter
from gantryctl.program.blocks import (
    AbortTrigger,
    Cam,
    CamDirection,
    DigitalCamSwitch,
    MoveAbsolute,
    MoveRelative,
    ReadAxisError,
    ReadAxisInfo,
    ReadBoolParameter,
    ReadParameter,
    TouchProbe,
    WriteParameter,
)
from gantryctl.program.settings import TravelSettings
from gantryctl.units import deg, rad
from unit.program import rig as rigs
from unit.program.block_bench import Bench, call, outputs, standing
from unit.program.rig import COUNTS_PER_TURN, RATIO, Rig, moving_rig

SPEED_DEG_S = 6.0


@pytest.fixture
def rig() -> Rig:
    return standing()


def go(rig: Rig, angle_deg: float) -> MoveAbsolute:
    move = MoveAbsolute(rig.axis)
    call(rig, move, execute=True, position_rad=rad(angle_deg), velocity_rad_s=rad(SPEED_DEG_S))
    return move


def modulo_rig() -> Rig:
    config = rigs.settings()
    config = replace(
        config,
        travel=TravelSettings(-math.inf, math.inf, -math.inf, math.inf, 0.0),
        law=replace(config.law, turn_counts=int(COUNTS_PER_TURN * RATIO)),
    )
    rig = Rig(Bench, config=config)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 5.0)
    rig.run(0.3)
    return rig


# --- TouchProbe -----------------------------------------------------------------------------------


def probe_run(rig: Rig, edge_deg: float, **inputs: object) -> TouchProbe:
    """Move from 0 to 20 deg past a flag that lies from `edge_deg` on for half a degree."""
    probe = TouchProbe(rig.axis)
    move = go(rig, 20.0)
    while move.busy:
        level = edge_deg <= deg(rig.axis.pos_act_rad) < edge_deg + 0.5
        call(rig, probe, execute=True, trigger=level, **inputs)
    return probe


def test_the_angle_of_the_edge_is_kept(rig: Rig) -> None:
    probe = probe_run(rig, 7.3)
    assert probe.done
    assert not probe.busy
    # The program sees the level one scan late, and the flag begins somewhere within the scan before.
    late_deg = deg(probe.recorded_position_rad) - 7.3
    assert 0.0 <= late_deg <= 2.0 * SPEED_DEG_S * 0.001 + 1e-9
    assert deg(probe.uncertainty_rad) == pytest.approx(SPEED_DEG_S * 0.001, rel=0.01)


@pytest.mark.parametrize(("window", "found"), [((5.0, 8.0), True), ((8.0, 9.0), False), ((9.0, 5.0), False)])
def test_edges_outside_the_window_do_not_count(rig: Rig, window: tuple[float, float], found: bool) -> None:
    probe = probe_run(
        rig, 7.3, window_only=True, first_position_rad=rad(window[0]), last_position_rad=rad(window[1])
    )
    assert probe.done is found
    assert probe.busy is not found


def test_a_level_that_is_true_from_the_start_is_no_edge(rig: Rig) -> None:
    probe = TouchProbe(rig.axis)
    for _ in range(5):
        call(rig, probe, execute=True, trigger=True)
    assert probe.busy
    call(rig, probe, execute=True, trigger=False)
    call(rig, probe, execute=True, trigger=True)
    assert probe.done


def test_abort_trigger(rig: Rig) -> None:
    probe = TouchProbe(rig.axis)
    abort = AbortTrigger(probe)
    call(rig, probe, execute=True, trigger=False)
    call(rig, abort, execute=True)
    assert abort.done
    call(rig, probe, execute=True, trigger=True)
    assert (probe.busy, probe.done, probe.command_aborted) == (False, False, True)
    assert math.isnan(probe.recorded_position_rad)


def test_a_window_that_is_no_window_is_an_error(rig: Rig) -> None:
    probe = TouchProbe(rig.axis)
    call(rig, probe, execute=True, trigger=False, window_only=True, last_position_rad=math.nan)
    assert probe.error
    assert not probe.busy


# --- DigitalCamSwitch -----------------------------------------------------------------------------


def drawn(rig: Rig, cams: DigitalCamSwitch, targets_deg: tuple[float, ...]) -> list[list[float]]:
    """Angles at which each track changed, over moves to `targets_deg`; the switch is called once a scan."""
    changes: list[list[float]] = [[] for _ in cams.outputs]
    before = cams.outputs
    for target_deg in targets_deg:
        move = go(rig, target_deg)
        while move.busy:
            call(rig, cams)
            for found, now, was in zip(changes, cams.outputs, before, strict=True):
                if now is not was:
                    found.append(round(deg(rig.axis.settings.travel.shown_rad(rig.axis.pos_act_rad)), 3))
            before = cams.outputs
    return changes


# Way of a scan at 6 deg/s, and what rounding to 0.001 deg adds.
SCAN_DEG = SPEED_DEG_S * 0.001 + 0.0006


def test_tracks_follow_the_angle_and_the_direction(rig: Rig) -> None:
    cams = DigitalCamSwitch(
        rig.axis,
        [
            [Cam(rad(3.0), rad(5.0)), Cam(rad(7.0), rad(8.0))],
            [Cam(rad(3.0), rad(5.0), CamDirection.POSITIVE)],
            [Cam(rad(3.0), rad(5.0), CamDirection.NEGATIVE)],
        ],
    )
    both, positive, negative = drawn(rig, cams, (10.0, 0.0))
    assert both == pytest.approx([3, 5, 7, 8, 8, 7, 5, 3], abs=SCAN_DEG)
    assert positive == pytest.approx([3, 5], abs=SCAN_DEG)
    assert negative == pytest.approx([5, 3], abs=SCAN_DEG)


def test_compensation_switches_where_the_axis_will_be(rig: Rig) -> None:
    cams = DigitalCamSwitch(rig.axis, [[Cam(rad(10.0), rad(20.0))]], on_s=0.1, off_s=0.2)
    # 6 deg/s: 0.6 deg before the one edge, 1.2 deg before the other, both ways; both lie at constant speed.
    assert drawn(rig, cams, (30.0, 0.0))[0] == pytest.approx([9.4, 18.8, 20.6, 11.2], abs=SCAN_DEG)


def test_a_time_based_cam_is_on_for_its_time(rig: Rig) -> None:
    cams = DigitalCamSwitch(rig.axis, [[Cam(rad(10.0), 0.0, CamDirection.POSITIVE, duration_s=0.5)]])
    assert drawn(rig, cams, (30.0, 0.0))[0] == pytest.approx([10.0, 13.0], abs=SCAN_DEG)


def test_hysteresis_keeps_an_angle_at_the_edge_from_chattering(rig: Rig) -> None:
    cams = DigitalCamSwitch(rig.axis, [[Cam(rad(1.0), rad(9.0))]], hysteresis_rad=rad(0.05))
    drawn(rig, cams, (1.01,))
    assert cams.outputs == (True,)
    for target in (0.97, 1.01, 0.96):
        assert drawn(rig, cams, (target,))[0] == []
    assert drawn(rig, cams, (0.9,))[0] == pytest.approx([0.95], abs=SCAN_DEG)


def test_a_cam_over_the_end_of_the_turn() -> None:
    rig = modulo_rig()
    cams = DigitalCamSwitch(
        rig.axis,
        [[Cam(rad(350.0), rad(10.0))], [Cam(rad(0.0), rad(360.0))], [Cam(rad(5.0), 0.0, duration_s=1.0)]],
    )
    call(rig, cams)
    assert cams.outputs == (True, True, False)
    by = MoveRelative(rig.axis)
    call(rig, by, execute=True, distance_rad=rad(400.0), velocity_rad_s=rad(SPEED_DEG_S))
    on_scans, always = [0, 0, 0], 0
    while by.busy:
        call(rig, cams)
        always += 1
        on_scans = [count + on for count, on in zip(on_scans, cams.outputs, strict=True)]
    assert on_scans[1] == always, "a cam of a whole turn is every angle, not none"
    # 0 to 10, 350 to 10 and again 30 deg further on at constant speed; the first 10 with the ramp of 4 deg/s2.
    ramp_s = SPEED_DEG_S / 4.0
    first_s = 10.0 / SPEED_DEG_S + ramp_s / 2.0
    assert on_scans[0] * 0.001 == pytest.approx(first_s + 20.0 / SPEED_DEG_S, abs=0.005)
    assert on_scans[2] * 0.001 == pytest.approx(2.0, abs=0.003), "passed twice"


def test_cams_are_off_where_the_angle_is_not_known(rig: Rig) -> None:
    cams = DigitalCamSwitch(rig.axis, [[Cam(rad(-5.0), rad(5.0))]])
    call(rig, cams)
    assert cams.outputs == (True,)
    call(rig, cams, enable=False)
    assert (cams.in_operation, cams.outputs) == (False, (False,))
    call(rig, cams)
    rig.spoil = lambda feedback: feedback._replace(pos_act_counts=feedback.pos_act_counts + 1e9)
    rig.run(0.1)
    assert (cams.in_operation, cams.outputs) == (False, (False,))


@pytest.mark.parametrize("bad", [{"first_on_rad": math.nan}, {"last_on_rad": math.inf}, {"duration_s": -1.0}])
def test_a_cam_that_is_none_is_refused_when_it_is_made(bad: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="finite"):
        Cam(**{"first_on_rad": 0.0, "last_on_rad": 1.0, **bad})


# --- parameters -----------------------------------------------------------------------------------


def read(rig: Rig, number: int) -> ReadParameter:
    block = ReadParameter(rig.axis)
    call(rig, block, parameter_number=number)
    return block


def write(rig: Rig, number: int, value: float) -> WriteParameter:
    block = WriteParameter(rig.axis)
    call(rig, block, execute=True, parameter_number=number, value=value)
    return block


def test_parameters_have_the_values_of_the_machine(rig: Rig) -> None:
    """The machine of the rig by hand: +-180 deg, 6 deg/s, 4 deg/s2, trapezoids, 0.03 deg at rest."""
    expected = {
        Parameter.COMMANDED_POSITION: 0.0,
        Parameter.SW_LIMIT_POS: rad(180.0),
        Parameter.SW_LIMIT_NEG: rad(-180.0),
        Parameter.MAX_POSITION_LAG: rad(0.03),
        Parameter.MAX_VELOCITY_SYSTEM: rad(6.0),
        Parameter.MAX_VELOCITY_APPL: rad(6.0),
        Parameter.ACTUAL_VELOCITY: 0.0,
        Parameter.COMMANDED_VELOCITY: 0.0,
        Parameter.MAX_ACCELERATION_SYSTEM: rad(4.0),
        Parameter.MAX_ACCELERATION_APPL: rad(4.0),
        Parameter.MAX_DECELERATION_SYSTEM: rad(4.0),
        Parameter.MAX_DECELERATION_APPL: rad(4.0),
        Parameter.MAX_JERK_SYSTEM: math.inf,
        Parameter.MAX_JERK_APPL: math.inf,
    }
    assert {number: read(rig, number).value for number in expected} == expected
    for number in (
        Parameter.ENABLE_LIMIT_POS,
        Parameter.ENABLE_LIMIT_NEG,
        Parameter.ENABLE_POS_LAG_MONITORING,
    ):
        flag = ReadBoolParameter(rig.axis)
        call(rig, flag, parameter_number=number)
        assert flag.value
        assert read(rig, number).error, "a flag is no number"
    assert len(expected) + 3 == len(Parameter)


def test_lower_limits_hold_for_later_motions_and_can_be_raised_again(rig: Rig) -> None:
    assert write(rig, Parameter.MAX_VELOCITY_APPL, rad(2.0)).done
    assert write(rig, Parameter.MAX_ACCELERATION_APPL, rad(1.0)).done
    assert write(rig, Parameter.MAX_DECELERATION_APPL, rad(0.5)).done
    assert write(rig, Parameter.MAX_JERK_APPL, rad(10.0)).done
    fast = go(rig, 10.0)
    assert outputs(fast) == {"error"}
    assert "at most 2 deg/s" in fast.error_text
    move = MoveAbsolute(rig.axis)
    call(
        rig, move, execute=True, position_rad=rad(10.0), velocity_rad_s=rad(2.0), acceleration_rad_s2=rad(2.0)
    )
    assert outputs(move) == {"error"}, "ramps of one motion are judged by the lowered limits"
    call(rig, move, execute=False, position_rad=0.0, velocity_rad_s=0.0)
    call(rig, move, execute=True, position_rad=rad(10.0), velocity_rad_s=rad(2.0))
    most = least = 0.0
    while move.busy:
        rig.step()
        most = max(most, deg(rig.axis.virtual.acc_ref_rad_s2))
        least = min(least, deg(rig.axis.virtual.acc_ref_rad_s2))
    assert (most, least) == (pytest.approx(1.0), pytest.approx(-0.5))
    for number, most in (
        (Parameter.MAX_VELOCITY_APPL, 6.0), (Parameter.MAX_ACCELERATION_APPL, 4.0),
        (Parameter.MAX_DECELERATION_APPL, 4.0), (Parameter.MAX_JERK_APPL, 1000.0),
    ):  # fmt: skip
        assert write(rig, number, rad(most)).done
        assert read(rig, number).value == rad(most)
    assert outputs(go(rig, 0.0)) == {"busy", "active"}


@pytest.mark.parametrize(
    ("number", "value", "words"),
    [
        (Parameter.MAX_VELOCITY_APPL, rad(6.1), "at most 6 deg/s"),
        (Parameter.MAX_ACCELERATION_APPL, rad(4.1), "at most 4 deg/s2"),
        (Parameter.MAX_DECELERATION_APPL, 0.0, "at most 4 deg/s2"),
        (Parameter.MAX_JERK_APPL, math.nan, "above 0"),
        (Parameter.SW_LIMIT_POS, rad(170.0), "read only"),
        (Parameter.ENABLE_POS_LAG_MONITORING, 0.0, "read only"),
        (Parameter.MAX_VELOCITY_SYSTEM, rad(1.0), "read only"),
        (18, 1.0, "no parameter 18"),
        (0, 1.0, "no parameter 0"),
    ],
)
def test_what_cannot_be_written_is_refused(rig: Rig, number: int, value: float, words: str) -> None:
    before = {known: read(rig, known).value for known in Parameter}
    block = write(rig, number, value)
    assert block.error
    assert words in block.error_text
    after = {known: read(rig, known).value for known in Parameter}
    assert str(after) == str(before), "by text: nan of the flags is not equal to itself"


def test_no_parameter_changes_in_motion(rig: Rig) -> None:
    go(rig, 10.0)
    block = write(rig, Parameter.MAX_VELOCITY_APPL, rad(1.0))
    assert "standstill" in block.error_text


def test_an_unknown_number_is_an_error_and_no_value(rig: Rig) -> None:
    block = read(rig, 99)
    assert (block.valid, block.error) == (False, True)
    assert math.isnan(block.value)


# --- ReadAxisInfo ---------------------------------------------------------------------------------


def test_axis_info_follows_inputs_and_drive(rig: Rig) -> None:
    info = ReadAxisInfo(rig.axis)
    call(rig, info)
    shown = {name for name in info.__slots__ if getattr(info, name)}
    assert shown == {"valid", "communication_ready", "ready_for_power_on", "power_on", "is_homed"}
    rig.spoil = lambda feedback: feedback._replace(inputs=feedback.inputs._replace(limit_plus_ok=False))
    rig.step()
    rig.step()
    assert info.limit_switch_pos
    assert not info.limit_switch_neg
    assert not info.ready_for_power_on


def test_a_probe_shows_its_end_while_execute_is_true_and_takes_no_angle_in_doubt():
    rig = standing()
    probe = TouchProbe(rig.axis)
    call(rig, probe, execute=True, trigger=False)
    rig.axis.feedback.in_doubt = True
    probe(execute=True, trigger=True)
    assert probe.busy, "the angle is not known"
    rig.axis.feedback.in_doubt = False
    probe(execute=True, trigger=False)
    probe(execute=True, trigger=True)
    assert probe.done
    probe(execute=False, trigger=False)
    assert not probe.done


def test_a_reader_that_is_not_enabled_keeps_what_it_has_read():
    rig = moving_rig()
    rig.axis.alarms.raise_(Code.CTL_02, Reaction.TORQUE_OFF, measured="a test")
    error, info = ReadAxisError(rig.axis), ReadAxisInfo(rig.axis)
    info(enable=True)
    error(enable=True)
    assert error.axis_error_id == "CTL-02"
    assert info.power_on
    rig.axis.alarms.clear()
    for block in (error, info):
        block(enable=False)
        assert not block.valid
    assert error.axis_error_id == "CTL-02"


def test_parameters_have_the_numbers_of_plcopen() -> None:
    """Part 1, table 5: a program writes the number, not the name."""
    rig = moving_rig(speed_deg_s=3.0)
    rig.axis.feedback.vel_rad_s = rad(2.5)
    wanted = {
        1: rig.ref_deg,
        2: 180.0,
        3: -180.0,
        8: 6.0,
        9: 6.0,
        10: 2.5,
        11: 3.0,
        12: 4.0,
        13: 4.0,
        14: 4.0,
        15: 4.0,
    }
    assert {number: deg(read_parameter(rig.axis, number)) for number in wanted} == pytest.approx(wanted)
    assert deg(read_parameter(rig.axis, 7)) == pytest.approx(0.03 + 0.012 * 3.0)
    assert [read_bool_parameter(rig.axis, number) for number in (4, 5, 6)] == [True, True, True]
    assert read_parameter(rig.axis, 16) == read_parameter(rig.axis, 17) == math.inf
