"""Statistics of a small population by hand, however its rows are kept."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.campaign.statistics import figure_statistics, passing_of

# Mean 1; squares about it 9 + 4 + 0 + 1 + 4 + 4 + 4 + 16 + 4 + 0 = 46.
VALUES = [-2.0, -1.0, 1.0, 2.0, 3.0, 3.0, -1.0, 5.0, -1.0, 1.0]


@pytest.mark.parametrize("batches", [[10], [3, 7], [1, 1, 8], [9, 0, 1]])
def test_mean_deviation_and_limits_do_not_depend_on_batches(batches: list[int]) -> None:
    parts, at = [], 0
    for size in batches:
        parts.append(np.array(VALUES[at : at + size]))
        at += size
    found = figure_statistics("x", lambda: parts, (2.0, 1.0))
    assert found.plants == 10
    assert found.mean == pytest.approx(1.0)
    assert found.deviation == pytest.approx(math.sqrt(46.0 / 9.0))
    assert (found.smallest, found.largest) == (-2.0, 5.0)
    # Magnitudes at or below 2: all but 3, 3 and 5; at or below 1: -1, 1, -1, -1, 1.
    assert [each.probability for each in found.passing] == [0.7, 0.5]


def test_a_quantile_lies_between_two_values_by_its_part_of_the_way() -> None:
    """Of 0, 10, 20 the 5 % quantile is 0.1 of the way to 10, the median 10, the 95 % one nine tenths up to 20."""
    found = figure_statistics("x", lambda: [np.array([20.0, 0.0, 10.0])], ())
    assert found.curve[5] == pytest.approx(1.0)
    assert found.curve[50] == pytest.approx(10.0)
    assert found.curve[95] == pytest.approx(19.0)


def test_no_plant_is_no_evidence() -> None:
    found = passing_of(0, 0, 1.0)
    assert math.isnan(found.probability)
