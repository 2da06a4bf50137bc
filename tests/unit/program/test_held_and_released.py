"""HOLD and the way out of it, stops while the brake is still shut, and a load that falls where nothing may hold it."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from gantryctl.image import BufferMode, DigitalInputs, DriveRequest, DriveState
from gantryctl.motion.types import MotionLimits
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.motion_command import CommandStatus
from gantryctl.program.settings import StandstillPolicy
from gantryctl.units import rad
from unit.program.brake_rig import TestRig
from unit.program.parts import BOTH, PERIODS, Parts
from unit.program.power_steps import P, held_again, record, slip
from unit.program.rig import RATIO, Rig, moving_rig, settings

approx = pytest.approx
HOLDS = {"holding_torque_nm": 12.0}


@pytest.mark.parametrize("phase", [P.ENABLING, P.PROVING, P.SETTLING])
def test_a_quick_stop_before_the_release_never_opens_the_brake(phase):
    """Nothing moves there, so the drive is disabled at once."""
    rig = Rig(config=settings(**HOLDS))
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is phase, 1.0)
    rig.op(quick_stop=True)
    for _ in range(300):
        rig.step()
        assert not rig.output.brake_open
        assert rig.output.request is DriveRequest.DISABLE
    assert rig.axis.is_off


@pytest.mark.parametrize("phase", [P.RELEASING, P.SAG_WATCH])
def test_a_quick_stop_while_the_brake_opens_keeps_the_torque_until_the_brake_is_shut(phase):
    """The brake may be half open: the drive stops the load on its ramp, and holds it for the 150 ms of closing."""
    rig = Rig(config=settings(**HOLDS))
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is phase, 1.0)
    if phase is P.RELEASING:
        rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.op(quick_stop=True)
    seen = [each for each, _ in record(rig, 1.0)]
    assert seen == [P.QUICK_STOPPING, P.CLOSING, P.UNLOADING, P.DISABLING, P.OFF]


def test_a_load_that_falls_where_no_torque_may_come_back_is_told_once_it_is_far():
    """The chain is open: a brake that slips by more than 0.02 deg gets no torque; beyond 0.15 deg the load falls."""
    rig = Rig(config=settings(**HOLDS))
    rig.run(0.1)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(0.1)
    slip(rig, 0.1)
    assert rig.codes == ["INT-03", "BRK-04"]
    assert rig.axis.alarms.active["BRK-04"].steps == (Words.TORQUE_OFF_COMMANDED,), "no torque is kept"
    slip(rig, 0.1)
    assert rig.codes == ["INT-03", "BRK-04", "BRK-13"]
    assert rig.output.request is DriveRequest.DISABLE


def test_a_load_at_90_deg_is_held_as_one_at_0_deg():
    """Its way counts from where HOLD began."""
    rig = Rig(at_deg=90.0, config=settings(**HOLDS))
    rig.run(0.5)
    slip(rig, 0.021)
    rig.run(0.5)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    assert rig.codes == ["BRK-04"]


@BOTH
def test_hold_gives_back_the_torque_of_the_release_and_not_what_was_learned_since(way):
    """The drive adds it to its own loop, whose integrator has the 8 N m that came on top."""
    rig = Rig(config=settings(holding_torque_nm=way * 12.0))
    rig.power_up()
    rig.spoil = lambda drive: drive._replace(torque_act_nm=way * 20.0)
    rig.run(4.0)
    assert rig.axis.holding_torque_nm == approx(way * 20.0, abs=0.5)
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING)
    rig.spoil = None
    slip(rig, 0.021)
    rig.run(0.01)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    assert rig.output.torque_ff_nm == approx(way * 12.0)


def test_hold_ends_with_a_drive_that_gives_no_torque_within_2_s():
    """Nobody holds the load: the brake alone has it, and people are told."""
    rig = Rig(config=settings(**HOLDS))
    rig.run(0.1)
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCH_ON_DISABLED)
    slip(rig, 0.021)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    rig.run(1.95)
    assert rig.codes == ["BRK-04"]
    rig.run(0.1)
    assert rig.codes == ["BRK-04", "DRV-03"]
    assert rig.output.request is DriveRequest.DISABLE
    assert rig.output.torque_ff_nm == 0.0


def test_after_a_hold_the_torque_goes_off_in_steps_and_a_brake_that_slips_again_gets_it_back():
    rig = held_again()
    rig.run(0.3)
    rig.program.service = True
    rig.op(reset=True)
    rig.op(reset=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING, 0.5)
    slip(rig, 0.021)
    rig.run(0.01)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    rig.run(0.3)
    rig.op(reset=True)
    assert [phase for phase, _ in record(rig, 1.0)] == [P.CLOSING, P.UNLOADING, P.DISABLING, P.OFF]


@pytest.mark.parametrize("parked", [True, False])
def test_a_contact_that_says_open_behind_a_brake_that_was_shut_is_told(parked):
    """150 ms to close and 300 ms for the contact are long over."""
    config = settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=0.3, **HOLDS)
    rig = Rig(config=config)
    rig.power_up()
    if parked:
        rig.until(lambda: rig.axis.power.phase is P.PARKED, 3.0)
    else:
        rig.op(power=False)
    rig.run(1.0)
    assert rig.codes == []
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.run(0.01)
    assert "BRK-06" in rig.codes


@BOTH
def test_a_brake_of_the_controller_that_gives_way_as_it_takes_over_is_told_at_0_02_deg(way):
    """Only behind a drive that owns its brake a gear may unwind."""
    rig = Rig(config=settings(**HOLDS))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.is_off, 2.0)
    slip(rig, way * 0.019)
    assert rig.codes == []
    slip(rig, way * 0.003)
    assert rig.codes == ["BRK-03"]


def test_a_slip_behind_a_stop_is_not_one_of_the_hand_over_before_it():
    """The brake took the load over in the first cycle; in the second the chain was opened, and then it gave way."""
    rig = Rig(config=settings(**HOLDS))
    rig.power_up()
    rig.op(power=False)
    rig.run(1.0)
    rig.power_up()
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.until(lambda: rig.axis.is_off, 2.0)
    slip(rig, 0.025)
    assert rig.codes == ["INT-03", "BRK-04"]


@pytest.mark.parametrize("state", [DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE])
def test_a_drive_that_keeps_its_torque_is_not_off(state):
    """It is told 200 ms after it was told to be off; in ErrorStop it cannot be reset before it is."""
    rig = Rig(config=settings(**HOLDS))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.DISABLING, 2.0)
    rig.spoil = lambda drive: drive._replace(state=state)
    rig.run(0.18)
    assert not rig.axis.is_off
    assert rig.codes == []
    rig.run(0.1)
    assert rig.codes == ["DRV-03"]
    rig.run(2.0)
    refused = rig.axis.reset(service=True)
    assert refused is not None
    assert "still enabled" in refused.text
    rig.spoil = None
    rig.run(0.1)
    assert rig.axis.reset() is None


def test_a_drive_that_keeps_its_torque_behind_a_stop_is_told():
    """The emergency stop is the first alarm; that the torque is not off follows 200 ms later."""
    rig = Rig(config=settings(**HOLDS))
    rig.power_up()
    rig.spoil = lambda drive: drive._replace(state=DriveState.OPERATION_ENABLED)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(0.18)
    assert rig.codes == ["INT-03"]
    rig.run(0.1)
    assert rig.codes == ["INT-03", "DRV-03"]


# --- the brake test ---------------------------------------------------------------------------------------------------


def test_a_brake_test_may_ask_for_more_than_the_rated_torque_for_its_seconds():
    """A brake that takes all back: 30 N m of load, and twice 120; the motor has 385 for a short time, 257 for good."""
    rig = TestRig(config=settings(test_torque_nm=120.0, holding_torque_nm=30.0))
    rig.begin()
    rig.spoil = lambda drive: drive._replace(torque_act_nm=30.0)
    rig.run(1.4)
    assert max(rig.torques) == approx(270.0)


def test_no_torque_holds_a_load_by_a_reading_in_doubt():
    """HOLD that one alarm has begun ends in the scan in which the angle is not believed any more."""
    rig = held_again()
    rig.axis.feedback.in_doubt = True
    rig.step()
    assert rig.axis.power.phase is P.TORQUE_OFF


@BOTH
@pytest.mark.parametrize("phase", [P.CLOSING, P.UNLOADING])
def test_a_speed_that_grows_against_the_torque_while_the_brake_closes_is_of_the_wrong_sign(way, phase):
    """The drive pushes the load on, and the brake does not hold yet: 330 of 385 N m, and 0.05 deg/s more a scan."""
    rig = Rig(config=settings(**HOLDS))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is phase, 5.0)
    speeds = iter(range(100))
    rig.spoil = lambda drive: drive._replace(
        torque_act_nm=-way * 330.0, vel_act_rad_s=way * rad(0.1 + 0.05 * next(speeds)) * RATIO
    )
    assert not rig.output.at_once
    # 0.15 deg/s more than the slowest is no speed of a sound axis; two scans for the ramp of it.
    rig.run(0.006)
    assert rig.codes == ["ENC-12"]
    assert rig.axis.power.phase is P.TORQUE_OFF
    # A drive that closes its brake in order of its own hears nothing else.
    assert rig.output.at_once


@BOTH
def test_a_speed_that_grows_against_the_torque_as_the_brake_opens_is_of_the_wrong_sign(way):
    """The contact goes on saying closed, so the axis stays in the phase: 0.588 deg on the plant (random 102094)."""
    rig = Rig(config=settings(**HOLDS))
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.RELEASING, 5.0)
    speeds = iter(range(100))
    rig.spoil = lambda drive: drive._replace(
        torque_act_nm=-way * 330.0,
        vel_act_rad_s=way * rad(0.1 + 0.05 * next(speeds)) * RATIO,
        brake_open=False,
    )
    rig.run(0.006)
    assert rig.codes == ["ENC-12"]
    assert rig.axis.power.phase is P.TORQUE_OFF


def test_a_brake_closes_for_the_end_of_a_ramp_that_nobody_sees():
    """No speed any more: 6 deg/s at 5.5 deg/s2 are 1.09 s; the brake takes 150 ms, and then the torque goes."""
    rig = moving_rig()
    rig.op(quick_stop=True)
    began = rig.scan
    rig.spoil = lambda drive: drive._replace(speed_age_scans=100, age_scans=100)
    rig.until(lambda: not rig.output.brake_open, 3.0)
    closed_s = (rig.scan - began) * rig.period_s
    assert 1.09 - 0.15 <= closed_s <= 1.09 + 0.05
    rig.until(lambda: rig.output.request is DriveRequest.DISABLE, 3.0)
    assert (rig.scan - began) * rig.period_s == approx(closed_s + 0.15, abs=0.02)


@PERIODS
def test_a_brake_that_does_not_stop_the_axis_is_told_in_the_scan_after_3_s(period_s):
    rig = moving_rig(config=settings(period_s=period_s))
    speed = rig.drive.vel_rad_s

    def turns_on(drive):
        rig.drive.pos_motor_rad += speed * period_s
        return drive._replace(vel_act_rad_s=speed)

    rig.spoil = turns_on
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.step()
    assert rig.axis.power.phase is P.TORQUE_OFF
    scans = 0
    while "BRK-11" not in rig.codes:
        rig.step()
        scans += 1
        assert scans < 3.1 / period_s
    assert scans == round(3.0 / period_s) + 1


@pytest.mark.parametrize(
    ("share", "told_s"),
    [
        # Half a second of swing, 0.3 s of rest and 0.15 s of brake; then (6 - 3) / 1 s, or as it was: 3 s.
        (0.5, 3.95),
        (1.0, 3.0),
    ],
)
def test_torque_catches_no_slow_axis_that_its_brake_slows(share, told_s):
    """6 deg/s and 1 deg/s2 at least, as a large crane."""
    config = settings(period_s=0.01)
    power = replace(config.power, brake_dec_least_rad_s2=rad(1.0))
    rig = moving_rig(config=replace(config, power=power))
    top = now = rig.drive.vel_rad_s

    def slows(drive):
        nonlocal now
        if rig.axis.power.phase is P.TORQUE_OFF:  # by 1 deg/s a scan
            now = max(share * top, now - top / 6.0)
        rig.drive.pos_motor_rad += now * 0.01
        return drive._replace(vel_act_rad_s=now)

    rig.spoil = slows
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.step()
    begin = rig.scan
    rig.until(lambda: "BRK-11" in rig.codes, 5.0)
    assert (rig.scan - begin) * 0.01 == pytest.approx(told_s, abs=0.021)


@pytest.mark.parametrize(("dec_deg_s2", "ends_s"), [(5.8, 1.5), (1.0, 6.75)])
def test_a_stop_by_the_brake_that_nobody_reads_lasts_as_long_as_the_axis_may_turn(dec_deg_s2, ends_s):
    """0.15 s and 6.6 deg/s by the slowest braking of the axis, 1.5 s at least."""
    config = settings(period_s=0.01)
    power = replace(config.power, brake_dec_least_rad_s2=rad(dec_deg_s2))
    rig = moving_rig(config=replace(config, power=power))
    frozen, age = rig.drive.read(), 0

    def silent(drive):
        nonlocal age
        age += 1
        return frozen._replace(state=drive.state, age_scans=age, speed_age_scans=age)

    rig.spoil = silent
    rig.until(lambda: rig.axis.power.phase is P.TORQUE_OFF, 3.0)
    begin = rig.scan
    rig.until(lambda: rig.axis.power.phase is P.OFF, 8.0)
    assert (rig.scan - begin) * 0.01 == pytest.approx(ends_s, abs=0.021)


@BOTH
def test_after_a_stop_the_axis_is_switched_on_with_no_speed_of_before(way):
    """The last command of the law was 6 deg/s: the first one of the next power-up is that of an axis at rest."""
    rig = Rig()
    rig.power_up()
    rig.move(way * 100.0)
    rig.run(2.0)
    assert abs(rig.output.vel_cmd_rad_s) == approx(rad(6.0) * RATIO, rel=1e-4)
    rig.op(power=False, quick_stop=True)
    rig.until(lambda: rig.axis.is_off, 4.0)
    rig.op(reset=True, quick_stop=False)
    rig.run(0.1)
    assert rig.codes == []
    rig.op(power=True)
    while not rig.axis.virtual.following:
        rig.step()
        assert abs(rig.output.vel_cmd_rad_s) < rad(0.001) * RATIO


def test_power_off_asked_for_twice_is_one_stop():
    """The second one plans no other stop and ends nothing anew."""
    rig = moving_rig()
    rig.axis.power_off()
    rig.step()
    plans = len(rig.axis.plans)
    rig.run(0.2)
    rig.axis.power_off()
    rig.step()
    assert rig.axis.motion.switching_off
    assert len(rig.axis.plans) == plans


PARKS = {"standstill": StandstillPolicy.BRAKE, "hold_brake_after_s": 0.3}


def reset(rig):
    """By the operator, or by service where a rig has that role."""
    rig.op(power=False, quick_stop=False, reset=True)
    rig.op(reset=False)
    rig.run(0.1)
    assert rig.codes == []


def test_an_axis_that_is_stopped_while_it_parks_is_off_and_not_parked():
    """A motion would find nobody to wake, and power could not be switched on."""
    rig = Rig(config=settings(**PARKS, **HOLDS))
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is P.CLOSING, 1.0)
    rig.op(quick_stop=True)
    rig.run(1.0)
    assert rig.axis.power.phase is P.OFF
    reset(rig)
    rig.power_up()


def test_a_parked_axis_whose_angle_is_set_anew_has_not_slipped():
    """Set and stopped in one scan: the brake is watched from the new angle on."""
    rig = Rig(config=settings(**PARKS))
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is P.PARKED, 2.0)
    rig.run(0.1)
    assert rig.axis.set_position(rad(10.0)) is None
    rig.axis.quick_stop()
    assert rig.axis.power.phase is P.OFF
    rig.run(0.1)
    assert rig.codes == ["INT-06"]
    assert rig.pos_deg == approx(10.0, abs=1e-6)


def test_a_second_hold_waits_for_its_drive_as_the_first_one_did():
    """Off for a second, then the brake slips again: 10 scans to be enabled, which is no drive that has let go."""
    rig = held_again()
    rig.run(0.3)
    rig.program.service = True
    reset(rig)
    rig.until(lambda: rig.axis.is_off, 1.0)
    rig.run(1.0)
    begun = rig.scan
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON) if rig.scan < begun + 20 else drive
    rig.drive.pos_motor_rad += rad(0.0205) * RATIO
    rig.run(0.2)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    assert len(rig.codes) == 1
    assert rig.codes[0].startswith("BRK-")
    assert rig.output.torque_ff_nm == approx(12.0)


def test_a_second_stop_at_rest_is_watched_for_50_ms_like_the_first():
    """Rest of the stop before counts for nothing."""
    rig = Rig()
    for _ in range(2):
        rig.power_up()
        rig.op(quick_stop=True)
        scans = 1
        while rig.axis.power.phase is P.QUICK_STOPPING:
            rig.step()
            scans += 1
        assert scans == approx(51, abs=1)
        rig.until(lambda: rig.axis.is_off, 1.0)
        reset(rig)


@BOTH
@pytest.mark.parametrize(("load_nm", "asked"), [(29.0, False), (40.0, True)])
def test_a_reading_that_shows_nothing_of_the_load_that_goes_onto_the_brake_is_in_doubt(load_nm, asked, way):
    """As much as the proof gives, 30 N m, turns the shaft of a fine encoder; less may turn it by nothing."""
    rig = Rig(config=settings(holding_torque_nm=way * load_nm))
    rig.power_up()
    rig.axis.power._twist._fine = True  # the ideal shaft does not turn
    rig.op(power=False)
    rig.run(2.5)
    assert rig.codes == (["ENC-02"] if asked else [])
    assert rig.axis.feedback.in_doubt is asked
    assert rig.axis.is_off


def test_in_position_begins_anew_at_each_power_up():
    """In the window for 200 ms: what was so before the brake closed says nothing."""
    rig = Rig()
    for _ in range(2):
        rig.op(power=True)
        rig.until(lambda: rig.axis.virtual.following, 3.0)
        scans = 0
        while not rig.output.in_position:
            rig.step()
            scans += 1
        assert scans == approx(200, abs=2)
        rig.op(power=False)
        rig.until(lambda: rig.axis.is_off, 2.0)


def test_an_alarm_ends_every_command_with_its_reason():
    """Of what is under way and what waits behind it: nothing goes on after the reset."""
    rig = moving_rig()
    behind = rig.axis.motion.move_relative(rad(1.0), rad(3.0), buffer_mode=BufferMode.BUFFERED)
    assert behind.status is CommandStatus.WAITING
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.step()
    assert rig.program.move.error
    assert behind.status is CommandStatus.ERROR
    assert behind.refusal.code == "INT-03"
    assert rig.axis.motion.current is rig.axis.motion.buffered is None


def test_the_torque_of_the_laws_comes_on_top_of_what_holds_the_load():
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    law = rig.axis._law
    rig.axis.load_side = SimpleNamespace(
        scan=lambda virtual, counts: law(virtual.pos_ref_rad, virtual.vel_ref_rad_s, counts), torque_ff_nm=5.0
    )
    rig.step()
    assert rig.output.torque_ff_nm == approx(17.0)


@BOTH
def test_a_stop_that_would_pass_the_end_of_travel_leaves_the_plan_that_ends_there(way):
    """On the ramp to 180 deg, 4 deg/s2; a stop with 1 deg/s2 from there would end 4.5 deg behind."""
    parts = Parts()
    virtual = parts.virtual
    virtual.follow_from(way * rad(170.0), 0)
    assert virtual.move_to(way * rad(180.0), rad(6.0), parts.settings.ramps, 0) is None
    virtual.sample(round(1000.0 * virtual.plan.duration) - 750)  # 3 deg/s, 1.125 deg before the end
    virtual.stop(MotionLimits(rad(6.0), rad(4.0), rad(1.0)), 0)
    assert virtual.plan.pos_end == approx(way * rad(180.0))
    assert virtual.stopping
