"""Times become scans, and ramps of one motion those of the machine."""

import math
from dataclasses import replace

import pytest

from gantryctl.program.settings import RampSettings
from unit.program.rig import settings


@pytest.mark.parametrize(
    ("time_s", "period_s", "expected"),
    [
        (0.010, 0.001, 10),
        (0.010, 0.004, 3),  # rounded up: 12 ms, not 8
        (0.010, 0.010, 2),  # never a single reading
        (0.0, 0.001, 2),
        (0.250, 0.004, 63),
        (0.3, 0.1, 3),  # 0.3 / 0.1 is 2.9999999999999996 in binary
        (0.7, 0.1, 7),  # and 0.7 / 0.1 is 6.999999999999999
        (0.6, 0.2, 3),  # 0.6 / 0.2 is 2.9999999999999996
    ],
)
def test_scans(time_s, period_s, expected):
    assert settings(period_s=period_s).scans(time_s) == expected


def test_least():
    config = settings(period_s=0.010)
    assert config.scans(0.010, least=3) == 3
    assert config.scans(0.001, least=1) == 1


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ((1.0, None, None), (1.0, 8.0, 9.0)),
        ((None, 1.0, None), (7.0, 1.0, 9.0)),
        ((None, None, 1.0), (7.0, 8.0, 1.0)),
        ((None, None, None), (7.0, 8.0, 9.0)),
    ],
)
def test_ramps_of_one_motion_are_the_machines_but_for_what_is_given(given, kept):
    ramps = RampSettings(7.0, 8.0, 9.0, 10.0, 11.0, 12.0)
    below = ramps.below(*given)
    assert (below.acc_rad_s2, below.dec_rad_s2, below.jerk_rad_s3) == kept
    assert below.jog_release(6.0).dec_rad_s2 == 10.0


@pytest.mark.parametrize(("over_rad", "shown_rad"), [(math.pi, -math.pi), (3.0, 2.0 * math.pi - 3.0)])
def test_a_limit_has_its_sign_where_both_ends_of_travel_read_alike(over_rad, shown_rad):
    """As people read angles within a turn, -180 deg is 180 deg, which the other end is."""
    travel = replace(
        settings().travel, over_travel_min_rad=-over_rad, over_travel_max_rad=over_rad, read_within_turn=True
    )
    assert travel.read_end_rad(-over_rad) == pytest.approx(shown_rad)
