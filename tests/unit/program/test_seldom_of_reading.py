"""What comes seldom in the reading, in the state that a rare event leaves it in; figures by hand."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest

from gantryctl.image import (
    DriveFeedback,
    DriveState,
    EncoderFlag,
    LinkFlag,
)
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import Feedback
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts
from unit.program.test_parts_of_feedback import ROTOR, Encoder
from unit.program.test_parts_of_reset import OFF

approx = pytest.approx


def test_a_drive_with_other_parameters_is_told_beside_a_complaint_of_the_bus():
    encoder = Encoder()
    encoder.scan(link=LinkFlag.SYNC_JITTER, changed="6065 is 5, was 6")
    assert encoder.codes == ["CAN-02", "DRV-09"]
    encoder = Encoder()
    encoder.scan(changed="6065 is 5, was 6")
    assert encoder.codes == ["DRV-09"]


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
@pytest.mark.parametrize(("periods", "codes"), [(1, ["ENC-14"]), (2, [])])
def test_a_turn_is_judged_from_one_scan_to_the_next(periods, codes, way):
    """0.05 deg/s and then the other way, a scan may turn 0.0154 round; nobody knows of a scan that was missed."""
    told = {"encoder_shows_twist": True, "speed_change_per_torque": rad(0.2)}
    encoder = Encoder(0.001, way * 0.05, state=OFF, monitors=told)
    encoder.speed_deg_s = -way * 0.05
    encoder.feedback._look, encoder.feedback.periods = True, periods
    encoder.scan()
    assert encoder.codes == codes


@BOTH
def test_a_position_away_from_its_speed_is_told_in_degrees(way):
    """Two steps of 0.02 deg and one of 0.01; 0.045 deg are permitted, and 1 ms in 0.3 s is forgotten."""
    encoder = Encoder()
    for step_deg in (0.02, 0.02, 0.01):
        encoder.scan(step_deg=way * step_deg)
    measured = encoder.alarms.active[Code.ENC_12].values["measured"]
    assert measured.values == {"value": approx(way * 0.05, abs=3e-4), "limit": approx(0.045)}


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


@BOTH
@PERIODS
@pytest.mark.parametrize("speed_deg_s", [1.0, 6.0])
def test_missed_scans_are_way_and_no_doubt_of_a_sound_encoder(period_s, speed_deg_s, way):
    """Every tenth scan is missed at random for 5 s; the reading is right to 0.0002 deg. A missed scan is 0.006 deg at
    6 deg/s and 1 ms, of which the sum of steps and speeds would have 0.045 after eight.
    """
    draw, off_deg = random.Random(1), 0.0
    encoder = Encoder(period_s, way * speed_deg_s)
    for _ in range(round(5.0 / period_s)):
        before, off_deg = off_deg, draw.gauss(0.0, 0.0002)
        encoder.feedback.periods = 2 if draw.random() < 0.1 else 1
        encoder.scan(step_deg=off_deg - before)
    assert encoder.codes == []


@BOTH
@pytest.mark.parametrize(("age", "deg_s"), [(29, 3.0), (30, 4.0)])
def test_a_speed_that_is_too_old_to_keep_the_last_one_is_taken_as_it_is(age, deg_s, way):
    """A speed that is told in a telegram of its own, 4 deg/s behind 3; 30 ms are what a reading may be old."""
    encoder = Encoder(speed_deg_s=way * 3.0)
    encoder.scan(speed_age_scans=age, speed_deg_s=way * 4.0)
    assert encoder.feedback.vel_rad_s == approx(way * rad(deg_s))


@BOTH
@pytest.mark.parametrize(("scans", "codes"), [(5, []), (6, ["ENC-14"])])
def test_for_five_scans_behind_a_late_telegram_a_speed_may_change_as_by_the_brake(scans, codes, way):
    """0.3 deg/s in 1 ms without torque: beyond 0.2 and 5.5 deg/s2, within 0.2 and 169 deg/s2."""
    encoder = Encoder(
        0.001,
        way * 3.0,
        monitors={"speed_change_max_rad_s2": rad(169.0), "speed_change_per_torque": rad(0.08)},
    )
    encoder.scan(age_scans=1)
    for _ in range(scans - 1):
        encoder.scan()
    encoder.speed_deg_s = way * 3.3
    encoder.scan()
    assert encoder.codes == codes


@pytest.mark.parametrize(("last", "codes"), [(99, ["ENC-03", "ENC-04"]), (100, ["ENC-03"])])
def test_three_bad_readings_within_a_tenth_of_a_second_are_a_fault(last, codes):
    """Of 1 ms: the first and the hundredth are 99 apart."""
    encoder = Encoder()
    for scan in range(last + 1):
        encoder.scan(encoder=EncoderFlag.CRC_ERROR if scan in (0, 50, last) else EncoderFlag.NONE)
    assert encoder.codes == codes


@BOTH
def test_a_scan_behind_a_flag_is_looked_at_like_any_other(way):
    """Off, 0.05 deg/s and then the other way: looked at closely a sign that turns, beyond 0.0154 deg/s."""
    told = {"encoder_shows_twist": True, "speed_change_per_torque": rad(0.2)}
    encoder = Encoder(0.001, way * 0.05, state=OFF, monitors=told)
    encoder.scan(encoder=EncoderFlag.WARNING)
    encoder.scan()
    encoder.speed_deg_s = -way * 0.05
    encoder.scan()
    assert encoder.codes == ["ENC-06"]


def test_a_drive_that_was_never_heard_had_no_torque():
    parts = Parts()
    feedback = Feedback(parts.settings, parts.alarms)
    for _ in range(2):
        feedback.scan(DriveFeedback(DriveState.UNKNOWN, 0.0, 0.0, 0.0, False, False, 0.0), 0.0)
        assert not feedback.energised
        assert not feedback.state_old


IN_ORDER = [
    (LinkFlag.BUS_DOWN | LinkFlag.BUS_OFF, "CAN-08"), (LinkFlag.RESTARTED, "DRV-11"),
    (LinkFlag.HEARTBEAT_LOST, "CAN-06"),
    (LinkFlag.NOT_OPERATIONAL, "CAN-13"), (LinkFlag.OTHER_MASTER, "CAN-12"), (LinkFlag.TWO_SENDERS, "CAN-14"),
    (LinkFlag.IO_LOST, "CAN-16"), (LinkFlag.WRONG_MODE, "DRV-06"), (LinkFlag.STALE_TARGET, "DRV-08"),
    (LinkFlag.LOCAL_CONTROL, "DRV-05"), (LinkFlag.OVERLOADED, "CAN-10"), (LinkFlag.WRONG_LENGTH, "CAN-04"),
    (LinkFlag.SYNC_UNSEEN, "CAN-01"),
]  # fmt: skip


@pytest.mark.parametrize(("before", "after"), list(pairwise(IN_ORDER)))
def test_of_two_flags_of_the_link_the_cause_is_told_and_not_what_follows_from_it(before, after):
    """Another master locks the axis, so it is told beside whatever else is wrong."""
    encoder = Encoder()
    encoder.scan(link=before[0] | after[0])
    assert encoder.codes == [before[1]] + ["CAN-12"] * (after[1] == "CAN-12")


@BOTH
def test_a_gear_untwists_for_30_ms_behind_its_torque(way):
    """100 N m against the change are gone for 12 ms, of which 75 are still twisted: 0.08 deg/s2 for each, and 0.222."""
    most = 0.222 + 0.08 * 75.1 * 0.004
    for share, wrong in ((0.995, False), (1.005, True)):
        encoder = Encoder(0.004, 3.0, monitors=ROTOR)
        for _ in range(100):
            encoder.scan(torque_act_nm=-way * 100.0)
        encoder.scan()
        encoder.scan()
        encoder.scan(speed_deg_s=3.0 + way * share * most)
        assert ("ENC-14" in encoder.codes) is wrong, share


@BOTH
@pytest.mark.parametrize(
    "between", [{"command_deg_s": 0.0}, {"age_scans": 1}], ids=["no command", "an old reading"]
)
def test_a_count_that_stands_in_two_parts_of_20_ms_is_not_frozen(between, way):
    """30 ms in a row are frozen, while a speed is commanded and every reading is new."""
    encoder = Encoder()
    for scan in range(41):
        said = between if scan == 20 else {}
        encoder.command_deg_s = way * said.get("command_deg_s", 0.2)
        encoder.scan(age_scans=said.get("age_scans", 0))
    assert encoder.codes == []


@BOTH
@pytest.mark.parametrize(
    ("command_deg_s", "speed_deg_s", "words", "value"),
    [(0.5, 0.0, Words.WHILE_COMMANDED, 0.5), (0.5, 0.8, Words.WHILE_READ, 0.8)],
)
def test_a_frozen_count_is_told_with_the_larger_of_command_and_speed_before(
    command_deg_s, speed_deg_s, words, value, way
):
    """Neither has a sign."""
    encoder = Encoder(0.001, way * speed_deg_s, monitors={"encoder_drift_max_rad": math.inf})
    encoder.speed_deg_s, encoder.command_deg_s = 0.0, way * command_deg_s
    encoder.after(encoder.scan, most_s=0.2)
    told = encoder.alarms.active[Code.ENC_02].values["measured"]
    assert told.words is words
    assert told.values["value"] == approx(value, rel=1e-3)


@BOTH
def test_an_angle_is_told_in_degrees_with_its_speed(way):
    parts = Parts()
    parts.turn(way * 2.0)
    assert parts.feedback.where(way * rad(30.0)).values == {"value": approx(way * 30.0)}
    told = parts.feedback.where_moving(way * rad(30.0))
    assert (told.values["value"], told.values["speed"]) == approx((way * 30.0, way * 2.0))


@BOTH
def test_a_speed_that_leaps_is_told_in_degrees(way):
    encoder = Encoder(speed_deg_s=way * 3.0, monitors=ROTOR)
    encoder.scan(speed_deg_s=way * 4.0)
    alarm = encoder.alarms.active[Code.ENC_14].values
    told = alarm["measured"].values
    assert (told["before"], told["value"]) == approx((way * 3.0, way * 4.0))
    assert alarm["limit"] == approx(0.2055, abs=1e-4)


@BOTH
def test_of_a_speed_and_a_step_that_cannot_be_the_speed_before_stands(way):
    """No number, and a step of 0.05 deg in a millisecond, 50 deg/s."""
    encoder = Encoder(speed_deg_s=way * 3.0)
    encoder.scan(step_deg=-way * 0.05, speed_deg_s=math.nan)
    assert encoder.feedback.vel_rad_s == approx(way * rad(3.0))


@BOTH
@pytest.mark.parametrize(("scans", "codes"), [(6, []), (7, ["ENC-14"])])
def test_for_five_scans_behind_a_late_telegram_a_speed_without_torque_may_turn_round(scans, codes, way):
    """By 0.05 deg/s each way, of which a scan may turn 0.0154 round."""
    told = {"encoder_shows_twist": True, "speed_change_per_torque": rad(0.2)}
    encoder = Encoder(0.001, way * 0.05, state=OFF, monitors=told)
    encoder.scan(age_scans=1, counts=encoder.feedback.counts)
    for _ in range(scans - 2):
        encoder.scan()
    assert encoder.codes == []
    encoder.speed_deg_s = -way * 0.05
    encoder.feedback._look = True
    encoder.scan()
    assert encoder.codes == codes


@BOTH
def test_a_count_that_stands_while_the_speed_goes_on_is_told_with_that_speed(way):
    """3 deg/s; 0.045 deg of its way are missing after 15 scans, before 30 ms of a count that stands."""
    encoder = Encoder(speed_deg_s=way * 3.0)
    encoder.command_deg_s = 0.0
    held = encoder.feedback.counts
    assert encoder.after(lambda: encoder.scan(counts=held), most_s=0.1) == approx(0.016, abs=0.0011)
    told = encoder.alarms.active[Code.ENC_02].values["measured"]
    assert (told.words, told.values["value"]) == (Words.WHILE_READ, approx(3.0))


def test_three_bad_readings_in_a_row_are_told_as_three_milliseconds():
    encoder = Encoder()
    for _ in range(3):
        encoder.scan(encoder=EncoderFlag.CRC_ERROR)
    assert encoder.alarms.active[Code.ENC_04].values["time_ms"] == approx(3.0)


def test_a_drive_that_never_followed_is_told_with_the_20_ms_that_it_had():
    encoder = Encoder()
    encoder.scan(link=LinkFlag.NEVER_FOLLOWED)
    assert encoder.alarms.active[Code.DRV_05].values["measured"].values == {"limit": approx(20.0)}


@BOTH
@pytest.mark.parametrize(("later", "codes"), [(1, []), (2, ["ENC-01"])])
def test_two_readings_behind_a_late_telegram_may_be_a_scan_late(later, codes, way):
    """6 deg/s, 0.06 deg in 10 ms, and a jump may be 0.04: what the first is behind by comes with the second."""
    encoder = Encoder(0.010, way * 6.0)
    encoder.scan(age_scans=1, counts=encoder.feedback.counts)
    encoder.scan(step_deg=-way * 0.06)
    for _ in range(later - 1):
        encoder.scan()
    encoder.scan(step_deg=way * 0.06)
    assert encoder.codes == codes
