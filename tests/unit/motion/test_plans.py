"""Plans against figures computed elsewhere, and the refusals."""

import json
import math
from pathlib import Path

import pytest

from gantryctl.errors import CommandRefused
from gantryctl.motion import MotionLimits, SetPoint, hold, plan_move, plan_stop, plan_velocity, stop_point
from gantryctl.units import deg, rad

EXPECTED = json.loads((Path(__file__).parents[2] / "data" / "expected.json").read_text())

A = 450.0 / 1144.0  # deg/s2: 450 at the motor
PAPER = MotionLimits(rad(6.0), rad(A), rad(A))


def limits_deg(vel: float, acc: float, dec: float, jerk: float = math.inf) -> MotionLimits:
    return MotionLimits(rad(vel), rad(acc), rad(dec), rad(jerk))


@pytest.mark.parametrize("way_deg", [5, 10, 15, 20, 90, 180, 360])
def test_trapezoid_takes_the_reference_time(way_deg: int) -> None:
    expected = EXPECTED["1_sizing"][f"t_trap_{way_deg}deg_s"]
    plan = plan_move(SetPoint(0.0), rad(way_deg), PAPER)
    assert plan.duration == pytest.approx(expected["value"], rel=expected["rtol"])


@pytest.mark.parametrize(
    ("key", "way_deg", "limits"),
    [
        ("ruckig_d90_V6_a0.67_j1.34_s", 90, limits_deg(6, 0.67, 0.67, 1.34)),
        ("ruckig_d180_V6_a0.67_j1.34_s", 180, limits_deg(6, 0.67, 0.67, 1.34)),
        ("ruckig_d20_V6_a0.67_j1.34_s", 20, limits_deg(6, 0.67, 0.67, 1.34)),
        ("ruckig_d180_V6_a0.39336_j0.7868_s", 180, limits_deg(6, A, A, 0.7868)),
        (
            "double_S_180deg_V6_a0.39336_j0.39336_s",
            180,
            limits_deg(6, A, A, 0.39336),
        ),
    ],
)
def test_jerk_limited_takes_the_reference_time(key: str, way_deg: float, limits: MotionLimits) -> None:
    expected = EXPECTED["6_profiles"][key]
    plan = plan_move(SetPoint(0.0), rad(way_deg), limits)
    assert plan.duration == pytest.approx(expected["value"], rel=expected["rtol"])


GENTLE = limits_deg(6, 0.67, 0.67, 1.34)._replace(end_dec_rad_s2=rad(0.2), end_jerk_rad_s3=rad(0.15))


@pytest.mark.parametrize("way_deg", [90.0, -90.0, 5.0])
def test_a_gentle_end_is_the_last_piece_of_a_move(way_deg: float) -> None:
    """By hand: 0.2 deg/s2 released by 0.15 deg/s3 last 4/3 s, from 0.1333 deg/s on, and take 0.0593 deg."""
    plan = plan_move(SetPoint(0.0), rad(way_deg), GENTLE)
    way = math.copysign(1.0, way_deg)
    begin = plan.duration - 4.0 / 3.0
    pos, vel, acc = plan.sample(begin)
    assert deg(pos) == pytest.approx(way_deg - way * 0.0592593, abs=1e-6)
    assert deg(vel) == pytest.approx(way * 0.1333333, abs=1e-6)
    assert deg(acc) == pytest.approx(-way * 0.2, abs=1e-6)
    assert plan.sample(plan.duration) == (rad(way_deg), 0.0, 0.0)
    # The same end at 1.34 deg/s3 takes 0.1493 s, and what it slows down less 0.1184/0.67 s, or more below full speed.
    plain = plan_move(SetPoint(0.0), rad(way_deg), limits_deg(6, 0.67, 0.67, 1.34))
    longer = plan.duration - plain.duration
    assert 4.0 / 3.0 - 0.1493 - 1.5 * 0.1768 < longer < 4.0 / 3.0 - 0.1493


@pytest.mark.parametrize(("way_deg", "part"), [(0.05, 0.5), (0.006, 0.25), (0.001, 0.125)])
def test_a_short_move_has_a_smaller_gentle_end(way_deg: float, part: float) -> None:
    plan = plan_move(SetPoint(0.0), rad(way_deg), GENTLE)
    assert plan.pos_end == rad(way_deg)
    assert deg(plan.acc[-1]) == pytest.approx(-0.2 * part, rel=1e-6)
    assert deg(plan.jerk[-1]) == pytest.approx(0.15)


@pytest.mark.parametrize("dec_deg_s2", [0.1, 0.19, 0.3])
def test_a_gentle_end_is_no_harder_than_the_deceleration_of_its_motion(dec_deg_s2: float) -> None:
    """A program may ask for less than the end of the machine, 0.2 deg/s2."""
    plan = plan_move(SetPoint(0.0), rad(20.0), GENTLE._replace(dec_rad_s2=rad(dec_deg_s2)))
    times = [0.001 * k for k in range(int(1000.0 * plan.duration))]
    assert min(deg(plan.sample(t)[2]) for t in times) == pytest.approx(-dec_deg_s2, rel=1e-6)
    assert deg(plan.acc[-1]) == pytest.approx(-min(dec_deg_s2, 0.2), rel=1e-6)


def test_a_move_too_short_for_a_gentle_end_and_a_stop_have_none() -> None:
    assert deg(plan_move(SetPoint(0.0), rad(1e-5), GENTLE).jerk[-1]) == pytest.approx(1.34)
    stop = plan_stop(SetPoint(0.0, rad(6.0)), GENTLE)
    assert deg(stop.jerk[-1]) == pytest.approx(1.34)


def test_ninety_degrees_peak_at_five_point_nine_five() -> None:
    plan = plan_move(SetPoint(0.0), rad(90.0), PAPER)
    _, vel, _ = plan.sample(plan.duration / 2.0)
    assert deg(vel) == pytest.approx(5.95, abs=0.0005)


def test_start_and_end_are_exact() -> None:
    plan = plan_move(SetPoint(rad(3.0)), rad(-84.5), PAPER)
    assert plan.sample(0.0)[:2] == (rad(3.0), 0.0)
    assert plan.sample(plan.duration) == (rad(-84.5), 0.0, 0.0)
    assert plan.sample(plan.duration + 1000.0) == (rad(-84.5), 0.0, 0.0)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_plan_that_begins_as_the_axis_starts_has_no_step_of_the_acceleration(direction: float) -> None:
    """The first instant of a motion, without speed yet: every plan goes on from its acceleration."""
    start, limits = SetPoint(0.0, 0.0, direction * rad(0.2)), limits_deg(6.0, 0.67, 0.67, 1.34)
    for plan in (
        plan_move(start, direction * 1.0, limits),
        plan_velocity(start, direction * rad(3.0), limits),
        plan_stop(start, limits),
    ):
        assert plan.sample(0.0)[2] == direction * rad(0.2)


def test_hold_and_a_move_to_where_it_is_stand_still() -> None:
    for plan in (hold(0.25), plan_move(SetPoint(0.25), 0.25, PAPER)):
        assert plan.duration == 0.0
        assert plan.sample(0.0) == (0.25, 0.0, 0.0)
        assert plan.extremes() == (0.25, 0.25)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_deceleration_is_what_slows_down_in_both_directions(direction: float) -> None:
    # From 6 deg/s at 2 deg/s2: 3 s and 9 deg, whatever the way.
    limits = limits_deg(6.0, 0.4, 2.0)
    start = SetPoint(0.0, direction * rad(6.0))
    plan = plan_stop(start, limits)
    assert plan.duration == pytest.approx(3.0, rel=1e-12)
    assert deg(plan.pos_end) == pytest.approx(direction * 9.0, rel=1e-12)
    assert stop_point(start, limits) == plan.pos_end


def test_a_target_behind_the_stop_point_is_reached_through_rest() -> None:
    limits = limits_deg(6.0, 0.4, 2.0)
    plan = plan_move(SetPoint(0.0, rad(6.0)), rad(1.0), limits)
    # 9 deg to stop, then 8 deg back from rest: sqrt(2 d (a + b) / (a b)) for a triangle.
    back_s = math.sqrt(2.0 * 8.0 * (0.4 + 2.0) / (0.4 * 2.0))
    assert plan.duration == pytest.approx(3.0 + back_s, rel=1e-9)
    assert deg(plan.extremes()[1]) == pytest.approx(9.0, rel=1e-9)
    assert min(plan.acc) == pytest.approx(-rad(2.0)), "slowing down on the way out"
    assert plan.sample(3.0 + 0.1)[2] == pytest.approx(-rad(0.4)), "speeding up on the way back"


def test_a_lower_speed_slows_down_and_keeps_the_target() -> None:
    plan = plan_move(SetPoint(0.0, rad(6.0)), rad(90.0), limits_deg(1.0, 0.4, 2.0))
    assert plan.sample(0.0)[1] == rad(6.0)
    assert deg(plan.sample(2.6)[1]) == pytest.approx(1.0, rel=1e-9)
    assert plan.pos_end == rad(90.0)


def test_a_stop_never_swings_back() -> None:
    # 0.1 deg/s left at 2 deg/s2: with 0.788 deg/s3 the release alone would take it to -2.4 deg/s.
    start = SetPoint(0.0, rad(0.1), rad(-2.0))
    plan = plan_stop(start, limits_deg(6.0, 0.4, 0.4, 0.788))
    assert plan.duration == pytest.approx(0.1, rel=1e-12)
    assert plan.extremes()[0] == 0.0
    assert all(plan.sample(k * 1e-3)[1] >= -1e-15 for k in range(101))


def test_plan_velocity_goes_on() -> None:
    plan = plan_velocity(SetPoint(0.0, rad(-1.0)), rad(2.0), limits_deg(6.0, 0.5, 1.0))
    assert plan.duration == pytest.approx(1.0 + 4.0, rel=1e-9), "1 s down at 1 deg/s2, 4 s up at 0.5"
    assert plan.vel_end == rad(2.0)
    pos, vel, acc = plan.sample(plan.duration + 10.0)
    assert (vel, acc) == (rad(2.0), 0.0)
    assert pos == pytest.approx(plan.pos_end + rad(20.0), rel=1e-12)


def test_plan_velocity_zero_is_a_stop() -> None:
    plan = plan_velocity(SetPoint(0.0, rad(2.0)), 0.0, PAPER)
    assert plan.vel_end == 0.0
    assert plan.pos_end == plan_stop(SetPoint(0.0, rad(2.0)), PAPER).pos_end


BAD = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("field", range(3))
def test_no_plan_from_a_set_point_that_is_not_finite(bad: float, field: int) -> None:
    values = [0.0, 0.0, 0.0]
    values[field] = bad
    start = SetPoint(*values)
    for plan in (lambda: plan_move(start, 1.0, PAPER), lambda: plan_stop(start, PAPER),
                 lambda: plan_velocity(start, 0.01, PAPER), lambda: stop_point(start, PAPER)):  # fmt: skip
        with pytest.raises(CommandRefused, match="finite"):
            plan()


@pytest.mark.parametrize("bad", [*BAD, 0.0, -1.0])
@pytest.mark.parametrize("field", range(4))
def test_no_plan_with_limits_that_are_none(bad: float, field: int) -> None:
    if field == 3 and bad == math.inf:
        return  # an infinite jerk is the trapezoid
    values = [0.1, 0.01, 0.01, 0.02]
    values[field] = bad
    with pytest.raises(CommandRefused, match="above 0"):
        plan_move(SetPoint(0.0), 1.0, MotionLimits(*values))


@pytest.mark.parametrize("bad", BAD)
def test_no_plan_to_a_target_that_is_not_finite(bad: float) -> None:
    with pytest.raises(CommandRefused, match="finite"):
        plan_move(SetPoint(0.0), bad, PAPER)
    with pytest.raises(CommandRefused, match="speed must be within"):
        plan_velocity(SetPoint(0.0), bad, PAPER)
