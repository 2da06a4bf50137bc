"""Designs: every row a function of seed and number, and the whole what its name promises."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.stats import qmc

from gantryctl.engineering.campaign.distributions import grade_scale, quantile, range_of
from gantryctl.engineering.campaign.sampling import Design, members, unit_points
from gantryctl.engineering.campaign.tables import (
    DiscreteTable,
    GearGradeTable,
    LognormalTable,
    NormalTable,
    UniformTable,
)

SAMPLINGS = ("monte_carlo", "sobol", "latin_hypercube", "sensitivity")
designs = st.builds(
    Design,
    st.sampled_from(SAMPLINGS),
    st.sampled_from([8, 32, 64]),
    st.integers(0, 2**31 - 1),
    st.lists(st.integers(1, 5), min_size=1, max_size=4).map(tuple),
)


@given(designs, st.data())
def test_a_row_is_the_same_in_whatever_range_it_is_drawn(design: Design, data: st.DataObject) -> None:
    whole = unit_points(design, 0, design.rows)
    assert whole.shape == (design.rows, design.dimensions)
    assert np.all((whole >= 0.0) & (whole < 1.0))
    first = data.draw(st.integers(0, design.rows - 1))
    count = data.draw(st.integers(1, design.rows - first))
    assert np.array_equal(unit_points(design, first, count), whole[first : first + count])
    other = design._replace(seed=(design.seed + 1) % 2**31)
    assert not np.array_equal(unit_points(other, 0, design.rows), whole)


@given(st.sampled_from(SAMPLINGS), st.integers(0, 1000))
def test_a_longer_campaign_begins_with_the_shorter_one(sampling: str, seed: int) -> None:
    short, long = (Design(sampling, size, seed, (2, 1)) for size in (16, 64))
    same = np.array_equal(unit_points(short, 0, 16), unit_points(long, 0, 16))
    # A Latin hypercube is one whole; every other design may be made longer.
    assert same == (sampling != "latin_hypercube")


def test_a_latin_hypercube_has_one_point_in_every_slice() -> None:
    points = unit_points(Design("latin_hypercube", 50, 7, (3,)), 0, 50)
    for column in points.T:
        assert sorted((column * 50).astype(int)) == list(range(50))


def test_a_sobol_design_fills_better_than_chance() -> None:
    sobol, chance = (unit_points(Design(name, 256, 5, (4,)), 0, 256) for name in ("sobol", "monte_carlo"))
    # The 256 points of a Sobol design of 4 coordinates have a tenth of the discrepancy of random ones.
    assert qmc.discrepancy(sobol) < 0.2 * qmc.discrepancy(chance)


def test_the_rows_of_a_sensitivity_analysis_differ_in_one_factor_each() -> None:
    design = Design("sensitivity", 16, 3, (2, 1, 3))
    points = unit_points(design, 0, design.rows)
    a, b, mixed = members(design, points[:, 0])
    assert len(a) == len(b) == len(mixed[0]) == 16
    rows = points.reshape(16, 5, 6)
    ends = np.cumsum([0, 2, 1, 3])
    for base in rows:
        for k in range(3):
            inside = slice(ends[k], ends[k + 1])
            assert np.array_equal(base[2 + k, inside], base[1, inside])
            outside = np.delete(np.arange(6), np.arange(6)[inside])
            assert np.array_equal(base[2 + k, outside], base[0, outside])
    assert not np.any(rows[:, 0] == rows[:, 1])


UNIT = np.linspace(0.001, 0.999, 999)


def test_laws_are_those_of_the_textbook() -> None:
    assert quantile(UniformTable(keys=("a",), low=2.0, high=6.0), np.array([0.0, 0.25, 1.0])).tolist() == [
        2,
        3,
        6,
    ]
    normal = quantile(NormalTable(keys=("a",), mean=3.0, deviation=0.5), UNIT)
    assert normal == pytest.approx(stats.norm(3.0, 0.5).ppf(UNIT))
    lognormal = quantile(LognormalTable(keys=("a",), median=2.0, spread=1.5), UNIT)
    assert lognormal == pytest.approx(stats.lognorm(math.log(1.5), scale=2.0).ppf(UNIT))
    one_sigma = stats.norm.cdf(1.0)
    assert quantile(
        LognormalTable(keys=("a",), median=2.0, spread=1.5), np.array([one_sigma])
    ) == pytest.approx(3.0)


def test_discrete_values_come_as_often_as_their_weights_say() -> None:
    law = DiscreteTable(keys=("a",), values=(5.0, 7.0, 9.0), weights=(1.0, 0.0, 3.0))
    found = quantile(law, np.array([0.0, 0.2499, 0.25, 0.9999999999999999]))
    assert found.tolist() == [5.0, 5.0, 9.0, 9.0]
    assert range_of(law) == (5.0, 9.0)
    # Each weight is that of its value, in whatever order they stand.
    falling = DiscreteTable(keys=("a",), values=(9.0, 2.0, 7.0, 5.0), weights=(5.0, 2.0, 0.0, 3.0))
    assert quantile(falling, np.array([0.49, 0.51, 0.69, 0.71])).tolist() == [9.0, 2.0, 2.0, 5.0]
    even = quantile(DiscreteTable(keys=("a",), values=(1.0, 2.0, 3.0)), UNIT)
    assert [int(np.sum(even == value)) for value in (1.0, 2.0, 3.0)] == [333, 333, 333]


def test_two_grades_are_twice_the_tolerance() -> None:
    assert [grade_scale(grade) for grade in (6.0, 8.0, 10.0)] == [0.5, 1.0, 2.0]
    assert grade_scale(9.0) == pytest.approx(math.sqrt(2.0))
    assert range_of(GearGradeTable(grades=(6.0, 10.0))) == (0.5, 2.0)


def test_the_ends_of_a_law_without_ends_are_not_clipped() -> None:
    found = quantile(NormalTable(keys=("a",), mean=0.0, deviation=1.0), np.array([0.0]))
    assert found[0] == -math.inf
