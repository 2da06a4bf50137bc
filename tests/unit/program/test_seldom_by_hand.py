"""What comes seldom: each part alone, in the state that a rare event leaves it in; figures by hand."""

from __future__ import annotations

import math

import pytest

from gantryctl.image import DriveState, EncoderFlag, LinkFlag
from gantryctl.program.alarms.words import Words
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts
from unit.program.power_steps import P
from unit.program.rig import Rig, settings
from unit.program.test_parts_of_feedback import Encoder

approx = pytest.approx

# --- the reading ------------------------------------------------------------------------------------------------------


def test_a_drive_with_other_parameters_is_told_beside_a_complaint_of_the_bus():
    encoder = Encoder()
    encoder.scan(link=LinkFlag.SYNC_JITTER, changed="6065 is 5, was 6")
    assert encoder.codes == ["CAN-02", "DRV-09"]


def test_a_drive_that_booted_is_told_as_that_and_not_as_one_whose_heartbeat_is_late():
    """Both flags stand in one scan: whoever boots sends no heartbeat meanwhile, and has lost its parameters."""
    encoder = Encoder()
    encoder.scan(link=LinkFlag.RESTARTED | LinkFlag.HEARTBEAT_LOST)
    assert encoder.codes == ["DRV-11"]


@pytest.mark.parametrize("spoilt", ["in_doubt", "_old"])
def test_an_angle_in_doubt_or_too_old_is_told_as_not_known(spoilt):
    parts = Parts()
    setattr(parts.feedback, spoilt, True)
    assert parts.feedback.where(rad(10.0)) is Words.AT_UNKNOWN
    assert parts.feedback.where_moving(rad(10.0)) is Words.AT_UNKNOWN


@BOTH
@PERIODS
def test_what_the_torque_of_a_drives_own_ramp_has_twisted_turns_the_shaft_round(period_s, way):
    """Behind the fault reaction 96 N m have just gone: 0.1 deg/s2 by each N m of them and of 154 that the load swings
    by, for a scan. A speed that turns round by 2 % less is the gear, by 2 % more the reading.
    """
    most = 0.1 * (96.0 + 154.0) * period_s * way
    for share, turns in ((0.98, False), (1.02, True)):
        told = {"encoder_shows_twist": True, "speed_change_per_torque": rad(0.2)}
        encoder = Encoder(period_s, most * share, state=DriveState.FAULT_REACTION_ACTIVE, monitors=told)
        encoder.scan(torque_act_nm=96.0)
        encoder.said |= {"state": DriveState.FAULT}
        encoder.scan()
        encoder.speed_deg_s = -most * share
        encoder.feedback._look = True
        encoder.scan()
        assert encoder.codes == (["ENC-14"] if turns else []), share


@BOTH
def test_a_turn_in_the_ramp_of_a_fault_is_the_drives(way):
    told = {"encoder_shows_twist": True, "speed_change_per_torque": rad(0.2)}
    encoder = Encoder(0.004, way * 0.15, state=DriveState.FAULT_REACTION_ACTIVE, monitors=told)
    encoder.speed_deg_s = -way * 0.15
    encoder.feedback._look = True
    encoder.scan()
    assert encoder.codes == []


@BOTH
@pytest.mark.parametrize(("scans_between", "told"), [(1, True), (2, False), (100, False)])
def test_a_turn_over_two_scans_is_one_of_two_scans_in_a_row(scans_between, told, way):
    """0.07 deg/s gone and 0.07 the other way: two scans in a row may turn 0.0308 deg/s round, a pause any speed."""
    parts = Parts(monitors={"encoder_shows_twist": True, "speed_change_per_torque": rad(0.2)})
    parts.alarms.scan = 100
    parts.feedback._judge_turn(way * rad(0.07), 0.0)
    parts.alarms.scan += scans_between
    parts.feedback._judge_turn(0.0, -way * rad(0.07))
    assert parts.codes == (["ENC-14"] if told else [])


@BOTH
def test_a_count_that_is_no_number_leaves_the_last_one(way):
    encoder = Encoder(speed_deg_s=way * 3.0)
    before = encoder.feedback.counts
    encoder.scan(counts=math.nan)
    assert encoder.feedback.counts == before
    assert encoder.codes == ["CTL-02"]
    assert encoder.feedback.in_doubt


@BOTH
def test_behind_late_telegrams_a_speed_that_is_older_than_its_position_is_not_taken(way):
    """The position is a scan old, then fresh with a speed of two scans ago: what was told last stands."""
    encoder = Encoder(speed_deg_s=way * 3.0)
    encoder.scan(age_scans=1)
    encoder.scan(speed_age_scans=2, speed_deg_s=way * 4.0)
    assert encoder.feedback.vel_rad_s == approx(way * rad(3.0))


@BOTH
def test_what_a_position_has_gone_away_from_its_speed_ends_with_a_scan_that_was_missed(way):
    """0.04 deg in steps of 0.02, a missed scan at 6 deg/s, and 0.04 deg once more; 0.045 deg in a row are the limit."""
    for missed, codes in ((True, []), (False, ["ENC-12"])):
        encoder = Encoder(0.010, way * 6.0)
        for step_deg in (0.02, 0.02, 0.0, 0.02, 0.02):
            encoder.feedback.periods = 2 if missed and not step_deg else 1
            encoder.scan(step_deg=way * step_deg)
        assert encoder.codes == codes


@pytest.mark.parametrize(("last", "codes"), [(99, ["ENC-03", "ENC-04"]), (100, ["ENC-03"])])
def test_three_bad_readings_within_a_tenth_of_a_second_are_a_fault(last, codes):
    """Of 1 ms: the first and the hundredth are 99 apart."""
    encoder = Encoder()
    for scan in range(last + 1):
        encoder.scan(encoder=EncoderFlag.CRC_ERROR if scan in (0, 50, last) else EncoderFlag.NONE)
    assert encoder.codes == codes


# --- the axis ---------------------------------------------------------------------------------------------------------


def test_the_lamp_is_on_from_the_first_scan_of_power_to_the_last():
    """While torque is proven behind the closed brake nothing follows yet."""
    rig = Rig()
    rig.step()
    assert not rig.output.lamp
    rig.op(power=True)
    while rig.axis.power.phase is not P.ON:
        rig.step()
        assert rig.output.lamp, rig.axis.power.phase
    rig.op(power=False)
    while not rig.axis.is_off:
        assert rig.output.lamp, rig.axis.power.phase
        rig.step()
    assert not rig.output.lamp


@BOTH
@pytest.mark.parametrize("closed", [False, True])
def test_a_count_that_stands_under_torque_while_the_brake_closes_is_frozen_as_long_as_it_is_open(closed, way):
    """40 N m more than the load needs, 15 are permitted; behind the brake the torque turns nothing."""
    rig = Rig(config=settings(monitors={"torque_still_max_nm": 15.0}))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.CLOSING, 0.1)
    rig.spoil = lambda drive: drive._replace(torque_act_nm=way * 40.0, brake_open=not closed)
    rig.run(0.1)
    assert rig.axis.power.phase is (P.CLOSING if closed else P.TORQUE_OFF)
    assert rig.codes == ([] if closed else ["ENC-02"])
