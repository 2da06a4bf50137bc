"""The ramp of a drive that stops by itself, and its rest: both ways, at each scan period; figures by hand.

6 deg/s at 5.5 deg/s2.
"""

import math
from dataclasses import replace

import pytest

from gantryctl.program import Reaction
from gantryctl.program.power.ramp_watch import RampWatch
from gantryctl.program.power.rest import RestWatch
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts, in_scans

approx = pytest.approx


def ramp_of(parts, speed_at, most_s=6.0):
    """Seconds until the alarm; `speed_at` gives the speed after so many seconds."""
    watch = RampWatch(parts.settings, parts.feedback)
    parts.turn(speed_at(0.0))
    watch.begin()
    scans = 0

    def scan():
        nonlocal scans
        scans += 1
        parts.turn(speed_at(scans * parts.period_s))
        assert watch.obeyed(scans * parts.period_s) == (not parts.codes)

    return parts.after(scan, most_s=most_s)


@BOTH
@PERIODS
def test_a_drive_on_its_ramp_with_the_permitted_swing_is_believed_until_it_should_stand(period_s, way):
    """59 ms of reaction, then 5.5 deg/s2 with 0.45 deg/s to spare, which are too much from 0.25 s after the ramp on."""
    parts = Parts(period_s)
    seconds = ramp_of(parts, lambda t: way * (max(0.0, 6.0 - 5.5 * max(0.0, t - 0.059)) + 0.45 * (t > 0.059)))
    assert seconds == approx(6.0 / 5.5 + 0.25 + 0.05, abs=1.01 * period_s)
    assert parts.codes == ["DRV-07"]
    assert parts.reaction("DRV-07") is Reaction.TORQUE_OFF


@PERIODS
def test_a_drive_that_never_comes_to_rest_is_not_waited_for(period_s):
    """Now and then slower than what counts as rest, never for 50 ms, and never faster for so long: 6 / 5.5 + 3 s."""
    parts = Parts(period_s)
    seconds = ramp_of(parts, lambda t: max(6.0 - 5.5 * t, 0.06 if int(t / 0.03) % 2 else 0.04))
    assert seconds == approx(6.0 / 5.5 + 3.0, abs=1.01 * period_s)
    assert parts.codes == ["DRV-07"]


@BOTH
@PERIODS
def test_a_drive_that_swings_beyond_its_ramp_is_told_after_50_ms(period_s, way):
    """Nothing for 1.3 s, where the ramp has ended after 1.15 s; then 0.51 deg/s."""
    parts = Parts(period_s)
    seconds = ramp_of(parts, lambda t: way * (max(0.0, 6.0 - 5.5 * t) if t < 1.3 else 0.51))
    assert seconds == approx(1.3 + 0.05, abs=1.01 * period_s)


@BOTH
@pytest.mark.parametrize(("reads_deg_s", "codes"), [(0.079, []), (0.081, ["DRV-07"])])
def test_an_axis_whose_reading_rests_at_more_than_a_tenth_of_its_deviation_is_believed(
    way, reads_deg_s, codes
):
    """A tenth of 0.5 deg/s are 0.05; what counts as rest on this one is 0.08, judged 0.25 s behind the ramp."""
    parts = Parts()
    parts.settings = replace(parts.settings, speed=replace(parts.settings.speed, rest_rad_s=rad(0.08)))
    ramp_of(parts, lambda t: way * max(6.0 - 5.5 * t, reads_deg_s), most_s=2.0)
    assert parts.codes == codes


@PERIODS
def test_a_short_excess_over_the_ramp_is_forgotten(period_s):
    """Twice 39 ms at most, with 20 ms between them, are not 50 ms."""
    parts = Parts(period_s)
    seconds = ramp_of(
        parts, lambda t: 0.6 if 2.0 < t <= 2.039 or 2.060 < t <= 2.099 else max(0.0, 6.0 - 5.5 * t)
    )
    assert seconds > 4.0


@BOTH
@PERIODS
def test_rest_is_50_ms_below_a_fiftieth_of_a_degree_per_second_and_300_ms_after_a_brake_stop(period_s, way):
    parts = Parts(period_s)
    rest = RestWatch(parts.settings, parts.feedback)
    parts.turn(way * 0.0201)
    assert parts.after(rest.scan, rest.scan, 0.5) == math.inf
    rest.begin()
    parts.turn(way * 0.0199)
    found = []
    assert parts.after(lambda: found.append(rest.scan()), lambda: found[-1]) == approx(
        in_scans(0.050, period_s)
    )
    assert not rest.after_brake_stop
    left = parts.after(rest.scan, lambda: rest.after_brake_stop)
    assert left == approx(in_scans(0.300, period_s) - in_scans(0.050, period_s))
    parts.turn(way * 0.021)
    assert not rest.scan()
    parts.turn(0.0)
    assert not rest.scan(), "it counts anew"
    assert not rest.after_brake_stop
