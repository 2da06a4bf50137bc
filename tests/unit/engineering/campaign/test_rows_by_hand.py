"""Statistics of a population from rows that are written down here, in batches that end anywhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.campaign import statistics
from gantryctl.engineering.campaign.distributions import range_of
from gantryctl.engineering.campaign.job import REFUSED
from gantryctl.engineering.campaign.sampling import Design
from gantryctl.engineering.campaign.tables import DiscreteTable

NAN = float("nan")
ONE_FACTOR = Design("sensitivity", 4, 1, (1,))
"""Four base points of three rows: A, B, and A with the factor of B."""


def rows_of(design: Design, cuts: Sequence[int], **columns: Sequence[Any]) -> Any:
    """Rows of a result whose batches end at these rows."""

    def batches(names: Sequence[str]) -> Iterator[tuple[int, dict[str, Any]]]:
        for first, end in zip((0, *cuts), (*cuts, None), strict=True):
            yield first, {name: np.array(columns[name])[first:end] for name in names}

    return SimpleNamespace(head=SimpleNamespace(outputs={"figure": None}, design=design), batches=batches)


def plants(rows: Any, *of: Any) -> list[float]:
    return [float(each) for batch in statistics._plants(rows, *of) for each in batch]


def test_the_population_of_a_sensitivity_analysis_is_the_first_row_of_each_base_point() -> None:
    rows = rows_of(ONE_FACTOR, (4, 8), figure=range(12))
    assert plants(rows, "figure") == [0.0, 3.0, 6.0, 9.0]


def test_a_part_has_the_plants_of_its_value_alone() -> None:
    rows = rows_of(Design("monte_carlo", 6, 1, (1,)), (3,), figure=range(6), grade=[6, 8, 10, 8, 6, 10])
    assert plants(rows, "figure", ("grade", 8.0)) == [1.0, 3.0]
    assert plants(rows, "figure", ("grade", 10.0)) == [2.0, 5.0]


@pytest.mark.parametrize(
    ("lacking", "base_points"),
    [((), 4), ((11,), 2), ((8,), 2), ((5,), None), ((7, 1), None)],
)
def test_indices_are_of_the_base_points_before_the_first_hole(
    lacking: tuple[int, ...], base_points: int | None
) -> None:
    """A power of two of whole ones: 3 whole ones give 2, and of one alone there are no indices."""
    figure = [NAN if row in lacking else 1.0 for row in range(12)]
    for cuts in ((), (4, 8), (6,)):
        found = statistics._base_sample(rows_of(ONE_FACTOR, cuts, figure=figure))
        assert (None if found is None else found.size) == base_points


def test_a_row_that_was_not_refused_is_no_reason() -> None:
    rows = rows_of(ONE_FACTOR, (2,), **{REFUSED: ["", "B2", "", "B2", "A1"]})
    assert statistics._refused(rows) == {"B2": 2, "A1": 1}


def test_each_index_lies_in_its_own_interval_and_the_total_counts_interactions() -> None:
    """y = a b: alone each factor makes 3/7 of the variance for uniform a, b in 0..1, with the other one 4/7."""
    design = Design("sensitivity", 2**12, 5, (1, 1))
    rng = np.random.default_rng(3)
    a, b = rng.random((2, design.size, 2))
    mixed = [np.column_stack((b[:, 0], a[:, 1])), np.column_stack((a[:, 0], b[:, 1]))]
    values = np.column_stack([each.prod(axis=1) for each in (a, b, *mixed)]).ravel()
    for found in statistics.sensitivity_of(values, design, ("a", "b")):
        # 4,096 points: the spread of an index over resamples is 0.02; four times that.
        assert found.first == pytest.approx(3.0 / 7.0, abs=0.08)
        assert found.total == pytest.approx(4.0 / 7.0, abs=0.08)
        assert found.first_low < found.first < found.first_high
        assert found.total_low < found.total < found.total_high
        # The two are 1/7 apart, far more than their intervals are wide.
        assert found.total_low > found.first_low + 0.05


def test_a_value_without_weight_does_not_occur() -> None:
    law = DiscreteTable(
        keys=("plant.gear_error.scale",), law="discrete", values=(0.5, 1.0, 40.0), weights=(1.0, 1.0, 0.0)
    )
    assert range_of(law) == (0.5, 1.0)
