"""The power sequence on its way down: order, holding, stops, a brake that does not do its work."""

import itertools

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, DriveState
from gantryctl.program import AxisState, Code, Reaction
from gantryctl.program.feedback import ENABLED
from gantryctl.program.settings import StandstillPolicy
from gantryctl.units import deg, rad
from unit.program.power_steps import P, record, slip
from unit.program.rig import COUNTS_PER_DEG, Rig, moving_rig, powered, settings


def test_down_in_reverse():
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    seen = record(rig, 1.0)
    assert [phase for phase, _ in seen] == [P.CLOSING, P.UNLOADING, P.DISABLING, P.OFF]
    outputs = dict(seen)
    assert outputs[P.CLOSING].request is DriveRequest.ENABLE
    assert not outputs[P.CLOSING].brake_open
    assert outputs[P.CLOSING].torque_ff_nm == pytest.approx(12.0), "torque stays until the brake is closed"
    assert outputs[P.UNLOADING].torque_ff_nm == pytest.approx(0.0, abs=1e-9), "taken off before disable"
    assert not rig.program.power.status
    assert rig.axis.state is AxisState.DISABLED


def test_torque_goes_off_in_three_steps():
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING)
    levels = []
    while rig.axis.power.phase is P.UNLOADING:
        levels.append(round(rig.output.torque_ff_nm, 6))
        rig.step()
    assert [level for level, _ in itertools.groupby(levels)][-3:] == [8.0, 4.0, 0.0]


def test_power_off_in_motion_stops_on_the_jog_release_ramp_first():
    rig = moving_rig()
    rig.op(power=False)
    assert rig.axis.state is AxisState.STOPPING
    before = rig.pos_deg
    rig.until(lambda: rig.axis.power.phase is P.CLOSING)
    # 6 deg/s at 5 deg/s2 is 3.6 deg; the ends of the ramp at 100 deg/s3 add v a / 2 j = 0.15.
    assert rig.pos_deg - before == pytest.approx(3.75, abs=0.02)
    rig.run(1.0)
    assert rig.axis.power.phase is P.OFF
    assert rig.program.move.command_aborted or not rig.program.move.busy


def test_power_asked_for_again_while_it_goes_off_is_refused():
    rig = moving_rig()
    rig.op(power=False)
    rig.op(power=True)
    assert "still being switched off" in rig.refused()
    rig.run(4.0)
    assert rig.axis.power.phase is P.OFF, "Enable must become FALSE and TRUE again"
    rig.op(power=False)
    rig.power_up()


def test_brake_that_does_not_hold_at_power_off_gets_the_torque_back():
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING)
    rig.run(0.06)
    slip(rig, 0.025)
    rig.run(0.01)
    assert rig.codes == ["BRK-03"]
    assert rig.axis.power.phase is P.TORQUE_HOLD
    assert rig.output.request is DriveRequest.ENABLE
    assert rig.output.torque_ff_nm == pytest.approx(12.0)
    assert rig.output.vel_cmd_rad_s == 0.0
    assert rig.axis.state is AxisState.ERROR_STOP
    assert "LOCK" not in rig.first.text
    assert "Secure the load and call service" in rig.first.text


def test_only_service_resets_a_hold_and_then_the_brake_is_tried_again():
    rig = Rig()
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING)
    rig.run(0.01)
    slip(rig, 0.025)
    rig.run(0.1)
    rig.op(reset=True)
    assert "service role only" in rig.refused()
    assert rig.axis.power.phase is P.TORQUE_HOLD
    rig.program.service = True
    rig.op(reset=False)
    rig.op(reset=True)
    rig.run(1.0)
    assert rig.axis.power.phase is P.OFF
    assert rig.axis.state is AxisState.DISABLED


def test_brake_that_slips_later_is_caught_by_the_drive():
    rig = Rig(config=settings(holding_torque_nm=7.0))
    rig.power_up()
    rig.op(power=False)
    rig.run(10.0)
    assert rig.axis.power.phase is P.OFF
    slip(rig, 0.0195)
    rig.run(0.5)
    assert not rig.codes, "within the window"
    slip(rig, 0.001)
    rig.run(0.02)
    assert rig.codes == ["BRK-04"]
    assert rig.drive.state is DriveState.OPERATION_ENABLED
    assert rig.output.torque_ff_nm == pytest.approx(rig.axis.holding_torque_nm, abs=0.1)


def test_no_holding_with_an_open_emergency_stop():
    rig = Rig()
    rig.run(0.1)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(0.1)
    slip(rig, 0.1)
    rig.run(0.5)
    assert rig.codes == ["INT-03", "BRK-04"]
    assert rig.output.request is DriveRequest.DISABLE
    assert [alarm.code for alarm in rig.first.consequences] == ["BRK-04"], "folded under the first"


def test_quick_stop_goes_down_through_brake_and_unloading():
    rig = moving_rig()
    before = rig.pos_deg
    rig.op(quick_stop=True)
    seen = [phase for phase, _ in record(rig, 3.0)]
    assert seen == [P.QUICK_STOPPING, P.CLOSING, P.UNLOADING, P.DISABLING, P.OFF]
    # v^2 / 2a at 5.5 deg/s2, plus one scan.
    assert rig.pos_deg - before == pytest.approx(6.0**2 / 11.0, abs=0.02)
    assert rig.axis.state is AxisState.ERROR_STOP
    assert rig.first.text.startswith("INT-06 STOP")
    assert "at rest after 1" in rig.first.text
    assert "axis moved 3.2" in rig.first.text


def test_quick_stop_not_obeyed_becomes_torque_off():
    rig = moving_rig()
    rig.op(quick_stop=True)
    speed = rig.drive.vel_rad_s

    def runs_on(drive):
        rig.drive.vel_rad_s = speed
        return drive._replace(vel_act_rad_s=speed)

    rig.spoil = runs_on
    start = rig.scan
    rig.until(lambda: rig.axis.power.phase is P.TORQUE_OFF, 1.0)
    # Reaction 60 ms, then 0.5 deg/s under the ramp (91 ms at 5.5 deg/s2), then 50 ms.
    assert (rig.scan - start) * rig.period_s == pytest.approx(0.2, abs=0.01)
    assert rig.codes == ["INT-06", "DRV-07"]
    assert rig.output.request is DriveRequest.DISABLE
    assert not rig.output.brake_open


@pytest.mark.parametrize("way_deg", [30.0, -30.0])
def test_no_motion_begins_while_power_goes_off(way_deg):
    """It was made to its end, and power went off after it (campaign, matrix cell 226894)."""
    rig = moving_rig()
    rig.op(power=False, move=False)
    rig.run(0.3)
    rig.move(rig.pos_deg + way_deg, 6.0)
    assert "still being switched off" in rig.refused()
    rig.until(lambda: rig.axis.is_off, 3.0)
    rig.op(move=False)
    rig.power_up()


def test_a_move_that_comes_together_with_power_off_is_refused():
    rig = Rig()
    rig.power_up()
    rig.op(power=False, move=True, target_rad=rad(30.0), speed_rad_s=rad(6.0))
    assert "still being switched off" in rig.refused()
    rig.run(2.0)
    assert rig.axis.is_off
    assert abs(rig.pos_deg) < 1e-3


@pytest.mark.parametrize("speed_deg_s", [0.06, 0.24, 0.49])
def test_a_drive_that_goes_on_slowly_after_a_quick_stop_is_seen_too(speed_deg_s):
    """Below the permitted deviation of the speed: it went on for 3 s, 1.5 deg from 0.49 deg/s."""
    rig = moving_rig()
    speed = rad(speed_deg_s) * rig.axis.settings.law.ratio

    def goes_on(drive):
        turns = max(rig.drive.vel_rad_s, speed)
        rig.drive.pos_motor_rad += (turns - rig.drive.vel_rad_s) * rig.period_s
        return drive._replace(vel_act_rad_s=turns)

    rig.op(quick_stop=True)
    rig.spoil = goes_on
    start, ramp_s = rig.scan, 6.0 / 5.5
    rig.until(lambda: rig.axis.power.phase is P.TORQUE_OFF, 2.0)
    # 0.25 s after the end of the ramp it must stand; then 50 ms.
    assert (rig.scan - start) * rig.period_s == pytest.approx(ramp_s + 0.3, abs=0.03)
    assert rig.codes == ["INT-06", "DRV-07"]
    assert "ramp allows 0.05 deg/s" in rig.axis.alarms.active["DRV-07"].text


def test_load_that_the_brake_does_not_stop():
    rig = moving_rig()
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    speed = rig.drive.vel_rad_s

    def slides(drive):
        rig.drive.pos_motor_rad += speed * rig.period_s
        return drive._replace(vel_act_rad_s=speed)

    rig.spoil = slides
    rig.run(3.1)
    assert rig.codes == ["INT-03", "BRK-11"]
    assert "Still 6.00 deg/s" in rig.axis.alarms.active["BRK-11"].text
    assert rig.output.request is DriveRequest.DISABLE, "the chain is open: nothing may be enabled"
    rig.op(reset=True)
    assert "still stopping" in rig.refused()


ON_THE_WAY_UP = [0.0, 0.002, 0.01, 0.06, 0.11, 0.12, 0.2, 0.31]


@pytest.mark.parametrize("seconds", ON_THE_WAY_UP)
def test_power_taken_back_on_the_way_up(seconds):
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.op(power=True)
    rig.run(seconds)
    rig.op(power=False)
    rig.run(2.0)
    assert rig.axis.power.phase is P.OFF
    assert rig.axis.state is AxisState.DISABLED
    assert not rig.codes
    assert rig.output.request is DriveRequest.DISABLE


@pytest.mark.parametrize("seconds", ON_THE_WAY_UP)
@pytest.mark.parametrize("code", ["INT-06", "DRV-01", "PWR-01"])
def test_a_stop_on_the_way_up_ends_safely(seconds, code):
    rig = Rig()
    rig.op(power=True)
    rig.run(seconds)
    if code == "INT-06":
        rig.op(quick_stop=True)
    elif code == "DRV-01":
        rig.drive.error_code = 5
        rig.run(0.002)
    else:
        rig.drive.inputs = DigitalInputs(mains_ready=False)
        rig.step()
    assert rig.first.code == code
    rig.run(2.0)
    assert rig.axis.power.phase is P.OFF
    assert not rig.output.brake_open
    assert rig.output.torque_ff_nm == 0.0
    assert rig.axis.state is AxisState.ERROR_STOP
    assert not rig.program.power.status


def test_mains_lost_while_the_brake_holds(parked):
    parked.drive.inputs = DigitalInputs(mains_ready=False)
    parked.step()
    assert parked.codes == ["PWR-01"]
    assert parked.axis.power.phase is P.OFF


def test_servo_holds_by_default():
    rig = Rig(config=settings(period_s=0.004))
    rig.power_up()
    rig.run(40.0)
    assert rig.axis.power.phase is P.ON


@pytest.fixture
def parked():
    rig = Rig(config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=1.0))
    rig.power_up()
    rig.run(2.0)
    return rig


def test_brake_holds_after_its_time(parked):
    assert parked.axis.power.phase is P.PARKED
    assert parked.output.request is DriveRequest.DISABLE
    assert parked.program.power.status, "the axis can be commanded"
    assert parked.axis.state is AxisState.STANDSTILL


def test_next_motion_opens_the_brake_again_through_the_proof(parked):
    parked.move(5.0)
    assert parked.program.move.busy
    assert not parked.program.move.active
    parked.until(lambda: parked.axis.power.phase is P.PROVING, 0.1)
    parked.until(lambda: parked.program.move.done, 5.0)
    assert parked.pos_deg == pytest.approx(5.0, abs=1e-4)


@pytest.mark.parametrize("phase", [P.CLOSING, P.UNLOADING, P.DISABLING])
def test_a_motion_asked_for_while_the_brake_closes_opens_it_again(phase):
    # it waited until something else opened the brake, minutes later: motion by surprise
    rig = Rig(config=settings(standstill=StandstillPolicy.BRAKE, hold_brake_after_s=1.0))
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is phase, 5.0)
    rig.move(5.0)
    rig.until(lambda: rig.program.move.done, 8.0)
    assert rig.pos_deg == pytest.approx(5.0, abs=1e-4)


def test_a_stop_drops_a_motion_that_waits_for_the_brake(parked):
    parked.move(5.0)
    parked.op(stop=True)
    assert parked.program.move.command_aborted
    parked.op(stop=False)
    parked.run(2.0)
    assert parked.pos_deg == pytest.approx(0.0, abs=1e-4), "nothing that waited comes back"


def test_a_refused_motion_does_not_wake_the_axis(parked):
    parked.move(200.0)
    parked.run(0.2)
    assert parked.axis.power.phase is P.PARKED


def test_power_off_while_parked(parked):
    parked.op(power=False)
    parked.run(0.1)
    assert parked.axis.power.phase is P.OFF
    assert parked.axis.state is AxisState.DISABLED


def test_power_off_while_a_drive_that_owns_its_brake_is_parked_and_shows_switched_on():
    """It opens nothing: there is no way up to turn back from, and power can be asked for again."""
    policy = {"standstill": StandstillPolicy.BRAKE, "hold_brake_after_s": 0.1}
    rig = Rig(config=settings(brake_by_drive=True, **policy))
    rig.spoil = lambda drive: drive._replace(brake_open=drive.state is DriveState.OPERATION_ENABLED)
    rig.power_up()
    rig.until(lambda: rig.axis.power.phase is P.PARKED, 5.0)
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON, brake_open=False)
    rig.op(power=False)
    rig.run(0.1)
    assert rig.axis.is_off
    assert not rig.axis.power.falling
    assert rig.axis.power_on() is None


def test_brake_feedback_open_while_off_blocks_the_next_power_up():
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.run(0.6)
    assert rig.codes == ["BRK-06"]
    assert rig.axis.state is AxisState.DISABLED, "a warning at rest"
    rig.spoil = None
    rig.op(power=True)
    assert "BRK-06 is active" in rig.refused()
    rig.op(power=False, reset=True)
    rig.op(reset=False)
    rig.power_up()


def test_holding_torque_is_learned_at_standstill():
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(
        torque_act_nm=drive.torque_act_nm + (14.0 if drive.brake_open else 0.0)
    )
    rig.power_up()
    rig.run(6.0)
    assert rig.axis.holding_torque_nm == pytest.approx(14.0, rel=0.01), "six time constants of 1 s"


def test_the_set_point_follows_the_axis_while_off():
    rig = Rig(at_deg=10.0)
    rig.run(0.01)
    for _ in range(100):  # turned by hand, slowly enough for a real encoder
        slip(rig, 0.0001)
    assert rig.ref_deg == pytest.approx(deg(rig.drive.pos_rad), abs=1e-6)
    assert rig.axis.pos_err_rad == 0.0
    assert rig.output.vel_cmd_rad_s == 0.0


def test_stale_position_jump_while_off_is_seen():
    rig = Rig()
    rig.run(0.1)
    rig.spoil = lambda drive: drive._replace(
        pos_act_counts=drive.pos_act_counts + round(0.5 * COUNTS_PER_DEG)
    )
    rig.run(0.01)
    assert rig.codes == ["ENC-01"], "an encoder fault, not a slipping brake: nothing is enabled"
    assert rig.output.request is DriveRequest.DISABLE


@pytest.mark.parametrize(
    ("degrees", "after_s", "codes"),
    [(0.025, 0.1, ["INT-06"]), (0.06, 0.1, ["INT-06", "BRK-04"]), (0.025, 0.4, ["INT-06", "BRK-04"])],
)
def test_the_gear_unwinds_behind_a_drive_that_owns_its_brake(degrees, after_s, codes):
    """Up to 0.026 deg, over after 0.3 s: no slip. What is more, or later, is one."""
    rig = Rig(config=settings(brake_by_drive=True))
    rig.spoil = lambda drive: drive._replace(brake_open=drive.state in ENABLED)
    rig.power_up()
    rig.op(quick_stop=True)
    rig.run(0.3)
    rig.drive.state = DriveState.SWITCH_ON_DISABLED  # ramp, brake, torque off: 605A = 2
    rig.until(lambda: rig.axis.power.phase is P.OFF, 1.0)
    rig.run(after_s)
    slip(rig, degrees)
    rig.run(0.01)
    assert rig.codes == codes


def test_a_warning_that_becomes_a_stop_is_the_first_alarm_of_that_stop():
    rig = moving_rig()
    rig.axis.alarms.raise_(Code.CTL_06, measured=65.0, torque=170.0)
    rig.run(0.5)
    assert rig.first is None
    rig.axis.alarms.raise_(Code.CTL_06, Reaction.QUICK_STOP, measured=95.0, torque=245.0)
    rig.run(0.1)
    assert rig.output.request is DriveRequest.QUICK_STOP
    assert rig.first.text.startswith("CTL-06 STOP · Holding torque 95 % of rated")


@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.010])
def test_each_phase_of_the_way_down_lasts_its_time(period_s):
    """The closing time of the brake although its contact is there at once; then three steps of torque and a look."""
    rig = Rig(config=settings(period_s=period_s))
    rig.power_up()
    rig.op(power=False)
    lasted = {}
    for _ in range(round(1.0 / period_s)):
        phase = rig.axis.power.phase
        lasted[phase] = lasted.get(phase, 0) + 1
        rig.step()
    power = rig.axis.settings.power
    closing, step = (rig.axis.settings.scans(t) for t in (power.brake_close_time_s, power.unload_step_s))
    # A phase ends in the scan that finds its time over, which already belongs to the next one.
    assert lasted[P.CLOSING] == pytest.approx(closing, abs=1)
    assert lasted[P.UNLOADING] == pytest.approx(4 * step, abs=1)


@pytest.mark.parametrize("phase", [P.CLOSING, P.UNLOADING, P.DISABLING])
def test_power_is_not_asked_for_while_the_axis_goes_off(phase):
    rig = powered()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is phase)
    refused = rig.axis.power_on()
    assert refused is not None
    assert refused.code is Code.PWR_04
    rig.run(1.0)
    assert rig.axis.is_off


def test_power_that_is_switched_off_at_standstill_shows_no_stopping():
    rig = powered()
    rig.op(power=False)
    states = set()
    while not rig.axis.is_off:
        states.add(rig.axis.state)
        rig.step()
    assert AxisState.STOPPING not in states
