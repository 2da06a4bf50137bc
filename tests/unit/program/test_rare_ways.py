"""Ways of power and monitors that a sound machine never takes."""

import math

import pytest

from gantryctl.errors import UsageError
from gantryctl.image import DigitalInputs, DriveRequest, DriveState
from gantryctl.program import Code, Reaction
from gantryctl.program.alarms.words import Words
from gantryctl.program.blocks import DigitalCamSwitch, ReadActualPosition, ReadStatus, Stop
from gantryctl.units import rad
from unit.program.parts import BOTH
from unit.program.power_steps import P, slip
from unit.program.rig import RATIO, Rig, moving_rig, settings


@pytest.mark.parametrize("reaction", [Reaction.HOLD, Reaction.QUICK_STOP, Reaction.TORQUE_OFF])
def test_torque_off_is_not_made_weaker_nor_begun_again(reaction):
    """The feedback is in doubt: nothing that comes later gives torque back, or more time."""
    rig = moving_rig()
    rig.axis.alarms.raise_(Code.CTL_05, Reaction.TORQUE_OFF, measured=1.0, command=2.0, limit=0.5)
    speed = rig.drive.vel_rad_s

    def turns_on(drive):
        rig.drive.pos_motor_rad += speed * rig.period_s
        return drive._replace(vel_act_rad_s=speed)

    rig.spoil = turns_on
    start = rig.scan
    rig.step()
    assert rig.axis.power.phase is P.TORQUE_OFF
    rig.run(2.0)
    rig.axis.alarms.raise_(Code.BRK_03, reaction, measured=0.03, limit=0.02)
    while "BRK-11" not in rig.codes:
        rig.step()
        assert rig.output.request is DriveRequest.DISABLE
        assert not rig.output.brake_open
        assert rig.scan - start < 4000
    # The brake has not stopped it within 3 s of the first alarm, not of the second.
    assert (rig.scan - start) * rig.period_s == pytest.approx(3.0, abs=0.01)


def test_a_quick_stop_whose_speed_nobody_reads_ends_in_torque_off():
    rig = moving_rig()
    frozen, age = rig.drive.read(), 0

    def silent(drive):
        nonlocal age
        age += 1
        return frozen._replace(age_scans=age, speed_age_scans=age)

    rig.spoil = silent
    rig.until(lambda: rig.axis.power.phase is P.QUICK_STOPPING, 0.1)
    start = rig.scan
    rig.until(lambda: rig.axis.power.phase is P.TORQUE_OFF, 3.0)
    # 6 deg/s at 5.5 deg/s2 are 1.09 s, and 0.06 s for the reaction.
    assert (rig.scan - start) * rig.period_s == pytest.approx(1.15, abs=0.01)
    assert not rig.output.brake_open
    rig.run(2.0)
    assert rig.axis.power.phase is P.OFF, "without an angle the brake has 1.5 s"


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
def test_a_load_that_falls_while_the_brake_opens_is_caught(way):
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.RELEASING)
    slip(rig, way * 0.021)
    rig.run(0.3)
    assert rig.codes[0] == "BRK-10"
    assert not rig.output.brake_open


def test_no_power_is_asked_for_while_the_torque_holds_a_load_that_slipped():
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING)
    rig.run(0.06)
    slip(rig, 0.025)
    rig.run(0.1)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    rig.op(power=True)
    assert "still being switched off" in rig.refused()
    rig.run(0.1)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    assert not rig.output.brake_open


@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.010])
def test_a_brake_that_closes_at_standstill_is_told_after_its_time(period_s):
    rig = Rig(config=settings(period_s=period_s))
    rig.power_up()
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    start = rig.scan
    rig.until(lambda: bool(rig.codes), 1.0)
    assert rig.codes == ["BRK-06"]
    assert (rig.scan - start) * period_s == pytest.approx(0.3, abs=1e-9)
    assert rig.axis.alarms.active["BRK-06"].values["time_ms"] == pytest.approx(300.0)


def test_a_drive_that_stays_enabled_is_told():
    rig = Rig()
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.DISABLING)
    rig.spoil = lambda drive: drive._replace(state=DriveState.OPERATION_ENABLED)
    start = rig.scan
    rig.until(lambda: bool(rig.codes), 3.0)
    assert rig.codes == ["DRV-03"]
    assert (rig.scan - start) * rig.period_s == pytest.approx(0.2, abs=0.002)
    assert rig.output.request is DriveRequest.DISABLE


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["forward", "back"])
def test_a_short_excess_of_speed_is_forgotten(way):
    """Overspeed counts scans in a row: 15 ms twice are not 20 ms once."""
    rig = Rig(config=settings(monitors={"velocity_deviation_rad_s": math.inf}))
    rig.power_up()
    rig.move(way * 100.0, 6.0)
    rig.run(2.0)
    more = way * rad(0.65) * RATIO
    for _ in range(2):
        rig.spoil = lambda drive: drive._replace(vel_act_rad_s=drive.vel_act_rad_s + more)
        rig.run(0.015)
        rig.spoil = None
        rig.run(0.005)
    assert rig.codes == []


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
def test_a_short_push_out_of_the_standstill_window_is_forgotten(way):
    rig = Rig()
    rig.power_up()
    law, off_rad = rig.axis._law, 0.0

    def shifted(*given):
        vel, pos, error = law(*given)
        return vel, pos, error + off_rad

    rig.axis._law = shifted
    for _ in range(2):
        off_rad = way * rad(0.025)
        rig.run(0.007)
        off_rad = 0.0
        rig.run(0.003)
    assert "CTL-13" not in rig.codes


def test_no_power_with_an_open_emergency_stop():
    rig = Rig()
    rig.drive.inputs = DigitalInputs(estop_ok=False, estop_ok_2=False)
    rig.run(0.05)
    rig.op(power=True)
    rig.run(0.1)
    assert rig.axis.power.phase is P.OFF
    assert rig.axis.refusal is not None
    assert not rig.output.brake_open


def test_blocks_that_are_not_enabled_say_so_and_hold_nothing():
    rig = Rig(at_deg=20.0)
    rig.power_up()
    position, status, stop = (block(rig.axis) for block in (ReadActualPosition, ReadStatus, Stop))
    position(enable=True)
    assert position.value == pytest.approx(rad(20.0), abs=1e-6)
    position(enable=False)
    status(enable=False)
    stop(execute=False)
    assert not position.valid
    assert not status.valid
    assert rig.axis.motion.stop_command is None


@pytest.mark.parametrize(
    "wrong", [{"on_s": math.nan}, {"off_s": math.inf}, {"hysteresis_rad": -0.1}, {"hysteresis_rad": math.pi}]
)
def test_a_cam_switch_refuses_what_it_cannot_keep(wrong):
    rig = Rig()
    with pytest.raises(UsageError, match="a cam switch needs finite compensations"):
        DigitalCamSwitch(rig.axis, ((0.0, 1.0),), **wrong)


def test_halt_is_obeyed_while_a_warning_forbids_the_next_motion():
    """BRK-06 lets the present motion go on, and forbids another until it is reset; a person may end it at any time."""
    rig = moving_rig()
    rig.axis.alarms.raise_(Code.BRK_06, measured=Words.OPEN, command=Words.CLOSED, time_ms=400.0)
    rig.op(halt=True)
    rig.run(1.0)
    # on the normal ramp of this axis, 4 deg/s2; a scan more or less
    assert rig.vel_deg_s == pytest.approx(6.0 - 4.0, abs=0.05)
    rig.run(1.0)
    assert rig.vel_deg_s == 0.0
    rig.op(halt=False)
    rig.op(move=True, target_rad=rad(10.0), speed_rad_s=rad(2.0))
    assert rig.refused()
    assert rig.vel_deg_s == 0.0


def test_no_torque_stays_on_a_reading_in_doubt_whatever_the_next_alarm_asks_for():
    rig = moving_rig()
    rig.axis.feedback.in_doubt = True
    rig.op(quick_stop=True)
    assert rig.axis.power.phase is P.TORQUE_OFF
    assert rig.output.request is DriveRequest.DISABLE


def test_an_alarm_that_ends_motions_leaves_a_quick_stop_as_it_is():
    rig = moving_rig()
    rig.op(quick_stop=True)
    rig.run(0.1)
    rig.axis.alarms.raise_(Code.INT_07, measured="a test")
    rig.run(0.1)
    assert rig.axis.power.phase is P.QUICK_STOPPING


def test_a_stop_by_the_brake_ends_without_its_contact_when_the_axis_rests_and_the_time_is_over():
    """150 ms to close and 300 ms for the contact; until then nobody says that it is shut."""
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    start = rig.scan
    rig.until(lambda: rig.axis.is_off, 2.0)
    assert (rig.scan - start) * rig.period_s == pytest.approx(0.450, abs=0.005)
    rig.run(0.5)
    assert "BRK-06" in rig.codes


@BOTH
def test_a_load_that_the_brake_does_not_stop_is_told_with_a_speed_without_a_sign(way):
    rig = moving_rig(at_deg=0.0 if way > 0.0 else 60.0)
    assert math.copysign(1.0, rig.vel_deg_s) == way
    speed = rig.drive.vel_rad_s

    def slides(drive):
        rig.drive.pos_motor_rad += speed * rig.period_s
        return drive._replace(vel_act_rad_s=speed)

    rig.spoil = slides
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(3.1)
    assert rig.axis.alarms.active[Code.BRK_11].values["measured"] == pytest.approx(6.0, abs=0.01)


def test_a_brake_contact_that_opens_again_counts_anew():
    rig = moving_rig()
    for _ in range(3):
        rig.spoil = lambda drive: drive._replace(brake_open=False)
        rig.run(0.25)
        rig.spoil = None
        rig.run(0.01)
    assert rig.codes == []


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_torque_against_the_motion_is_asked_about_at_rest_only(way):
    """In motion the resonance of the load may turn the shaft against it."""
    parts = {"velocity_deviation_rad_s": math.inf, "following_error_base_rad": math.inf}
    rig = moving_rig(at_deg=0.0 if way > 0.0 else 60.0, speed_deg_s=3.0, config=settings(monitors=parts))
    sign = math.copysign(1.0, rig.vel_deg_s)
    more = 0.0

    def swings(drive):
        nonlocal more
        more += 0.01
        return drive._replace(
            vel_act_rad_s=drive.vel_act_rad_s + sign * rad(min(more, 0.3)) * RATIO,
            torque_act_nm=-sign * 340.0,
        )

    rig.spoil = swings
    rig.run(0.1)
    assert "ENC-12" not in rig.codes
