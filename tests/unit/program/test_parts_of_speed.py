"""Speeds that cannot be, and a sign that turns without torque, each side of its limit; figures by hand."""

import math
from itertools import pairwise

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts
from unit.program.test_parts_of_feedback import OFF, Encoder

approx = pytest.approx

# --- a speed that cannot be -------------------------------------------------------------------------------------------


@BOTH
@PERIODS
@pytest.mark.parametrize("absurd_deg_s", [1e300, -1e300, math.nan, math.inf])
def test_in_place_of_an_impossible_speed_the_position_tells_it(absurd_deg_s, period_s, way):
    """A load that sinks with 0.1 deg/s is seen to move; one alarm, and none of the sum with such a speed."""
    encoder = Encoder(period_s)
    encoder.speed_deg_s = way * 0.1
    encoder.scan(speed_deg_s=absurd_deg_s)
    assert encoder.feedback.vel_rad_s == approx(way * rad(0.1), rel=0.02)
    encoder.scan(speed_deg_s=absurd_deg_s, counts=math.nan)
    assert encoder.feedback.vel_rad_s == approx(way * rad(0.1), rel=0.02), "that of before"
    assert encoder.codes in (["ENC-14", "CTL-02"], ["CTL-02"])


@BOTH
def test_the_speed_by_a_position_over_missed_scans_is_that_of_each_of_them(way):
    encoder = Encoder()
    encoder.speed_deg_s = way * 0.1
    encoder.scan()
    encoder.feedback.periods = 4
    encoder.scan(speed_deg_s=math.nan)
    assert encoder.feedback.vel_rad_s == approx(way * rad(0.1), rel=0.01)


# --- a sign that turns without torque ---------------------------------------------------------------------------------


def without_torque(period_s, torque_nm, speeds_deg_s, **monitors):
    """Codes after these speeds, one a scan, behind a drive that gave `torque_nm` in its last scan with torque."""
    told = {"speed_change_per_torque": rad(0.2), "encoder_shows_twist": True} | monitors
    encoder = Encoder(period_s, speeds_deg_s[0], monitors=told)
    encoder.scan(torque_act_nm=torque_nm)
    encoder.said |= {"state": OFF}
    encoder.scan()
    assert encoder.codes == []
    for encoder.speed_deg_s in speeds_deg_s[1:]:
        # A change of less than 0.2 deg/s is not looked at.
        encoder.feedback._look = True
        encoder.scan()
    return encoder.codes


@BOTH
@pytest.mark.parametrize(("period_s", "torque_nm"), [(0.004, 96.0), (0.004, -96.0), (0.010, 46.0)])
def test_without_torque_only_the_twisted_gear_turns_the_shaft_round(period_s, torque_nm, way):
    """0.2 deg/s2 by each N m: what the drive gave last and 0.4 of 385 N m, for half of a scan: 0.1 and 0.2 deg/s."""
    most = 0.1 * (abs(torque_nm) + 154.0) * period_s * way
    for speeds, turns in (
        ((1.02, -1.02), True), ((1.02, -0.98), False), ((0.98, -1.02), False), ((1.02, 0.0), False),
        # A sign that turns in the middle of a scan: over two scans twice as much.
        ((2.04, 0.5, -2.04), True), ((2.04, -0.5, -2.04), True), ((2.04, 0.5, -1.96), False),
        ((1.96, 0.5, -2.04), False), ((2.04, 0.5, 0.5, -2.04), False), ((-2.04, -5.1), False),
    ):  # fmt: skip
        codes = without_torque(period_s, torque_nm, [most * each for each in speeds])
        assert codes == (["ENC-14"] if turns else []), speeds


def test_an_encoder_of_coarse_steps_may_turn_round_by_what_its_speed_may_change_by():
    most = 0.1 * 154.0 * 0.004 + 0.2
    for share, turns in ((0.98, False), (1.02, True)):
        told = {"encoder_shows_twist": False, "speed_change_base_rad_s": rad(0.2)}
        assert bool(without_torque(0.004, 0.0, [most * share, -most * share], **told)) is turns


@BOTH
@pytest.mark.parametrize(("speeds", "limit"), [((0.05, -0.04), 0.0308), ((0.07, 0.0, -0.07), 0.0616)])
def test_a_sign_that_turns_is_told_with_what_may_turn_round_of_it(speeds, limit, way):
    """154 N m turn 0.0154 deg/s round in a scan of 1 ms: a change of twice as much; over two scans four times."""
    parts = Parts(monitors={"encoder_shows_twist": True, "speed_change_per_torque": rad(0.2)})
    for scan, (before, now) in enumerate(pairwise(speeds)):
        parts.alarms.scan = 100 + scan
        parts.feedback._judge_turn(way * rad(before), way * rad(now))
    values = parts.alarms.active[Code.ENC_14].values
    assert values["limit"] == approx(limit)
    assert values["measured"].values == approx({"before": way * speeds[0], "value": way * speeds[-1]})


@BOTH
def test_a_speed_that_comes_with_the_jump_does_not_explain_it(way):
    """At rest, then 0.04 deg within 1 ms and 20 deg/s: 0.022 deg may lie beyond the speed of before, not of now."""
    encoder = Encoder()
    encoder.scan(step_deg=way * 0.04, speed_deg_s=way * 20.0)
    assert "ENC-01" in encoder.codes
