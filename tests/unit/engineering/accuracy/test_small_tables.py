"""The way back, the smallest star and a spread by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.accuracy.iso230 import _return_deviations
from gantryctl.engineering.accuracy.isocentre import smallest_star
from gantryctl.engineering.accuracy.noise import Distribution


def test_the_way_back_is_measured_from_the_turning_point() -> None:
    """Up 0, 1, 2 at 0, 5, 10 deg. Back by 5: error 3, so the axis stands at 2 - 3 = -1; back by 10: 2 - 5 = -3."""
    found = _return_deviations(np.array([[0.0, 1.0, 2.0]]), np.array([[0.0, 3.0, 5.0]]), (0.0, 5.0, 10.0))
    np.testing.assert_allclose(found, [[-3.0, -1.0, math.nan]])


def test_the_smallest_star_touches_the_farthest_beam() -> None:
    """Beams at x = 1 and -1: no circle below a radius of 1 touches both; those at z = 0 and 1 are nearer."""
    quarter = math.pi / 2.0
    # u_t is (cos, -sin): x at 0 and pi, -z and z at the quarters.
    centre, radius = smallest_star(
        np.array([0.0, quarter, 2.0 * quarter, 3.0 * quarter]), np.array([1.0, -1.0, 1.0, 0.0])
    )
    assert radius == pytest.approx(1.0)
    assert centre[0] == pytest.approx(0.0)


def test_a_spread_is_median_and_5_to_95_percent() -> None:
    found = Distribution.of(np.arange(101.0)[::-1])
    assert (found.low_deg, found.median_deg, found.high_deg, found.draws) == (5.0, 50.0, 95.0, 101)
