"""The way back, the smallest star and a spread by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.accuracy.iso230 import _return_deviations
from gantryctl.engineering.accuracy.isocentre import smallest_star
from gantryctl.engineering.accuracy.noise import Distribution, a_draws, chord_result, noise_floor
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure, evaluate


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


def test_three_beams_two_of_which_are_parallel_have_a_star_too() -> None:
    """At x = 1 and -1 and along x: signs under which the parallel ones never have one distance are left out."""
    centre, radius = smallest_star(np.array([0.0, math.pi, 0.5 * math.pi]), np.array([1.0, 1.0, 0.25]))
    assert radius == pytest.approx(1.0)
    assert centre[0] == pytest.approx(0.0, abs=1e-12)


def test_a_spread_is_median_and_5_to_95_percent() -> None:
    found = Distribution.of(np.arange(101.0)[::-1])
    assert (found.low_deg, found.median_deg, found.high_deg, found.draws) == (5.0, 50.0, 95.0, 101)


def test_noise_is_drawn_500_times_and_the_same_each_time() -> None:
    """And in a result table and draws by the seed that was asked for."""
    procedure = chord_procedure("A")
    angles = procedure.targets_rad
    first, again, other = (
        a_draws(procedure, angles, 2.5, 1e-5, **seed) for seed in ({}, {"seed": 0}, {"seed": 1})
    )
    assert first.tolist() == again.tolist() != other.tolist()
    assert noise_floor(procedure, 2.5, 1e-5) == Distribution.of(first)
    for seed in ({}, {"seed": 1}):
        found = chord_result(procedure, angles, 2.5, 1e-5, **seed)
        drawn = Distribution.of(first if not seed else other)
        assert (found.a_measured, found.a_floor) == (drawn, drawn)
        assert found.a_floor.draws == 500
        assert found.measured == evaluate(procedure, angles, 2.5, 1e-5, **(seed or {"seed": 0}))
        assert found.true == evaluate(procedure, angles, 2.5)
