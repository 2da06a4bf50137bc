"""The brake test: torque both ways against the closed brake; whatever ends it, the brake has stayed closed."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from gantryctl.image import DigitalInputs, DriveRequest
from gantryctl.program import AxisState, BrakeTestPhase, PowerPhase
from gantryctl.program.power.brake_test import HELD_S, BrakeTest
from gantryctl.units import deg, rad
from unit.program.brake_rig import (
    ABORTED,
    FAILED,
    HOLDING_NM,
    LEVEL_NM,
    LONGEST_S,
    PASSED,
    RUNNING,
    TestRig,
    weak,
)
from unit.program.rig import RATIO, Rig, settings


def test_a_sound_brake_passes_and_everything_is_off_afterwards():
    rig = TestRig()
    rig.begin()
    seen = []
    while rig.axis.brake_test.under_way:
        rig.step()
        if rig.axis.brake_test.phase not in seen:
            seen.append(rig.axis.brake_test.phase)
    assert seen == [*RUNNING, BrakeTestPhase.DISABLING, BrakeTestPhase.IDLE]
    assert rig.result.outcome is PASSED
    # The ideal drive gives what it is told: the means are exact but for the scan in which the ramp ends.
    assert rig.result.plus_nm == pytest.approx(LEVEL_NM, rel=0.01)
    assert rig.result.minus_nm == pytest.approx(-LEVEL_NM, rel=0.01)
    assert rig.result.moved_rad == 0.0
    assert rig.is_off()
    assert rig.axis.state is AxisState.DISABLED
    assert not rig.codes
    assert rig.program.brake_test.done or not rig.program.brake_test.busy


def test_the_brake_bears_the_level_around_the_torque_that_holds_the_load():
    rig = TestRig()
    rig.begin()
    rig.finish()
    # The regulator adds at most what the ramp runs ahead of the reading: 130 N m/s for a scan or two.
    assert max(rig.torques) == pytest.approx(HOLDING_NM + LEVEL_NM, abs=1.0)
    assert min(rig.torques) == pytest.approx(HOLDING_NM - LEVEL_NM, abs=1.0)


def test_the_torque_that_holds_the_load_is_taken_off_in_three_steps_at_the_end():
    """The first test of a controller: no power-up before it has fixed a preload."""
    rig = TestRig()
    rig.begin()
    rig.to(BrakeTestPhase.DISABLING)
    first = len(rig.torques)
    rig.finish()
    steps = list(dict.fromkeys(round(torque_nm, 1) for torque_nm in rig.torques[first:]))
    # What is left of the regulator is less than 0.2 N m, and goes with the drive.
    assert steps == pytest.approx([8.0, 4.0, 0.0, 0.0], abs=0.2)


def test_a_second_test_of_the_block_is_busy_until_its_own_end():
    rig = TestRig()
    for _ in range(2):
        rig.begin()
        rig.step()
        assert rig.program.brake_test.busy
        assert not rig.program.brake_test.done
        rig.finish()
        assert rig.result.outcome is PASSED


def test_each_way_is_held_for_two_seconds():
    rig = TestRig()
    rig.begin()
    for phase, after in (
        (BrakeTestPhase.PLUS_HELD, BrakeTestPhase.MINUS_RISING),
        (BrakeTestPhase.MINUS_HELD, BrakeTestPhase.RELIEVING),
    ):
        rig.to(phase)
        begin = rig.scan
        rig.to(after)
        assert (rig.scan - begin) * rig.period_s == pytest.approx(HELD_S, abs=2 * rig.period_s)


def test_the_time_left_falls_to_nothing():
    rig = TestRig()
    rig.begin()
    rig.to(BrakeTestPhase.PLUS_RISING)
    left = [rig.axis.brake_test.left_s]
    begin = rig.scan
    rig.to(BrakeTestPhase.DISABLING)
    assert left[0] == pytest.approx((rig.scan - begin) * rig.period_s, abs=0.1)
    assert rig.axis.brake_test.left_s == 0.0


@pytest.mark.parametrize("slips_at_nm", [0.0, 10.0, 40.0, 61.0])
def test_a_brake_that_slips_fails_and_lets_nothing_move(slips_at_nm):
    rig = TestRig()
    rig.begin()
    weak(rig, slips_at_nm)
    rig.finish()
    assert rig.result.outcome is FAILED
    assert "BRK-08" in rig.codes
    assert f"{slips_at_nm:+.3g} N m reached" in rig.axis.alarms.active["BRK-08"].measured
    rig.spoil = None
    rig.op(power=True)
    assert "a brake test must pass, or service must reset" in rig.refused()
    assert rig.is_off()


def test_a_brake_that_bears_the_level_less_the_tolerance_passes():
    rig = TestRig()
    rig.begin()
    weak(rig, 0.96 * LEVEL_NM)  # 95 % is asked for
    rig.finish()
    assert rig.result.outcome is PASSED


def test_the_way_alone_fails_it_too_and_the_torque_goes_at_once():
    rig = TestRig()
    rig.begin()
    rig.to(BrakeTestPhase.PLUS_HELD)
    rig.drive.pos_motor_rad += rad(0.019) * RATIO
    rig.run(0.01)
    assert rig.axis.brake_test.phase is BrakeTestPhase.PLUS_HELD
    rig.drive.pos_motor_rad += rad(0.002) * RATIO
    rig.run(0.003)
    assert rig.axis.brake_test.phase in (BrakeTestPhase.RELIEVING, BrakeTestPhase.DISABLING)
    assert -1.0 <= rig.output.torque_ff_nm <= HOLDING_NM + 1.0, "no more than what holds the load"
    rig.finish()
    assert rig.result.outcome is FAILED
    assert deg(rig.result.moved_rad) == pytest.approx(0.021, abs=1e-4)


def test_a_motor_without_torque_fails_it():
    rig = TestRig()
    rig.begin()
    rig.spoil = lambda drive: drive._replace(torque_act_nm=0.0)
    rig.finish()
    assert rig.result.outcome is FAILED
    assert rig.result.moved_rad == 0.0
    # What is asked for beyond the level is limited: it must not jump when the torque comes back.
    assert max(map(abs, rig.torques)) <= HOLDING_NM + 2.0 * LEVEL_NM + 1e-9


def test_a_brake_contact_that_opens_fails_it():
    rig = TestRig()
    rig.begin()
    rig.to(BrakeTestPhase.PLUS_HELD)
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.run(0.01)
    rig.spoil = None
    rig.finish()
    assert rig.result.outcome is FAILED
    assert "contact" in rig.result.text


@pytest.mark.parametrize("phase", RUNNING)
def test_stop_ends_it_in_every_phase_with_torque_off_and_no_verdict(phase):
    rig = TestRig()
    rig.begin()
    rig.to(phase)
    rig.run(0.01)
    rig.op(stop=True)
    rig.op(stop=False)
    rig.finish()
    passed = phase is BrakeTestPhase.RELIEVING  # everything was shown by then
    assert rig.result.outcome is (PASSED if passed else ABORTED)
    assert rig.is_off()
    assert not rig.codes
    assert rig.axis.state is AxisState.DISABLED
    rig.begin()  # and another one may begin
    rig.finish()
    assert rig.result.outcome is PASSED


@pytest.mark.parametrize("phase", [BrakeTestPhase.PLUS_HELD, BrakeTestPhase.MINUS_HELD])
def test_stop_takes_the_torque_back_on_its_ramp_before_the_drive_is_disabled(phase):
    """65 N m within 0.5 s are 0.13 in a scan; what is regulated beside them is less. Then three steps of the 12."""
    rig = TestRig()
    rig.begin()
    rig.to(phase)
    rig.run(0.01)
    rig.torques.clear()
    rig.op(stop=True)
    rig.until(lambda: rig.axis.power.phase is PowerPhase.UNLOADING, 2.0)
    steps = [abs(after - before) for before, after in pairwise(rig.torques)]
    assert max(steps) < 0.2
    assert rig.torques[-1] == pytest.approx(HOLDING_NM, abs=0.05 * LEVEL_NM)


@pytest.mark.parametrize("reading", [math.nan, math.inf, -math.inf])
def test_the_law_alone_goes_back_to_the_preload_on_a_reading_that_is_no_number(reading):
    """Commissioning has no monitor beside it."""
    law = BrakeTest(LEVEL_NM, rad(0.02), 385.0, 0.001)
    law.prepare(HOLDING_NM)
    law.begin()
    for _ in range(1000):
        torque = law.scan(HOLDING_NM + law.on_brake_nm, 0.0)
    assert law.phase is BrakeTestPhase.PLUS_HELD
    while law.running:
        torque = law.scan(reading, 0.0)
        assert math.isfinite(torque)
    assert law.outcome is ABORTED
    assert torque == pytest.approx(HOLDING_NM, abs=1.0)


CAUSES = ["INT-03", "DRV-01", "PWR-01", "INT-06", "DRV-04", "CTL-02"]
LOST_BEFORE_ENABLED = (BrakeTestPhase.ENABLING, "DRV-04")  # there is nothing to lose yet


@pytest.mark.parametrize(
    ("phase", "code"),
    [(phase, code) for phase in RUNNING for code in CAUSES if (phase, code) != LOST_BEFORE_ENABLED],
)
def test_an_alarm_ends_it_in_every_phase_safely(phase, code):
    rig = TestRig()
    rig.begin()
    rig.to(phase)
    rig.run(0.005)
    if code == "INT-06":
        rig.op(quick_stop=True)
    elif code == "DRV-01":
        rig.drive.error_code = 5
    elif code == "DRV-04":
        rig.drive.state = rig.drive.state.SWITCH_ON_DISABLED
    elif code == "CTL-02":
        rig.spoil = lambda drive: drive._replace(torque_act_nm=math.nan)
    else:
        rig.drive.inputs = DigitalInputs(estop_ok=code != "INT-03", mains_ready=code != "PWR-01")
    rig.run(0.01)
    assert rig.first.code == code
    assert not rig.axis.brake_test.under_way
    assert rig.result.outcome in (ABORTED, PASSED if phase is BrakeTestPhase.RELIEVING else ABORTED)
    rig.run(2.0)
    assert rig.is_off()
    assert rig.axis.state is AxisState.ERROR_STOP
    assert "BRK-08" not in rig.codes, "it has shown nothing about the brake"


def test_a_brake_that_slips_when_the_torque_is_taken_off_is_held_by_the_motor():
    rig = TestRig()
    rig.begin()
    rig.to(BrakeTestPhase.DISABLING)
    rig.drive.pos_motor_rad += rad(0.021) * RATIO
    rig.run(0.02)
    assert rig.first.code == "BRK-03"
    assert rig.axis.power.phase is PowerPhase.TORQUE_HOLD
    assert rig.output.request is DriveRequest.ENABLE
    assert rig.output.torque_ff_nm == pytest.approx(HOLDING_NM, abs=0.5)
    assert rig.result.outcome is FAILED, "it had passed before"


def test_a_failed_brake_moves_again_after_a_test_that_passes():
    rig = TestRig()
    rig.begin()
    weak(rig, 20.0)
    rig.finish()
    rig.spoil = None
    rig.begin()
    rig.finish()
    assert rig.result.outcome is PASSED
    assert not rig.codes


def test_or_after_a_reset_by_service_only():
    rig = TestRig()
    rig.begin()
    weak(rig, 20.0)
    rig.finish()
    rig.op(reset=True)
    assert "service role only" in rig.refused()
    rig.op(reset=False)
    rig.program.service = True
    rig.op(reset=True)
    rig.run(0.01)
    assert not rig.codes


@pytest.mark.parametrize(
    ("why", "words"),
    [
        ("on", "begins with power off"),
        ("estop", "emergency-stop chain"),
        ("untestable", "not testable here: owner"),
        ("twice", "under way"),
        ("heavy", "more than the motor's torque limit"),
    ],
)
def test_it_is_refused_with_the_reason(why, words):
    config = settings(test_torque_nm=LEVEL_NM, holding_torque_nm=380.0 if why == "heavy" else 0.0)
    if why == "untestable":
        config = replace(config, power=replace(config.power, untestable="owner"))
    rig = Rig(config=config)
    rig.run(0.05)
    if why == "on":
        rig.power_up()
    elif why == "estop":
        rig.drive.inputs = DigitalInputs(estop_ok=False)
    elif why == "twice":
        rig.op(brake_test=True)
        rig.op(brake_test=False)
        assert rig.axis.begin_brake_test().text.endswith(words)
        return
    rig.op(brake_test=True)
    assert words in rig.refused()
    assert rig.program.brake_test.error
    assert not rig.axis.brake_test.under_way


def test_power_and_a_new_reference_wait_for_its_end():
    rig = TestRig()
    rig.begin()
    rig.to(BrakeTestPhase.PLUS_HELD)
    rig.op(power=True)
    assert "a brake test is under way" in rig.refused()
    rig.op(power=False)  # what was never on is switched off: that ends the test
    assert rig.axis.set_position(0.0) is not None
    rig.finish()
    assert rig.result.outcome is ABORTED


def test_an_overdue_test_allows_slow_motion_only():
    rig = Rig()
    rig.axis.judge_brake(overdue=True)
    rig.power_up()
    rig.move(1.0, speed_deg_s=1.01)
    assert "overdue: up to 1.00 deg/s only, asked for 1.01 deg/s" in rig.refused()
    assert rig.axis.state is AxisState.STANDSTILL
    rig.move(1.0, speed_deg_s=1.0)
    rig.until(lambda: rig.program.move.done, 10.0)
    rig.axis.judge_brake(overdue=False)
    rig.move(-1.0, speed_deg_s=6.0)
    rig.until(lambda: rig.program.move.done, 10.0)


@hypothesis_settings(max_examples=60, deadline=None)
@given(
    slips_at_nm=st.floats(0.0, 120.0),
    events=st.lists(
        st.tuples(st.floats(0.0, 7.0), st.sampled_from(["stop", "quick", "estop", "fault", "nan"])),
        max_size=3,
    ),
)
def test_whatever_happens_the_brake_is_never_released_and_it_ends_without_torque(slips_at_nm, events):
    """`TestRig.step` looks at the brake command and the speed command in every scan."""
    rig = TestRig(config=settings(period_s=0.004, test_torque_nm=LEVEL_NM, holding_torque_nm=HOLDING_NM))
    rig.begin()
    weak(rig, slips_at_nm)
    for at_s, event in sorted(events):
        rig.run(max(0.0, at_s - rig.scan * rig.period_s))
        if event == "nan":
            rig.spoil = lambda drive: drive._replace(torque_act_nm=math.nan)
        elif event == "fault":
            rig.drive.error_code = 7
        elif event == "estop":
            rig.drive.inputs = DigitalInputs(estop_ok=False)
        else:
            name = "stop" if event == "stop" else "quick_stop"
            rig.op(**{name: True})
            rig.op(**{name: False})
    rig.run(LONGEST_S)
    assert not rig.axis.brake_test.under_way
    held_by_motor = rig.axis.power.phase is PowerPhase.TORQUE_HOLD and {"BRK-03", "BRK-04"} & set(rig.codes)
    assert rig.is_off() or (held_by_motor and slips_at_nm < HOLDING_NM), (
        "the brake cannot bear the load itself"
    )
    sound = slips_at_nm > LEVEL_NM
    if rig.result.outcome is PASSED:
        assert slips_at_nm >= 0.95 * LEVEL_NM
    if sound and not events:
        assert rig.result.outcome is PASSED


def test_the_block_shows_a_test_that_was_stopped_as_aborted_and_as_nothing_else():
    rig = TestRig()
    rig.begin()
    rig.to(BrakeTestPhase.PLUS_RISING)
    block = rig.program.brake_test
    rig.op(stop=True)
    rig.until(lambda: not block.busy, LONGEST_S)
    assert (block.done, block.command_aborted, block.error) == (False, True, False)


def test_the_block_shows_a_result_for_a_scan_when_its_input_has_gone_long_before():
    rig = TestRig()
    rig.begin()
    block = rig.program.brake_test
    rig.until(lambda: not block.busy, LONGEST_S)
    assert block.done
    rig.step()
    assert not block.done
    assert not block.attention


def test_a_test_that_was_stopped_clears_no_failure_of_the_one_before():
    """It has shown nothing: the brake that failed lets nothing move."""
    rig = TestRig()
    rig.begin()
    weak(rig, 20.0)
    rig.finish()
    assert rig.codes == ["BRK-08"]
    rig.spoil = None
    rig.begin()
    rig.to(BrakeTestPhase.PLUS_HELD)
    rig.op(stop=True)
    rig.op(stop=False)
    rig.finish()
    assert rig.result.outcome is ABORTED
    assert rig.codes == ["BRK-08"]


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
@pytest.mark.parametrize(("load_nm", "refused"), [(319.0, False), (321.0, True)])
def test_the_level_comes_on_top_of_the_load_whichever_way_it_pulls(load_nm, refused, way):
    """65 N m of 385 leave 320 for the load."""
    rig = Rig(config=settings(test_torque_nm=LEVEL_NM, holding_torque_nm=way * load_nm))
    rig.run(0.05)
    rig.op(brake_test=True)
    assert (rig.axis.refusal is not None) is refused
    assert rig.axis.brake_test.under_way is not refused
