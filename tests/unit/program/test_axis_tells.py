"""What an axis tells of itself: at its start, in motion, and where it does not know."""

import math
from types import SimpleNamespace

import pytest

from gantryctl.image import DigitalInputs, Mode
from gantryctl.program import Axis, AxisState, Code, PowerPhase
from gantryctl.program.alarms.words import Words
from gantryctl.program.settings import StandstillPolicy
from gantryctl.units import deg, rad
from unit.program.parts import BOTH
from unit.program.rig import RATIO, ZERO_COUNTS, Rig, moving_rig, powered, settings


def test_a_new_axis_stands_at_no_time_and_commands_nothing():
    axis = Rig().axis
    assert (axis.scan, axis.time_s, axis.vel_cmd_rad_s, axis.pos_err_rad) == (-1, 0.0, 0.0, 0.0)
    assert (axis.state, axis.refusal, axis.refusal_count) == (AxisState.DISABLED, None, 0)
    assert axis.calibration_memory == {}
    assert axis.torque_weights == ()
    assert axis.plan_end_s == 0.0


def test_an_axis_that_moves_is_not_told_as_at_rest():
    rig = moving_rig()
    assert not rig.output.at_rest
    assert not rig.output.in_position
    assert rig.output.lamp
    rig.op(halt=True)
    rig.run(3.0)
    assert rig.output.at_rest
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=rad(0.021) * RATIO)
    rig.step()
    assert not rig.output.at_rest, "the shaft turns"


def test_an_angle_that_is_not_known_is_not_told():
    rig = moving_rig()
    rig.axis.feedback.in_doubt = True
    rig.drive.inputs = DigitalInputs(mains_ready=False)
    rig.step()
    assert Words.AT_UNKNOWN in rig.axis.alarms.active[Code.PWR_01].values.values()


@pytest.mark.parametrize("phase", [PowerPhase.CLOSING, PowerPhase.QUICK_STOPPING])
def test_a_shaft_is_tried_by_speed_commands_only_where_the_axis_follows_at_rest(phase):
    """What is left of a try does not go into a motion or a stop."""
    rig = powered()
    rig.axis.liveness.vel_rad_s = 1.0
    assert rig.axis.end().vel_cmd_rad_s == pytest.approx(1.0, abs=1e-3)
    rig = moving_rig()
    planned = rig.output.vel_cmd_rad_s
    rig.axis.liveness.vel_rad_s = 1.0
    rig.step()
    # The loop corrects some counts; the try would be 1 rad/s of 120.
    assert rig.output.vel_cmd_rad_s == pytest.approx(planned, abs=1e-3)
    rig.op(**({"power": False} if phase is PowerPhase.CLOSING else {"quick_stop": True}))
    rig.until(lambda: rig.axis.power.phase is phase, 5.0)
    rig.axis.liveness.vel_rad_s = 1.0
    rig.step()
    assert rig.output.vel_cmd_rad_s == 0.0


class Asked:
    """A watch of the reading that keeps how it was asked."""

    against, vel_rad_s = -math.inf, 0.0

    def __init__(self):
        self.asked = None

    def stand(self, *, proven):
        self.asked = "proven" if proven else "unproven"

    def stop(self):
        self.asked = "stop"


@pytest.mark.parametrize("preload", [True, False])
@pytest.mark.parametrize("stop", [{"power": False}, {"quick_stop": True}])
def test_the_reading_is_tried_wherever_the_drive_holds_the_axis_at_rest_or_stops_it(preload, stop):
    """By speed commands where they count, without a proof sooner; by torque alone where the brake is still open."""
    rig = Rig(config=settings(torque_preload=preload))
    watch = rig.axis.liveness = Asked()
    proof = "proven" if preload else "unproven"
    wanted = {PowerPhase.ON: "proven", PowerPhase.SAG_WATCH: proof}
    phases = set()
    for level in ({"power": True}, stop):
        rig.op(**level)
        for _ in range(1000):
            watch.asked, before = None, rig.axis.power.phase
            rig.step()
            phase = rig.axis.power.phase
            phases.add(phase)
            if phase is not before:
                continue
            by_torque = (
                phase in (PowerPhase.CLOSING, PowerPhase.DISABLING, PowerPhase.QUICK_STOPPING)
                and rig.image.drive.brake_open
            )
            assert watch.asked == ("stop" if by_torque else wanted.get(phase)), phase
    assert {PowerPhase.SAG_WATCH, PowerPhase.ON, PowerPhase.CLOSING, PowerPhase.DISABLING} < phases


def test_an_alarm_has_the_time_and_the_scan_in_which_it_was_raised():
    rig = moving_rig()
    rig.drive.inputs = DigitalInputs(mains_ready=False)
    rig.step()
    alarm = rig.axis.alarms.active[Code.PWR_01]
    assert (alarm.scan, alarm.time_s) == (rig.scan - 1, pytest.approx((rig.scan - 1) * rig.period_s))
    assert rig.axis.time_s == alarm.time_s


def test_the_end_of_a_motion_and_the_way_of_a_stop_are_told():
    """100 deg at 6 deg/s, with ramps of 1.5 s: 18.167 s; 5 deg/s2 with a jerk of 100 deg/s3 take 3.75 deg."""
    rig = powered()
    assert rig.axis.stopping_angle_rad() == 0.0
    begun_s = rig.scan * rig.period_s
    rig.move(100.0)
    assert rig.axis.plan_end_s == pytest.approx(begun_s + 18.1667, abs=2e-3)
    rig.run(3.0)
    assert deg(rig.axis.stopping_angle_rad()) == pytest.approx(3.75, abs=0.01)


def test_the_end_of_a_motion_is_told_with_the_override_that_it_has():
    """100 deg at half of 6 deg/s, with ramps of 0.75 s: 34.083 s."""
    rig = powered()
    rig.op(override=0.5)
    begun_s = rig.scan * rig.period_s
    rig.move(100.0)
    assert rig.axis.plan_end_s == pytest.approx(begun_s + 34.0833, abs=2e-3)


def test_a_speed_that_is_not_known_is_no_rest():
    """A drive on its own ramp, of whose speed nothing is known: nobody may go near a load that may turn."""
    rig = powered()
    assert rig.output.at_rest
    rig.spoil = lambda drive: drive._replace(speed_age_scans=100, age_scans=100)
    rig.run(0.05)
    assert not rig.output.at_rest


def test_an_axis_without_power_is_not_in_position():
    rig = powered()
    assert rig.output.in_position
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is PowerPhase.OFF, 5.0)
    rig.run(0.5)
    assert not rig.output.in_position


def test_an_axis_keeps_no_plans_unless_asked():
    assert not Axis(settings(), ZERO_COUNTS).virtual.keep_plans


@pytest.mark.parametrize("level", [{"stop": True}, {"power": False}])
def test_on_the_ramp_of_a_stop_nothing_rests_and_the_state_is_stopping(level):
    rig = moving_rig()
    rig.op(mode=Mode.INCREMENTAL, **level)
    rig.run(0.1)
    assert rig.vel_deg_s > 1.0
    assert rig.axis.state is AxisState.STOPPING
    assert not rig.axis.at_rest
    assert rig.program.mode is Mode.NONE
    assert rig.axis.power.phase is PowerPhase.ON, "the brake closes at rest"


def test_the_first_scan_of_a_motion_is_no_rest():
    """The shaft does not turn yet."""
    rig = powered()
    rig.move(5.0)
    assert rig.axis.feedback.slow
    assert not rig.output.at_rest


def test_an_alarm_of_the_first_scan_shows_in_the_state():
    rig = Rig()
    rig.axis.alarms.raise_(Code.DRV_07, measured=1.0, limit=1.0)
    rig.step()
    assert rig.axis.state is AxisState.ERROR_STOP


def test_an_axis_at_rest_that_is_switched_off_is_not_told_as_stopping():
    rig = powered()
    rig.op(power=False)
    assert rig.axis.state is AxisState.STANDSTILL
    rig.step()
    assert rig.axis.state is AxisState.DISABLED


@BOTH
def test_a_quick_stop_that_drives_against_its_torque_is_asked_by_its_ramp(way):
    """Torque of 0.1 N m against 0.01 rad/s: 1e-3 W, more than what counts; on the limit it does not."""
    rig = powered()
    asked = []
    rig.axis._drives_against = -1e-3
    rig.axis.liveness = SimpleNamespace(
        vel_rad_s=0.0,
        asking=False,
        stand=lambda *, proven: None,
        stop=lambda: None,
        drive_against=lambda: asked.append("held"),
        ramp_against=lambda *, left: asked.append(left),
    )
    # In DISABLING a drive that owns its brake holds the load on its own ramp: it ran away there with 2.9 deg/s, untold.
    phases = (
        (PowerPhase.ON, ["held"]),
        (PowerPhase.DISABLING, ["held"]),
        (PowerPhase.QUICK_STOPPING, [False]),
    )
    for phase, told in phases:
        rig.axis.power.phase = phase
        for vel, torque, counts in ((0.01, 0.1, False), (0.01, 0.11, True)):
            asked.clear()
            rig.axis.feedback.vel_rad_s, rig.axis.feedback.torque_nm = way * vel, -way * torque
            rig.axis._try_reading()
            assert asked == (told if counts else [])


def test_an_axis_whose_reading_is_being_asked_about_does_not_park():
    rig = Rig(config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.6))
    rig.power_up()
    watch = rig.axis.liveness = Asked()
    watch.asking = True
    rig.run(1.0)
    assert rig.axis.power.phase is PowerPhase.ON
    watch.asking = False
    rig.run(0.5)
    assert rig.axis.power.phase is PowerPhase.PARKED


@pytest.mark.parametrize("torque_nm", [1e6, -1e6])
def test_a_torque_that_no_motor_gives_is_told_with_power_off_too(torque_nm):
    rig = Rig()
    rig.run(0.1)
    rig.spoil = lambda drive: drive._replace(torque_act_nm=torque_nm)
    rig.run(0.1)
    assert rig.codes


@pytest.mark.parametrize("phase", PowerPhase)
@pytest.mark.parametrize("brake_open", [True, False])
def test_the_reading_of_a_shaft_that_no_torque_holds_is_not_asked_about(phase, brake_open):
    """By its torque it is asked only on the ramp of the drive and as the brake closes, until that holds.

    A drive that owns its brake closes it in DISABLING.
    """
    rig = powered()
    watch = rig.axis.liveness = Asked()
    rig.axis.power.phase, rig.axis.feedback.brake_open = phase, brake_open
    rig.axis._try_reading()
    by_torque = phase in (PowerPhase.QUICK_STOPPING, PowerPhase.CLOSING, PowerPhase.DISABLING) and brake_open
    by_speed = phase in (PowerPhase.ON, PowerPhase.SAG_WATCH)
    assert watch.asked == ("stop" if by_torque else "proven" if by_speed else None)
