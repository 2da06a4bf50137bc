"""Every plan: starts where it was asked to, ends where it must, has no jumps, keeps its limits.

The strategies put weight on the values where trajectory code breaks: exact zeros, exact limits, targets
exactly at the stop point, states above the limits, steps far below the resolution of the encoder.
"""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.motion import MotionLimits, SetPoint, plan_move, plan_stop, plan_velocity, stop_point
from gantryctl.units import rad

# 1e-9 rad is 6e-8 deg, less than one fine count of the encoder at the gantry (1.3e-9 rad).
JUMP = 1e-9
# Limits hold to rounding: relative, plus what 1e-9 rad of Ruckig's own tolerance can do.
SLACK = 1.0 + 1e-7

speeds_deg_s = st.one_of(st.sampled_from([0.006, 0.1, 0.6, 6.0]), st.floats(0.006, 6.0))
ramps_deg_s2 = st.one_of(st.sampled_from([450.0 / 1144.0, 2.0, 5.5]), st.floats(0.05, 10.0))
jerks_deg_s3 = st.one_of(st.just(math.inf), st.sampled_from([0.788, 20.0]), st.floats(0.5, 100.0))
ends_deg = st.one_of(
    st.just((math.inf, math.inf)),
    st.just((0.2, 0.15)),
    st.tuples(st.floats(0.01, 10.0), st.floats(0.01, 50.0)),
)
limits_st = st.builds(
    lambda vel, acc, dec, jerk, end: MotionLimits(
        rad(vel), rad(acc), rad(dec), rad(jerk), rad(end[0]), rad(end[1])
    ),
    speeds_deg_s, ramps_deg_s2, ramps_deg_s2, jerks_deg_s3, ends_deg,
)  # fmt: skip
angles_deg = st.one_of(
    st.sampled_from([0.0, 180.0, -180.0, 90.0, 1e-12, -1e-9, 1e-6, 1e-3]), st.floats(-180.0, 180.0)
)
present_speeds_deg_s = st.one_of(
    st.just(0.0), st.sampled_from([6.0, -6.0, 1e-12, -1e-9]), st.floats(-6.3, 6.3)
)
present_accs_deg_s2 = st.one_of(st.just(0.0), st.floats(-6.0, 6.0))
starts = st.builds(
    lambda pos, vel, acc: SetPoint(rad(pos), rad(vel), rad(acc)),
    angles_deg,
    present_speeds_deg_s,
    present_accs_deg_s2,
)


def pieces_of(plan):
    """(duration, pos, vel, acc, jerk) of every piece."""
    ends = [*plan.t_start, plan.duration][1:]
    return [
        (end - start, pos, vel, acc, jerk)
        for start, end, pos, vel, acc, jerk in zip(
            plan.t_start, ends, plan.pos, plan.vel, plan.acc, plan.jerk, strict=True
        )
    ]


def end_of(piece):
    dt, pos, vel, acc, jerk = piece
    return (
        pos + dt * vel + dt**2 * acc / 2 + dt**3 * jerk / 6,
        vel + dt * acc + dt**2 * jerk / 2,
        acc + dt * jerk,
    )


def assert_continuous(plan, start, limits):
    pieces = pieces_of(plan)
    # Slower than 1e-12 rad/s and slowing down is at rest: there the acceleration may end at once.
    at_rest = abs(start.vel_rad_s) <= 1e-12 and start.acc_rad_s2 * start.vel_rad_s < 0.0
    jerk_limited = not math.isinf(limits.jerk_rad_s3) and not at_rest
    pos, vel, acc = start
    for piece in pieces:
        assert piece[0] > 0.0
        assert abs(piece[1] - pos) <= JUMP
        assert abs(piece[2] - vel) <= JUMP
        if jerk_limited:
            assert abs(piece[3] - acc) <= JUMP
        pos, vel, acc = end_of(piece)
    assert abs(plan.pos_end - pos) <= JUMP
    assert abs(plan.vel_end - vel) <= JUMP
    if jerk_limited and pieces:
        assert abs(acc) <= JUMP


def assert_limits_kept(plan, start, limits, stop_jerk_free=False):
    """Speeding up with acc, slowing down with dec; above the limits only while coming down to them."""
    before = abs(start.vel_rad_s)
    acc_start = abs(start.acc_rad_s2) if not math.isinf(limits.jerk_rad_s3) else 0.0
    # What a present acceleration still adds to the speed while it is released within the jerk limit.
    still_gained = acc_start**2 / (2.0 * limits.jerk_rad_s3) if acc_start else 0.0
    top = max(before + still_gained, limits.vel_rad_s) * SLACK + JUMP
    acc_top = max(limits.acc_rad_s2, limits.dec_rad_s2, acc_start) * SLACK + JUMP
    released = acc_start == 0.0
    for dt, pos, vel, acc, jerk in pieces_of(plan):
        for part in (0.0, 0.25, 0.5, 0.75, 1.0):
            _, v, a = end_of((dt * part, pos, vel, acc, jerk))
            assert abs(v) <= top
            assert abs(a) <= acc_top
            if released and abs(v) > 1e-7:  # below that the sign of the speed is rounding
                allowed = limits.acc_rad_s2 if a * v > 0.0 else limits.dec_rad_s2
                assert abs(a) <= allowed * SLACK + JUMP
        if not stop_jerk_free:
            assert abs(jerk) <= limits.jerk_rad_s3 * SLACK + JUMP


@settings(max_examples=600)
@given(starts, angles_deg.map(rad), limits_st)
def test_a_move_ends_at_its_target_without_a_jump(start, target, limits):
    plan = plan_move(start, target, limits)
    assert plan.pos_end == target
    assert plan.vel_end == 0.0
    assert plan.sample(plan.duration) == (target, 0.0, 0.0)
    assert_continuous(plan, start, limits)
    # A start that brakes harder than the jerk limit can release may need more jerk not to swing back.
    assert_limits_kept(plan, start, limits, stop_jerk_free=start.acc_rad_s2 * start.vel_rad_s < 0.0)


@settings(max_examples=300)
@given(starts, limits_st)
def test_a_stop_ends_at_rest_and_never_goes_back(start, limits):
    plan = plan_stop(start, limits)
    assert plan.vel_end == 0.0
    assert plan.pos_end == stop_point(start, limits)
    assert_continuous(plan, start, limits)
    moving = start.vel_rad_s or start.acc_rad_s2
    way = math.copysign(1.0, moving)
    for dt, pos, vel, acc, jerk in pieces_of(plan):
        for part in (0.0, 0.5, 1.0):
            assert end_of((dt * part, pos, vel, acc, jerk))[1] * way >= -1e-8, "a stop swings back"


@settings(max_examples=300)
@given(starts, st.floats(-1.0, 1.0), limits_st)
def test_a_velocity_plan_reaches_its_speed(start, share, limits):
    vel = share * limits.vel_rad_s
    plan = plan_velocity(start, vel, limits)
    assert plan.vel_end == vel
    assert_continuous(plan, start, limits)


@settings(max_examples=300)
@given(starts, angles_deg.map(rad), limits_st)
def test_extremes_bound_every_sample(start, target, limits):
    plan = plan_move(start, target, limits)
    low, high = plan.extremes()
    samples = [plan.sample(plan.duration * k / 64)[0] for k in range(65)]
    assert low - 1e-12 <= min(samples)
    assert max(samples) <= high + 1e-12


@settings(max_examples=200)
@given(angles_deg.map(rad), angles_deg.map(rad), limits_st, st.floats(0.0, 1.0))
def test_a_plan_can_be_made_again_from_every_point_of_itself(pos, target, limits, part):
    """Step-through consistency: from the state reached, the same question has the same answer."""
    first = plan_move(SetPoint(pos), target, limits)
    t = part * first.duration
    again = plan_move(SetPoint(*first.sample(t)), target, limits)
    assert again.pos_end == target
    # Same end, and no way round: the second plan stays within the first.
    low, high = first.extremes()
    assert low - JUMP <= again.extremes()[0]
    assert again.extremes()[1] <= high + JUMP
    # The time left, to what a jump of 1e-9 rad costs on the slowest ramp; a plan within its gentle end, or on the point
    # of having room for one, may get a smaller one.
    if limits.end_jerk_rad_s3 < limits.jerk_rad_s3:
        assert again.duration <= first.duration - t + 2e-3 + 1e-6 * first.duration
        return
    assert abs(again.duration - (first.duration - t)) <= 2e-3 + 1e-6 * first.duration


@settings(max_examples=200)
@given(starts, limits_st)
def test_a_move_to_the_stop_point_is_the_stop(start, limits):
    there = stop_point(start, limits)
    plan = plan_move(start, there, limits)
    low, high = plan_stop(start, limits).extremes()
    assert low - JUMP <= plan.extremes()[0]
    assert plan.extremes()[1] <= high + JUMP
