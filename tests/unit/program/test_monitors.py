"""Monitors of the motion: what they see, how soon, which reaction, in which words. Feedback is spoiled."""

import pytest

from gantryctl.image import DriveRequest
from gantryctl.program import AxisState, Reaction
from gantryctl.units import rad
from unit.program.rig import RATIO, Rig, moving_rig, settings
from unit.program.spoiling import POSITION_ALONE, counts, expect

# --- following error, speed, torque ---------------------------------------------------------------


@pytest.mark.parametrize("speed_deg_s", [0.6, 6.0])
def test_b3_following_error_band_grows_with_speed(speed_deg_s):
    band = 0.03 + 0.012 * speed_deg_s
    rig = moving_rig(speed_deg_s=speed_deg_s)
    lag = {"deg": 0.0}

    def lags(drive):
        lag["deg"] = min(lag["deg"] + 0.001, 0.98 * band)
        return drive._replace(pos_act_counts=drive.pos_act_counts - counts(lag["deg"]))

    rig.spoil = lags
    rig.run(1.0)
    assert "CTL-03" not in rig.codes


def lagging(rig, per_scan_deg):
    """The reading falls behind by more every scan, slowly enough not to be a jump."""
    lag = {"deg": 0.0}

    def spoil(drive):
        lag["deg"] += per_scan_deg
        return drive._replace(pos_act_counts=drive.pos_act_counts - counts(lag["deg"]))

    rig.spoil = spoil


def test_b3_following_error_warns_then_stops():
    rig = moving_rig(config=settings(monitors=POSITION_ALONE))
    lagging(rig, 0.004)
    rig.until(lambda: rig.codes, 0.1)
    assert rig.codes == ["CTL-12"], "half the band is the warning"
    assert "warning at 0.051 deg, stop at 0.102 deg" in rig.axis.alarms.active["CTL-12"].text
    rig.until(lambda: rig.first is not None, 0.1)
    assert rig.first.code == "CTL-03"
    assert rig.first.reaction is Reaction.QUICK_STOP, "the drive obeys its speed command"
    assert "limit 0.102 deg at 6.00 deg/s" in rig.first.text


def test_b3_following_error_of_a_drive_that_does_not_obey_is_torque_off():
    rig = moving_rig()
    lagging(rig, 0.01)
    inner = rig.spoil
    rig.spoil = lambda drive: inner(drive)._replace(vel_act_rad_s=drive.vel_act_rad_s - rad(0.7) * RATIO)
    rig.until(lambda: rig.first is not None, 0.1)
    assert rig.first.reaction is Reaction.TORQUE_OFF


def test_b3_a_short_excess_is_no_alarm():
    """10 ms of it are: nine readings above the band are not, eleven are."""
    for scans, stops in ((9, False), (11, True)):
        rig = moving_rig()
        law = rig.axis._law
        rig.axis._law = shifted(law, rad(0.11))
        rig.run(scans * 0.001)
        rig.axis._law = law
        rig.run(0.05)
        assert ("CTL-03" in rig.codes) == stops


def test_b4_overspeed():
    rig = moving_rig(config=settings(monitors={"velocity_deviation_rad_s": 10.0}))  # else that is first
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=rad(6.65) * RATIO)
    expect(rig, "CTL-04", Reaction.QUICK_STOP, 0.021, "Speed 6.65 deg/s, limit 6.60 deg/s")


def test_b4_far_too_fast_is_torque_off():
    rig = moving_rig(config=settings(monitors={"velocity_deviation_rad_s": 10.0} | POSITION_ALONE))
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=-rad(7.3) * RATIO)
    expect(rig, "CTL-04", Reaction.TORQUE_OFF, 0.021)


def test_b5_moves_against_command():
    rig = moving_rig(config=settings(monitors=POSITION_ALONE))
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=-drive.vel_act_rad_s)
    expect(rig, "CTL-05", Reaction.TORQUE_OFF, 0.021, "Speed -6.00 deg/s while 6.00 deg/s was commanded")


def test_b5_from_standstill_within_class_m0():
    rig = Rig()
    rig.power_up()
    start = rig.drive.pos_rad
    write = rig.drive.write
    rig.drive.write = lambda out: write(
        out._replace(vel_cmd_rad_s=-out.vel_cmd_rad_s)
    )  # the drive's sign is wrong
    rig.move(50.0)
    rig.until(lambda: rig.first is not None, 2.0)
    assert rig.first.reaction is Reaction.TORQUE_OFF
    assert abs(rig.drive.pos_rad - start) < rad(0.35)


def test_velocity_deviation_for_a_moment_is_nothing():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(vel_act_rad_s=drive.vel_act_rad_s + rad(0.55) * RATIO)
    rig.run(0.019)
    rig.spoil = None
    rig.run(0.1)
    assert not rig.codes


def test_b8_torque_saturated_while_the_error_grows():
    rig = moving_rig()
    lagging(rig, 0.0002)
    inner = rig.spoil
    rig.spoil = lambda drive: inner(drive)._replace(torque_limited=True)
    expect(rig, "CTL-07", Reaction.TORQUE_OFF, 0.201, "Torque limit reached for 200 ms", "grew to 0.0")


def test_torque_limit_alone_is_no_fault():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(torque_limited=True)
    rig.run(1.0)
    assert not rig.codes


def test_overload_warns():
    rig = moving_rig()
    rig.spoil = lambda drive: drive._replace(overload=0.93)
    rig.run(0.1)
    assert rig.codes == ["THM-01"]
    assert "93 % of its thermal limit" in rig.axis.alarms.active["THM-01"].text


# --- standing -------------------------------------------------------------------------------------


def test_standstill_lost():
    rig = Rig()
    rig.power_up()
    offset = {"deg": 0.0}

    def creeps(drive):
        offset["deg"] += 0.0005
        return drive._replace(pos_act_counts=drive.pos_act_counts + counts(offset["deg"]))

    rig.spoil = creeps
    rig.until(lambda: rig.first is not None, 0.5)
    assert rig.first.code == "CTL-13"
    assert "window 0.0200 deg" in rig.first.text
    assert rig.output.request is DriveRequest.QUICK_STOP


def test_in_position_after_dwell_and_done_with_it():
    rig = Rig()
    rig.power_up()
    rig.move(5.0)
    rig.until(lambda: rig.axis.virtual.at_rest)
    arrived = rig.scan
    assert rig.program.move.busy
    rig.until(lambda: rig.program.move.done)
    assert (rig.scan - arrived) * rig.period_s == pytest.approx(0.2, abs=0.0021)
    assert rig.axis.in_position


def test_b12_not_in_position_is_told():
    rig = Rig()
    rig.power_up()
    rig.move(5.0)
    rig.until(lambda: rig.axis.virtual.vel_ref_rad_s > 0.0)
    rig.axis._law = shifted(rig.axis._law, rad(0.008))
    rig.until(lambda: not rig.program.move.busy, 10.0)
    assert rig.program.move.error
    assert rig.program.move.error_id == "CTL-11"
    assert "Not in position 3.0 s after" in rig.axis.alarms.active["CTL-11"].text
    assert "error 0.0080 deg, window 0.0050 deg" in rig.axis.alarms.active["CTL-11"].text
    assert not rig.axis.in_position
    assert rig.axis.state is AxisState.STANDSTILL, "a warning: power stays on"


def shifted(law, error_rad):
    """The position law with a following error that stays."""

    def scan(pos, vel, c):
        vel_cmd, act, _ = law(pos, vel, c)
        return vel_cmd, act, error_rad

    return scan
