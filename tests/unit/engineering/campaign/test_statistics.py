"""Statistics of a population: by hand, by another route, and by a function whose answer is known."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gantryctl.engineering.campaign.population import Campaign
from gantryctl.engineering.campaign.report.text import percent
from gantryctl.engineering.campaign.result import ResultFolder
from gantryctl.engineering.campaign.sampling import Design, unit_points
from gantryctl.engineering.campaign.statistics import (
    PARTS,
    Quantile,
    figure_statistics,
    passing_of,
    population_of,
    quantiles_of,
    sensitivity_of,
)
from gantryctl.engineering.scheduler.job import Chunk


def quantile_of(values: np.ndarray, part: float) -> Quantile:
    quantiles, _ = quantiles_of(lambda: [values], len(values))
    return quantiles[PARTS.index(part)]


def test_the_interval_of_a_median_of_ten_lies_between_the_second_and_the_ninth() -> None:
    """P(2 <= B(10, 1/2) <= 8) = 1 - 2 (1 + 10)/1024 = 0.9785; one rank closer is 0.8906, below 0.95."""
    values = np.array([7.0, 1.0, 9.0, 3.0, 10.0, 2.0, 5.0, 8.0, 4.0, 6.0])
    assert quantile_of(values, 0.5) == (0.5, 5.5, 2.0, 9.0)


def test_a_small_sample_has_no_end_for_a_rare_quantile() -> None:
    """All of 59 plants lie below the 95 % quantile with 0.95^59 = 4.8 %, more than the 2.5 % allowed."""
    found = quantile_of(np.arange(59.0), 0.95)
    assert found.high is None
    assert found.low is not None
    assert quantile_of(np.arange(3000.0), 0.95).high is not None


@pytest.mark.parametrize("part", [0.05, 0.5, 0.95])
def test_the_interval_holds_the_true_quantile_as_often_as_it_says(part: float) -> None:
    rng = np.random.default_rng(1)
    true = -math.log(1.0 - part)
    held = 0
    for sample in rng.exponential(size=(1000, 200)):
        _, _, low, high = quantile_of(sample, part)
        held += (low is None or low <= true) and (high is None or true <= high)
    # Three standard deviations of a share of 1000 draws are 2 %.
    assert held / 1000 >= 0.93


def test_nobody_of_thirty_is_the_rule_of_three() -> None:
    """No failure in n: the exact upper end of the failures is 1 - 0.025^(1/n), 11.6 % for 30."""
    found = figure_statistics("x", lambda: [np.full(30, -0.05)], (0.1,)).passing[0]
    assert found.probability == found.high == 1.0
    assert found.low == pytest.approx(0.025 ** (1.0 / 30.0))
    beyond = passing_of(5, 10, 0.1)
    assert beyond.probability == 0.5
    # Clopper and Pearson (1934), their table for 5 of 10.
    assert (beyond.low, beyond.high) == (pytest.approx(0.1871, abs=1e-4), pytest.approx(0.8129, abs=1e-4))


def test_mean_and_deviation_are_those_of_the_sample() -> None:
    batches = [np.array([1.0, 2.0]), np.empty(0), np.array([3.0, 6.0])]
    found = figure_statistics("x", lambda: batches, (2.5,))
    assert (found.mean, found.smallest, found.largest, found.plants) == (3.0, 1.0, 6.0, 4)
    assert found.deviation == pytest.approx(math.sqrt(14.0 / 3.0))
    assert found.passing[0].probability == 0.5


def ishigami(points: np.ndarray) -> np.ndarray:
    x = -math.pi + 2.0 * math.pi * points
    return np.asarray(np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0]))


def test_the_indices_of_ishigamis_function_are_the_known_ones() -> None:
    """With a = 7, b = 0.1: V1 = (1 + b pi^4/5)^2/2, V2 = a^2/8, V13 = b^2 pi^8 (1/18 - 1/50) (Ishigami, Homma 1990)."""
    v1, v2 = 0.5 * (1.0 + 0.1 * math.pi**4 / 5.0) ** 2, 49.0 / 8.0
    v13 = 0.01 * math.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    whole = v1 + v2 + v13
    design = Design("sensitivity", 1024, 0, (1, 1, 1))
    found = sensitivity_of(ishigami(unit_points(design, 0, design.rows)), design, ("a", "b", "c"))
    for each, first, total in zip(
        found, (v1 / whole, v2 / whole, 0.0), ((v1 + v13) / whole, v2 / whole, v13 / whole), strict=True
    ):
        # An error of 0.02 is what 1024 base points of a Sobol sequence leave.
        assert each.first == pytest.approx(first, abs=0.02)
        assert each.total == pytest.approx(total, abs=0.02)
        assert each.first_low <= first <= each.first_high
        assert each.total_low <= total <= each.total_high


def test_keys_that_move_together_are_one_factor() -> None:
    """y = x1 + x2 + 2 x3 over equal ranges: variances 1 + 1 against 4."""
    design = Design("sensitivity", 512, 2, (2, 1))
    points = unit_points(design, 0, design.rows)
    both, third = sensitivity_of(points @ np.array([1.0, 1.0, 2.0]), design, ("both", "third"))
    assert both.first == pytest.approx(2.0 / 6.0, abs=0.02)
    assert third.total == pytest.approx(4.0 / 6.0, abs=0.02)


def test_a_figure_that_never_changes_depends_on_nothing() -> None:
    design = Design("sensitivity", 8, 2, (1,))
    assert sensitivity_of(np.full(24, 3.0), design, ("a",))[0][1:] == (0.0,) * 6


@pytest.mark.parametrize(
    ("part", "shown"), [(0.0, "0.0 %"), (1.0, "100.0 %"), (0.99999, "99.999 %"), (0.4567, "45.7 %")]
)
def test_a_probability_is_not_rounded_to_certainty(part: float, shown: str) -> None:
    assert percent(part) == shown


def test_indices_come_from_the_first_base_points_that_are_there_whole(
    made: Callable[..., Campaign], tmp_path: Path
) -> None:
    """Of 8 base points of 3 rows: 20 rows are there from the first on, 6 base points, so 4 of them."""
    campaign = made(order='tests = ["move"]\noutputs = ["move_base_um"]\nsampling = "sensitivity"\ncount = 8')
    design = campaign.design
    values = unit_points(design, 0, 24)[:, 0] ** 2
    result = ResultFolder(tmp_path)
    head = result.begin(campaign)

    def write(first: int, end: int, refused: int = -1) -> None:
        rows = np.arange(first, end)
        figures = {
            "row": rows,
            "refused_by": np.where(rows == refused, "move", "").astype(object),
            "plant.load.inertia_kg_m2": values[first:end],
            "move_base_um": np.where(rows == refused, np.nan, values[first:end]),
        }
        result.write(head, Chunk(first, end - first), figures)

    write(0, 7)
    write(7, 20)
    found = population_of(result)
    assert found.base_points == 4
    assert found.figures[0].sensitivity == sensitivity_of(values[:12], design._replace(size=4), ("inertia",))
    assert found.figures[0].plants == 7
    write(20, 24, refused=22)
    assert population_of(result).base_points == 4
    result.merge(head)
    next(tmp_path.glob("rows-*.parquet")).unlink()
    write(0, 7)
    write(8, 24)
    assert population_of(result).base_points == 2
    write(7, 8)
    assert population_of(result).base_points == 8
