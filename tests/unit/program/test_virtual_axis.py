"""The set-point by itself: what it follows, which stop counts, and what an override goes on with."""

from __future__ import annotations

import math

import pytest

from gantryctl.program import Code
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import deg, rad
from unit.program.parts import BOTH
from unit.program.rig import settings
from unit.program.test_modulo import modulo

approx = pytest.approx
CONFIG = settings(jerk=20.0)
SPEED = rad(6.0)


def moving(way: float = 1.0) -> VirtualAxis:
    """At 6 deg/s, 14.55 deg on its way to 100 deg: ramps of 1.5 s and 0.2 s of jerk, seen after 3.275 s."""
    virtual = VirtualAxis(CONFIG)
    virtual.follow_from(0.0, 0)
    assert virtual.move_to(way * rad(100.0), SPEED, virtual.ramps, 0) is None
    virtual.sample(3275)
    assert deg(virtual.vel_ref_rad_s) == approx(way * 6.0)
    assert deg(virtual.pos_ref_rad) == approx(way * (0.5 * 6.0 * 1.7 + 6.0 * 1.575))
    return virtual


def jog_release(virtual: VirtualAxis, scan: int) -> None:
    virtual.stop(CONFIG.ramps.jog_release(SPEED), scan)


def halt(virtual: VirtualAxis, scan: int) -> None:
    virtual.stop(CONFIG.ramps.normal(SPEED), scan)


def test_it_rests_from_the_scan_on_in_which_it_follows():
    virtual = VirtualAxis(CONFIG)
    assert [virtual.following, virtual.changed, virtual.paused, virtual.stopping] == [False] * 4
    assert virtual.at_rest
    virtual.follow_from(rad(20.0), 7)
    assert virtual.following
    assert virtual.at_rest
    assert virtual.changed
    assert (deg(virtual.pos_ref_rad), virtual.start_scan, virtual.plans) == (approx(20.0), 7, [])


def test_a_plan_is_kept_with_its_scan_where_plans_are():
    virtual = VirtualAxis(CONFIG, keep_plans=True)
    virtual.follow_from(0.0, 3)
    assert virtual.move_to(rad(1.0), SPEED, virtual.ramps, 5) is None
    assert [scan for scan, _ in virtual.plans] == [3, 5]
    assert virtual.plans[-1][1] is virtual.plan


@pytest.mark.parametrize("end", [jog_release, lambda virtual, scan: virtual.set_override(0.0, scan)])
def test_released_it_is_the_measured_angle_at_rest_and_nothing_goes_on(end):
    virtual = moving()
    end(virtual, 3275)
    virtual.release(rad(-3.0))
    assert [virtual.following, virtual.paused, virtual.stopping] == [False] * 3
    assert virtual.at_rest
    assert deg(virtual.pos_ref_rad) == approx(-3.0)
    assert (virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2) == (0.0, 0.0)
    plan = virtual.plan
    assert virtual.set_override(1.0, 3276) is None
    assert virtual.plan is plan


@BOTH
def test_of_two_stops_the_harder_one_counts_whichever_comes_first(way):
    """From 6 deg/s: 4 deg/s2 take 4.5 deg and more, 5 deg/s2 with 100 deg/s3 3.75."""
    for first, second in ((jog_release, halt), (halt, jog_release)):
        virtual = moving(way)
        here = virtual.pos_ref_rad
        first(virtual, 3275)
        virtual.sample(3276)
        second(virtual, 3276)
        assert abs(deg(virtual.plan.pos_end - here)) == approx(3.75, abs=0.02)
        assert virtual.stopping
        kept = virtual.plan
        second(virtual, 3276)
        assert virtual.plan is kept


def test_a_stop_at_rest_is_none():
    virtual = moving()
    virtual.sample(60_000)
    assert virtual.at_rest
    plan = virtual.plan
    jog_release(virtual, 60_000)
    assert virtual.plan is plan
    assert not virtual.stopping


def test_a_motion_that_override_0_holds_back_goes_on_and_one_that_was_stopped_meanwhile_does_not():
    for stopped in (False, True):
        virtual = moving()
        virtual.set_override(0.0, 3275)
        assert virtual.paused
        virtual.sample(9000)
        assert virtual.at_rest
        at_deg = deg(virtual.pos_ref_rad)
        if stopped:
            jog_release(virtual, 9000)
            assert not virtual.paused
        assert virtual.set_override(0.5, 9000) is None
        assert not virtual.paused
        virtual.sample(60_000)
        assert deg(virtual.pos_ref_rad) == approx(at_deg if stopped else 100.0)


def test_an_override_takes_no_stop_back_and_begins_nothing_after_it():
    virtual = moving()
    jog_release(virtual, 3275)
    plan = virtual.plan
    assert virtual.set_override(0.5, 3275) is None
    assert virtual.plan is plan
    assert virtual.stopping
    virtual.sample(9000)
    assert virtual.at_rest
    assert virtual.set_override(1.0, 9000) is None
    assert virtual.plan is plan


def test_a_motion_behind_a_stop_is_no_stop():
    virtual = moving()
    jog_release(virtual, 3275)
    assert virtual.move_to(rad(100.0), SPEED, virtual.ramps, 3275) is None
    assert not virtual.stopping
    assert virtual.set_override(0.5, 3275) is None
    virtual.sample(9000)
    assert deg(virtual.vel_ref_rad_s) == approx(3.0)


@BOTH
def test_a_speed_without_an_end_has_its_sign_and_cruises_once_it_is_reached(way):
    virtual = VirtualAxis(modulo())
    virtual.follow_from(0.0, 0)
    assert virtual.move_to(way * math.inf, SPEED, virtual.ramps.below(None, None, rad(20.0)), 0) is None
    assert (virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2) == (0.0, 0.0)
    assert not virtual.cruising
    virtual.sample(9000)
    assert virtual.cruising
    assert deg(virtual.vel_ref_rad_s) == approx(way * 6.0)


@pytest.mark.parametrize(("target_rad", "speed_rad_s"), [(math.nan, SPEED), (1.0, math.nan)])
def test_what_cannot_be_planned_is_refused_and_changes_nothing(target_rad, speed_rad_s):
    virtual = moving()
    plan = virtual.plan
    refused = virtual.move_to(target_rad, speed_rad_s, virtual.ramps, 3275)
    assert refused is not None
    assert refused.code is Code.CTL_17
    assert virtual.plan is plan
