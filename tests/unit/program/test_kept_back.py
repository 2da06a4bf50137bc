"""What is kept back: who may reset, which key and which move may begin, what an angle is worth after an alarm."""

from dataclasses import replace

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, EncoderFlag, Mode
from gantryctl.program import AxisState, Code, PowerPhase, Reaction
from gantryctl.program.axis.load_side import stale_words
from gantryctl.program.axis.motion_command import Dynamics
from gantryctl.program.monitors.calibration_watch import Finding
from gantryctl.program.settings import StandstillPolicy
from gantryctl.units import deg, rad
from unit.program.parts import BOTH
from unit.program.rig import COUNTS_PER_DEG, Rig, powered, press, settings
from unit.program.test_modulo import modulo

approx = pytest.approx


# --- keys and moves ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_the_first_key_of_all_needs_a_renewal(key):
    """Pressed in the third scan: nothing has been renewed yet, and nothing counts as renewed."""
    rig = Rig()
    rig.step()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    rig.op(**{key: True})
    assert "hold-to-run was not renewed" in rig.refused()


def test_a_speed_that_was_refused_changes_no_way_that_is_shown():
    rig = powered()
    # Without a speed yet: what the jerk of 100 deg/s3 leaves of an acceleration of 4 deg/s2 is 0.004 deg.
    assert deg(rig.program.key_lost_angle_rad()) < 0.01
    rig.op(speed_rad_s=rad(3.0))
    shown = rig.program.key_lost_angle_rad()
    assert deg(shown) > 1.0
    for speed_deg_s in (6.01, 0.59, 100.0):
        rig.op(speed_rad_s=rad(speed_deg_s))
        assert rig.program.key_lost_angle_rad() == shown


@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_a_key_is_refused_while_the_speed_that_is_set_is_none(key):
    """3 deg/s were accepted before; they do not stand in for the 100 that a person reads."""
    rig = powered()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(3.0))
    rig.op(speed_rad_s=rad(100.0))
    press(rig, **{key: True})
    assert "speed must be within 0.6 and 6 deg/s" in rig.refused()
    rig.run(0.1)
    assert rig.vel_deg_s == 0.0


@pytest.mark.parametrize(("key", "way"), [("forward", 1.0), ("reverse", -1.0)])
def test_a_speed_that_is_refused_leaves_the_key_that_is_held_alive(key, way):
    rig = powered()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(3.0))
    press(rig, **{key: True})
    rig.hold_key(1.0)
    rig.op(speed_rad_s=rad(100.0))
    rig.hold_key(0.3)
    assert rig.program.jog.busy
    assert rig.vel_deg_s == approx(3.0 * way)


def test_a_speed_without_the_enabling_switch_is_told_in_degrees():
    rig = powered()
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(3.0))
    press(rig, forward=True)
    assert rig.axis.refusal.code is Code.INT_05
    assert rig.axis.refusal.values == {"measured": approx(3.0), "limit": approx(1.0)}


def test_the_way_of_a_key_that_is_lost_at_constant_speed_has_no_acceleration_in_it():
    """6 deg/s: 250 ms of lease are 1.5 deg, the ramp of 5 deg/s2 and 100 deg/s3 3.75."""
    turning = modulo()
    rig = Rig(config=replace(settings(), travel=turning.travel, law=turning.law))
    rig.power_up()
    rig.axis.motion.move_velocity(rad(6.0))
    rig.run(2.0)
    assert rig.axis.virtual.cruising
    assert deg(rig.program.key_lost_angle_rad()) == approx(1.5 + 3.75, abs=0.001)


def test_a_remote_move_that_waits_for_the_brake_stays_remote():
    """Given with the enabling switch; the screen's level and the switch go before the brake is open."""
    rig = Rig(config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.5))
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is PowerPhase.PARKED, 5.0)
    rig.op(move=True, target_rad=rad(50.0), speed_rad_s=rad(6.0), remote=True)
    assert rig.axis.motion.waiting is not None
    rig.op(move=False, remote=False)
    rig.drive.inputs = DigitalInputs(enabling_switch=False)
    rig.run(3.0)
    assert abs(rig.ref_deg) < 0.1
    assert "INT-05" in [str(alarm.code) for alarm in rig.axis.alarms.history]


# --- resets -----------------------------------------------------------------------------------------------------------


def encoder_alarm(**arguments):
    """Ten scans of the encoder's own alarm, long ago."""
    rig = Rig(**arguments)
    rig.power_up()
    rig.spoil = lambda drive: drive._replace(encoder=EncoderFlag.ALARM)
    rig.run(0.010)
    rig.spoil = None
    rig.op(power=False)
    rig.run(2.0)
    assert str(rig.first.code) == "ENC-05"
    return rig


def test_an_encoder_that_had_an_alarm_is_believed_only_after_service_has_compared():
    rig = encoder_alarm()
    assert not rig.axis.feedback.position_valid
    rig.op(reset=True)
    assert rig.codes == ["ENC-05"]
    assert "ENC-05" in rig.refused()
    assert "service" in rig.refused()
    assert not rig.axis.feedback.position_valid


def test_service_resets_what_nobody_else_may():
    rig = encoder_alarm(service=True)
    rig.op(reset=True)
    rig.run(0.1)
    assert rig.codes == []
    assert rig.axis.feedback.position_valid


def test_a_frozen_reading_that_service_has_accepted_is_not_told_again_at_rest():
    """It has stood since 6 deg/s, and an axis that stands shows the same count."""
    bare_rotor = {"speed_change_max_rad_s2": rad(169.0), "speed_change_per_torque": rad(0.4)}
    rig = Rig(config=settings(monitors=bare_rotor), service=True)
    rig.power_up()
    rig.move(100.0, 6.0)
    rig.run(3.0)
    frozen = rig.drive.read().pos_act_counts
    rig.spoil = lambda drive: drive._replace(pos_act_counts=frozen)
    rig.run(3.0)
    assert str(rig.first.code) == "ENC-02"
    rig.op(power=False, reset=True)
    rig.run(2.0)
    assert rig.codes == []


def test_the_override_ends_a_gentle_motion_on_the_ramp_of_the_machine():
    """6 deg/s at 4 deg/s2 are 1.5 s; the motion's own 0.5 deg/s2 would take 12."""
    rig = powered()
    gentle = Dynamics(dec_rad_s2=rad(0.5))
    rig.axis.motion.move_absolute(rad(150.0), rad(6.0), dynamics=gentle)
    rig.run(4.0)
    assert rig.vel_deg_s == approx(6.0)
    rig.op(override=0.0)
    rig.run(1.6)
    assert rig.vel_deg_s == 0.0
    rig.op(override=1.0)
    rig.run(4.0)
    assert rig.vel_deg_s == approx(6.0), "it goes on to its target"


# --- two alarms of one scan -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
def test_a_warning_in_the_scan_of_a_stop_takes_nothing_from_it(way):
    """The encoder jumps by a degree, and the drive warns in the same scan, after it."""
    rig = powered()
    rig.spoil = lambda drive: drive._replace(
        pos_act_counts=drive.pos_act_counts + way * COUNTS_PER_DEG, warning=True
    )
    rig.step()
    assert rig.codes == ["ENC-01", "DRV-02"]
    assert rig.output.request is DriveRequest.DISABLE
    assert not rig.output.brake_open
    rig.run(0.1)
    assert rig.axis.state is AxisState.ERROR_STOP


@pytest.mark.parametrize(("switch", "way"), [("limit_plus_ok", 1.0), ("limit_minus_ok", -1.0)])
def test_behind_a_limit_switch_only_the_way_inward_is_open(switch, way):
    rig = Rig()
    rig.drive.inputs = DigitalInputs(**{switch: False})
    rig.power_up()
    rig.op(move=True, target_rad=rad(way * 5.0), speed_rad_s=rad(6.0))
    assert f"only motion {'reverse' if way > 0.0 else 'forward'} is open" in rig.refused()
    assert rig.axis.motion.current is None
    rig.op(move=False)
    rig.move(-way * 5.0)
    rig.run(3.0)
    assert rig.ref_deg == approx(-way * 5.0, abs=1e-6)


def test_a_warning_that_has_ended_a_motion_keeps_the_next_one_back():
    """A brake that drags so much that the motion had to end: BRK-02, which is a warning where it drags less."""
    rig = powered()
    values = {"measured": 80.0, "share": 31.0}
    rig.axis.alarms.raise_(Code.BRK_02, **values)
    rig.move(5.0)
    rig.run(3.0)
    assert rig.ref_deg == approx(5.0, abs=1e-6)
    rig.axis.alarms.raise_(Code.BRK_02, Reaction.HLT, **values)
    rig.move(0.0)
    assert "BRK-02 is active" in rig.refused()
    rig.run(1.0)
    assert rig.ref_deg == approx(5.0, abs=1e-6)


def test_what_no_longer_fits_is_told_in_degrees():
    """1e-3 rad are 0.0573 deg."""
    said = str(stale_words({"lost_motion": Finding(1e-3, 5e-4), "moment": Finding(900.0, 500.0)}))
    assert "0.0573 deg" in said
    assert "0.0286 deg" in said
    assert "0.001" not in said


def test_an_angle_in_doubt_keeps_a_reset_back_where_no_alarm_is_left():
    rig = Rig()
    rig.run(0.1)
    rig.axis.feedback.in_doubt = True
    assert rig.codes == []
    assert rig.axis.reset() is not None
    assert rig.axis.reset(service=True) is None
    rig.run(0.01)
    assert rig.axis.feedback.position_valid


@pytest.mark.parametrize(
    ("drags", "service", "kept"), [(True, True, False), (True, False, True), (False, True, True)]
)
def test_what_a_motion_needs_is_forgotten_by_service_where_a_brake_has_dragged(drags, service, kept):
    rig = Rig()
    rig.run(0.1)
    rig.axis.monitors.drag.model.restore((1.0, 2.0, 3.0, 4.0, 5.0))
    code = Code.BRK_02 if drags else Code.CTL_12
    rig.axis.alarms.raise_(code, measured=50.0, share=20.0, limit=1.0, trip=1.0)
    rig.step()
    assert rig.axis.reset(service=service) is None
    rig.run(0.01)
    assert bool(rig.axis.torque_weights) is kept


@pytest.mark.parametrize("remote", [True, False])
def test_a_move_has_a_speed_of_the_setting_from_a_remote_screen_too(remote):
    """0.3 deg/s is what a program may creep with, and nobody sets."""
    rig = powered()
    rig.op(move=True, target_rad=rad(5.0), speed_rad_s=rad(0.3), remote=remote)
    assert "speed must be within 0.6 and 6 deg/s" in rig.refused()
    rig.run(0.1)
    assert rig.axis.motion.current is None


def test_the_way_back_to_the_mode_in_force_is_no_change():
    rig = powered()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(3.0))
    press(rig, forward=True)
    rig.hold_key(0.5)
    rig.op(mode=Mode.INCREMENTAL)
    assert rig.axis.refusal_count == 1
    rig.op(mode=Mode.CONTINUOUS)
    assert rig.axis.refusal_count == 1


def test_a_warning_that_keeps_the_next_motion_back_is_no_end_of_the_one_under_way():
    rig = powered()
    rig.move(20.0)
    rig.run(1.0)
    rig.axis.alarms.raise_(Code.BRK_08, measured="slipped")
    rig.run(0.2)
    assert rig.axis.alarms.blocking() is not None
    assert rig.program.move.active
    assert rig.vel_deg_s > 1.0
    # What stops it then is told as that.
    rig.op(quick_stop=True)
    assert rig.program.move.error_id is Code.INT_06


def test_a_brake_that_opens_behind_an_angle_in_doubt_is_told():
    """An alarm is latched, the drive is off, and nobody knows where the axis is: all the more the contact counts."""
    rig = encoder_alarm()
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.run(1.0)
    assert rig.axis.is_off
    assert rig.axis.feedback.in_doubt
    assert rig.codes == ["ENC-05", "BRK-06"]


@BOTH
@pytest.mark.parametrize("endless", [True, False])
def test_what_override_0_holds_back_is_judged_by_a_brake_test_that_is_overdue_meanwhile(way, endless):
    """Like a new motion: nothing moves faster than 1 deg/s, and the override stays what it is."""
    rig = powered()
    motion = rig.axis.motion
    command = (
        motion.move_velocity(way * rad(6.0)) if endless else motion.move_absolute(way * rad(60.0), rad(6.0))
    )
    rig.run(1.0)
    assert rig.axis.set_override(0.0) is None
    rig.run(3.0)
    assert rig.axis.paused
    rig.axis.judge_brake(overdue=True)
    refused = rig.axis.set_override(1.0)
    assert refused is not None
    assert refused.code is Code.BRK_12
    rig.run(1.0)
    assert (rig.vel_deg_s, rig.axis.virtual.override, command.alive) == (0.0, 0.0, True)
    rig.axis.judge_brake(overdue=False)
    assert rig.axis.set_override(1.0) is None


def test_a_key_that_is_held_gets_no_faster_than_an_overdue_brake_test_permits():
    rig = powered()
    rig.axis.judge_brake(overdue=True)
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(0.9))
    press(rig, forward=True)
    rig.hold_key(1.0)
    rig.op(speed_rad_s=rad(3.0))
    rig.hold_key(1.0)
    assert rig.axis.refusal.code is Code.BRK_12
    assert rig.vel_deg_s == pytest.approx(0.9)
