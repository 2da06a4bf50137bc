"""A closed brake: the shaft that slips behind it and what its stops cost, both ways, at each scan period; by hand."""

import math
from dataclasses import replace

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.program.power.slip_watch import SlipWatch
from gantryctl.program.power.wear import BrakeWear
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts, in_scans
from unit.program.rig import settings

approx = pytest.approx


@BOTH
@pytest.mark.parametrize(("degrees", "slips"), [(0.0199, False), (0.0201, True)])
def test_a_shaft_behind_the_brake_may_move_by_0_02_deg(way, degrees, slips):
    parts = Parts()
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    watch.begin(rad(30.0), unwinds=False)
    assert watch.slipped(rad(30.0 + way * degrees), Code.BRK_10) is slips
    watch.begin(rad(30.0), unwinds=False)
    assert watch.slipped_without_torque(rad(30.0 + way * degrees), 1.0, Code.BRK_04) is slips
    # What was set anew counts from where it is.
    watch.rebase()
    assert not watch.slipped(rad(-100.0), Code.BRK_10)
    assert watch.slipped(rad(-100.0 + way * degrees), Code.BRK_10) is slips


@BOTH
@pytest.mark.parametrize(
    ("degrees", "at_s", "slips"),
    [(0.049, 0.29, False), (0.051, 0.29, True), (0.049, 0.31, False), (0.051, 0.31, True)],
)
def test_a_gear_may_unwind_by_0_03_deg_more_for_300_ms(way, degrees, at_s, slips):
    parts = Parts()
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    watch.begin(0.0, unwinds=True)
    assert watch.slipped_without_torque(rad(way * degrees), at_s, Code.BRK_04) is slips
    # From then on it counts from there, and as any other: 0.021 deg back.
    if not slips:
        back = rad(way * (degrees - 0.021))
        assert watch.slipped_without_torque(back, at_s + 0.02, Code.BRK_04) is (at_s > 0.3)


@BOTH
@PERIODS
def test_a_doubted_reading_that_jumps_is_no_slip_and_one_that_turns_is(period_s, way):
    parts = Parts(period_s)
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.in_doubt = True
    watch.begin(0.0, unwinds=False)
    parts.turn(way * 0.019)
    assert not watch.slipped_without_torque(rad(way * 5.0), 1.0, Code.BRK_04)
    # It counts from there on; with the speed of a shaft that turns it is believed after 50 ms.
    parts.turn(way * 0.021)
    assert not watch.slipped_without_torque(rad(way * 5.019), 1.0, Code.BRK_04)
    turns = parts.after(lambda: watch.slipped_without_torque(rad(way * 6.0), 1.0, Code.BRK_04), most_s=0.5)
    assert turns == approx(in_scans(0.050, period_s))


@BOTH
@PERIODS
def test_what_the_brake_takes_is_its_torque_times_the_angle_of_the_motor(period_s, way):
    """400 N m, 1 s at 6 deg/s: 6 x 1144 deg of the motor are 119.8 rad, 47.9 kJ."""
    parts = Parts(period_s)
    wear = BrakeWear(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.brake_open = False
    parts.turn(way * 6.0)
    for _ in range(round(1.0 / period_s)):
        wear.scan()
    assert wear.energy_j == approx(47.92e3, rel=1e-3)
    kept = wear.energy_j
    parts.feedback.brake_open = True
    wear.scan()
    parts.feedback.brake_open, parts.feedback.in_doubt = False, True
    wear.scan()
    assert wear.energy_j == kept
    # A scan that was missed was a scan of the stop, too.
    parts.feedback.in_doubt, parts.feedback.periods = False, 3
    wear.scan()
    assert wear.energy_j - kept == approx(3.0 * 47.92e3 * period_s, rel=1e-3)


def test_a_stop_by_the_brake_counts_above_a_tenth_of_a_degree_per_second():
    parts = Parts(brake_stops_max=5)
    wear = BrakeWear(parts.settings, parts.feedback, parts.alarms)
    wear.restore(2)
    wear.begin(rad(0.099))
    assert wear.stops == 0
    wear.begin(rad(0.101))
    wear.begin(math.nan)
    assert (wear.stops, parts.codes) == (2, [])
    wear.begin(rad(6.0))
    assert (wear.stops, parts.codes) == (3, ["BRK-09"])


@pytest.mark.parametrize(("fastest_deg_s", "slow_deg_s"), [(0.048, 0.0008), (0.48, 0.008), (60.0, 1.0)])
def test_brake_stops_of_a_slow_axis_count_and_a_creep_of_a_fast_one_does_not(fastest_deg_s, slow_deg_s):
    """A sixtieth of the highest setting: an axis that never came to 0.1 deg/s counted none of its stops."""
    usual = settings()
    speed = replace(usual.speed, setting_max_rad_s=rad(fastest_deg_s))
    parts = Parts(config=replace(usual, speed=speed))
    wear = BrakeWear(parts.settings, parts.feedback, parts.alarms)
    wear.begin(rad(0.99 * slow_deg_s))
    assert wear.stops == 0
    wear.begin(rad(1.01 * slow_deg_s))
    wear.begin(rad(fastest_deg_s))
    assert wear.stops == 2


def test_brake_stops_of_earlier_runs_are_told_at_once():
    parts = Parts(brake_stops_max=5)
    BrakeWear(parts.settings, parts.feedback, parts.alarms).restore(4)
    assert parts.codes == []
    BrakeWear(parts.settings, parts.feedback, parts.alarms).restore(5)
    assert parts.codes == ["BRK-09"]


@BOTH
def test_only_the_phase_behind_a_drive_that_owns_its_brake_may_unwind(way):
    """0.04 deg: within what a gear unwinds by there, a slip in the next phase."""
    parts = Parts()
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    for unwinds in (True, False):
        watch.begin(0.0, unwinds=unwinds)
        assert watch.slipped_without_torque(way * rad(0.04), 0.1, Code.BRK_04) is not unwinds
