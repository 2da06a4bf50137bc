"""What a first time leaves for the second: stops, proofs, modes, probes and cams on an ideal drive."""

from __future__ import annotations

import math

import pytest

from gantryctl.image import DigitalInputs, Direction, Mode, StopCause, SystemStop
from gantryctl.program import AxisState, BrakeTestOutcome
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import check_way
from gantryctl.program.axis.motion_command import CommandStatus
from gantryctl.program.axis.parameters import Parameter, write_parameter
from gantryctl.program.blocks import Cam, DigitalCamSwitch, TouchProbe
from gantryctl.program.power.phases import Proof
from gantryctl.program.settings import StandstillPolicy
from gantryctl.units import rad
from unit.program.block_bench import call, standing
from unit.program.parts import BOTH
from unit.program.power_steps import P
from unit.program.rig import Rig, moving_rig, powered, press, settings
from unit.program.test_modulo import modulo
from unit.program.test_site_interlocks import fitted, shows

OPEN = DigitalInputs()
SWITCH_OFF = DigitalInputs(enabling_switch=False)


# --- stops ------------------------------------------------------------------------------------------------------------


def test_another_stop_of_the_engine_is_told_beside_the_first():
    """A controller that froze, and then is late for good: both are told, and the last one is what it stands for."""
    rig = moving_rig()
    late = SystemStop(StopCause.SCAN_LATE, 0.03125, 0.03125, 3.0)
    for stop in (SystemStop(StopCause.FROZEN, 2.01, 0.05, 3.0), late):
        rig.system_stop = stop
        rig.step()
    assert rig.codes == ["SYS-03", "SYS-02"]
    assert rig.axis.system_stop is late


def test_a_sound_encoder_that_stands_behind_a_stop_is_not_frozen():
    """The ideal drive stands to the count; the last command before the quick stop was 6 deg/s."""
    rig = moving_rig()
    rig.axis.quick_stop()
    rig.until(lambda: rig.axis.is_off, 5.0)
    rig.run(1.0)
    assert rig.codes == ["INT-06"]


def test_a_door_that_opens_in_a_quick_stop_lets_the_drive_end_its_ramp():
    """Alone it ends a motion with power on: it is no reason to take the torque off."""
    rig = fitted()
    rig.axis.quick_stop()
    rig.run(0.1)
    shows(rig, door_ok=False)
    rig.run(0.1)
    assert rig.axis.power.phase is P.QUICK_STOPPING
    assert rig.codes == ["INT-06", "INT-07"]


@pytest.mark.parametrize("ending", ["an alarm", "power off"])
def test_an_axis_that_is_stopped_while_it_parks_ends_off(ending):
    rig = Rig(config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.5))
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is P.CLOSING, 2.0)
    if ending == "an alarm":
        rig.axis.quick_stop()
    else:
        rig.op(power=False)
    rig.run(2.0)
    assert rig.axis.power.phase is P.OFF
    assert not rig.axis.power.status


def test_an_axis_that_parks_stands_from_that_scan_on():
    """100 counts beside its set-point the position loop would ask for 0.24 deg/s of the motor, against the brake."""
    rig = Rig(config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.5))
    rig.power_up()
    rig.spoil = lambda drive: drive._replace(pos_act_counts=drive.pos_act_counts + 100.0)
    rig.step()
    assert rig.output.vel_cmd_rad_s != 0.0
    rig.until(lambda: rig.axis.power.phase is P.CLOSING, 2.0)
    assert rig.output.vel_cmd_rad_s == 0.0


def test_a_limit_switch_stops_each_time_that_it_opens():
    rig = powered()
    for _ in range(2):
        rig.drive.inputs = OPEN._replace(limit_plus_ok=False)
        rig.step()
        assert rig.codes == ["LIM-03"]
        rig.op(power=False)
        rig.until(lambda: rig.axis.is_off, 5.0)
        rig.drive.inputs = OPEN
        rig.run(0.1)
        rig.op(reset=True)
        rig.op(reset=False)
        assert not rig.codes
        rig.op(power=True)
        rig.until(lambda: rig.axis.power.phase is P.ON, 5.0)


def test_channels_that_switch_a_little_apart_again_and_again_are_sound():
    """0.4 s of the permitted 0.5 s, three times, with a scan between in which both agree."""
    rig = Rig()
    for _ in range(3):
        rig.drive.inputs = OPEN._replace(estop_ok=True, estop_ok_2=False)
        rig.run(0.4)
        rig.drive.inputs = OPEN._replace(estop_ok=True, estop_ok_2=True)
        rig.step()
    assert "INT-04" not in rig.codes


# --- power ------------------------------------------------------------------------------------------------------------


def test_each_power_up_proves_its_torque_anew():
    rig = powered()
    assert rig.axis.power.proof is Proof.PROVEN
    rig.op(power=False)
    rig.until(lambda: rig.axis.is_off, 5.0)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.PROVING, 5.0)
    assert rig.axis.power.proof is Proof.NOT_DONE


@pytest.mark.parametrize(
    ("by_drive", "least_nm", "asked"), [(True, 0.0, 1), (False, 0.0, 0), (False, 29.9, 0), (False, 30.1, 1)]
)
def test_a_reading_that_no_proof_has_shown_is_asked_after_50_ms(by_drive, least_nm, asked):
    """It stands to the count; one that a proof has moved is believed for 0.3 s. The sag is watched for 0.2 s.

    The proof of 30 N m moves no reading whose step takes more.
    """
    monitors = {"encoder_still_time_s": 0.3, "twist_least_nm": least_nm}
    rig = Rig(config=settings(monitors=monitors, brake_by_drive=by_drive, proof_torque_nm=30.0))
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.SAG_WATCH, 5.0)
    rig.spoil = lambda drive: drive._replace(pos_act_counts=float(round(rig.axis.feedback.counts)))
    rig.run(0.07)
    assert (rig.axis.power.phase, rig.axis.liveness.dithers) == (P.SAG_WATCH, asked)


def test_the_torque_of_a_standstill_is_the_preload_of_the_next_power_up():
    """12 N m for 5 s, followed with a time constant of 1 s: 0.7 % are left."""
    rig = powered()
    rig.spoil = lambda drive: drive._replace(torque_act_nm=12.0)
    rig.run(5.0)
    assert rig.axis.holding_torque_nm == pytest.approx(12.0 * (1.0 - math.exp(-5.0)), rel=0.01)


@pytest.mark.parametrize("outcome", [BrakeTestOutcome.FAILED, BrakeTestOutcome.ABORTED])
def test_a_brake_test_that_has_not_passed_is_not_done(outcome):
    rig = Rig()
    rig.op(brake_test=True)
    block = rig.program.brake_test
    rig.until(lambda: rig.axis.brake_test.running, 2.0)
    rig.axis.brake_test.end(outcome, Words.STOPPED)
    rig.until(lambda: not block.busy, 5.0)
    failed = outcome is BrakeTestOutcome.FAILED
    assert (block.done, block.error, block.command_aborted) == (False, failed, not failed)
    assert block.error_id == ("BRK-08" if failed else None)


# --- motions ----------------------------------------------------------------------------------------------------------


def test_a_paused_motion_that_may_not_be_any_more_does_not_creep_on():
    """A thousandth is the least override that moves."""
    rig = moving_rig()
    assert rig.axis.set_override(0.0) is None
    rig.run(3.0)
    rig.axis.motion.speed_max_rad_s = rad(3.0)
    assert rig.axis.set_override(0.001) is not None
    rig.run(0.1)
    assert rig.vel_deg_s == 0.0


def test_the_speed_of_a_motion_that_was_taken_over_changes_nothing():
    rig = powered()
    motion = rig.axis.motion
    first = motion.move_absolute(rad(50.0), rad(6.0))
    rig.run(1.0)
    motion.move_absolute(rad(60.0), rad(6.0))
    plan = rig.axis.virtual.plan
    assert motion.change_speed(first, rad(1.0)) is None
    assert rig.axis.virtual.plan is plan


def test_while_power_goes_off_nothing_takes_over_from_its_ramp():
    rig = moving_rig()
    rig.axis.power_off()
    for begun in (rig.axis.motion.move_absolute(0.0, rad(6.0)), rig.axis.motion.halt()):
        assert begun.status is CommandStatus.ERROR
        assert "switched off" in begun.refusal.text
    rig.run(3.0)
    assert rig.axis.is_off


def test_a_pause_ends_with_the_alarm_that_comes_in_it():
    """Power comes again and the override is raised: nobody has asked for the motion of before."""
    rig = moving_rig()
    rig.op(override=0.0)
    rig.run(3.0)
    rig.axis.quick_stop()
    rig.until(lambda: rig.axis.is_off, 5.0)
    rig.op(power=False, reset=True)
    rig.op(reset=False)
    here_deg = rig.ref_deg
    rig.power_up()
    rig.op(override=1.0)
    rig.run(1.0)
    assert rig.ref_deg == pytest.approx(here_deg, abs=1e-3)
    assert not rig.axis.paused


@BOTH
def test_from_rest_a_modulo_axis_goes_on_the_way_that_it_came(way):
    """By 30 deg; then to an angle 10 deg back, on in the current direction: by 350 deg."""
    rig = Rig(config=modulo())
    rig.power_up()
    motion = rig.axis.motion
    for target_deg, direction, end_deg in ((30.0, None, 30.0), (20.0, Direction.CURRENT, 380.0)):
        command = motion.move_absolute(way * rad(target_deg), rad(3600.0), direction)
        assert command.target_rad == pytest.approx(way * rad(end_deg))
        rig.until(lambda command=command: not command.alive, 5.0)


# --- by hand ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def by_hand():
    rig = powered()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(2.0), increment_rad=rad(20.0))
    return rig


def test_a_key_that_was_refused_moves_only_when_it_is_pressed_again(by_hand):
    """Too fast without the enabling switch; the switch comes, the lease is renewed, the other key is let go."""
    rig = by_hand
    rig.drive.inputs = SWITCH_OFF
    press(rig, forward=True)
    assert "enabling switch" in rig.refused()
    rig.drive.inputs = OPEN
    rig.hold_key(0.5)
    rig.op(reverse=True)
    rig.op(reverse=False)
    rig.hold_key(0.5)
    assert rig.ref_deg == pytest.approx(0.0, abs=1e-6)
    press(rig, forward=False)
    press(rig, forward=True)
    rig.hold_key(0.5)
    assert rig.vel_deg_s == pytest.approx(2.0)


def test_a_halt_is_done_while_its_level_stays():
    """The block is called when it has something to show: no input changes until the axis stands."""
    rig = moving_rig()
    rig.op(halt=True)
    assert rig.program.halt.busy
    rig.until(lambda: rig.axis.virtual.at_rest, 5.0)
    rig.run(0.1)
    assert (rig.program.halt.busy, rig.program.halt.done) == (False, True)


def test_a_speed_that_was_refused_is_no_speed_of_the_jog_under_way(by_hand):
    """1 deg/s needs no switch; 99 deg/s are refused, and the jog goes on as it was."""
    rig = by_hand
    rig.drive.inputs = SWITCH_OFF
    press(rig, forward=True, speed_rad_s=rad(1.0))
    rig.hold_key(0.5)
    press(rig, speed_rad_s=rad(99.0))
    rig.hold_key(0.5)
    assert rig.vel_deg_s == pytest.approx(1.0)
    assert "speed must be within" in rig.refused()


def test_a_motion_of_the_console_behind_one_from_afar_is_one_of_the_console(by_hand):
    """4 deg/s without the enabling switch: the cap of 1 deg/s is for whoever is not there, and for keys."""
    rig = by_hand
    rig.op(remote=True)
    rig.move(1.0, 1.0)
    rig.until(lambda: not rig.program.move.busy, 5.0)
    rig.op(remote=False)
    rig.drive.inputs = SWITCH_OFF
    rig.move(30.0, 4.0)
    rig.run(2.0)
    assert rig.vel_deg_s == pytest.approx(4.0)


def test_an_increment_ends_when_the_switch_is_let_go_at_the_console_too(by_hand):
    rig = by_hand
    rig.op(mode=Mode.INCREMENTAL)
    rig.op(forward=True)
    rig.op(forward=False)
    rig.run(2.0)
    assert rig.vel_deg_s == pytest.approx(2.0)
    rig.drive.inputs = SWITCH_OFF
    rig.run(1.0)
    assert (rig.vel_deg_s, rig.axis.state) == (0.0, AxisState.STANDSTILL)
    assert rig.axis.alarms.history[-1].code == "INT-05"


# --- probes and cams --------------------------------------------------------------------------------------------------


def test_a_second_probe_knows_nothing_of_the_first():
    """The first one saw an edge in a window of 1 deg about 0; the second one has no window, and no angle yet."""
    rig = standing()
    probe = TouchProbe(rig.axis)
    window = {"window_only": True, "first_position_rad": rad(-0.5), "last_position_rad": rad(0.5)}
    call(rig, probe, execute=True, trigger=False, **window)
    call(rig, probe, execute=True, trigger=True, **window)
    assert probe.recorded_position_rad == pytest.approx(0.0, abs=1e-6)
    call(rig, probe, execute=False, trigger=False)
    rig.axis.motion.move_absolute(rad(5.0), rad(6.0))
    rig.run(3.0)
    call(rig, probe, execute=True, trigger=False)
    assert math.isnan(probe.recorded_position_rad)
    call(rig, probe, execute=True, trigger=True)
    assert probe.recorded_position_rad == pytest.approx(rad(5.0), abs=1e-4)


def test_a_cam_switch_that_was_off_begins_without_its_hysteresis_and_its_pulses():
    """On from 0 to 10 deg, off 1 deg beyond; a pulse of 60 s from 5 deg. Switched off and on at 10.5 deg."""
    rig = standing()
    cams = DigitalCamSwitch(
        rig.axis,
        [[Cam(0.0, rad(10.0))], [Cam(rad(5.0), 0.0, duration_s=60.0)]],
        hysteresis_rad=rad(1.0),
    )
    call(rig, cams, enable=True)
    rig.axis.motion.move_absolute(rad(10.5), rad(6.0))
    rig.run(4.0)
    assert cams.outputs == (True, True)
    call(rig, cams, enable=False)
    assert cams.outputs == (False, False)
    call(rig, cams, enable=True)
    assert cams.outputs == (False, False)


# --- limits of which two are alike elsewhere --------------------------------------------------------------------------


@pytest.mark.parametrize(("acc", "dec", "refused"), [(4.0, 3.0, True), (3.0, 4.0, False)])
def test_a_deceleration_is_judged_by_that_of_the_machine(acc, dec, refused):
    """3.5 deg/s2 beside 3 and 4."""
    rig = Rig(config=settings(acc=acc, dec=dec))
    rig.power_up()
    assert (write_parameter(rig.axis, Parameter.MAX_DECELERATION_APPL, rad(3.5)) is not None) is refused


@pytest.mark.parametrize(("plus", "minus"), [(False, True), (True, False)])
def test_only_the_way_out_of_an_open_switch_is_open(plus, minus):
    """One switch open: away from it any motion, towards it none."""
    rig = powered()
    rig.drive.inputs = OPEN._replace(limit_plus_ok=plus, limit_minus_ok=minus)
    rig.step()
    interlocks, travel = rig.axis.interlocks, rig.axis.settings.travel
    assert (check_way(0.0, rad(1.0), travel, interlocks) is None) is plus
    assert (check_way(0.0, rad(-1.0), travel, interlocks) is None) is minus
