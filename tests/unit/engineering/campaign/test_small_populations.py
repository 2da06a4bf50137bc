"""Ranks of an interval from a printed table, and plants without figures."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from gantryctl.engineering.campaign.reading import load_campaign
from gantryctl.engineering.campaign.report.text import percent
from gantryctl.engineering.campaign.statistics import _plants, figure_statistics


def test_the_interval_of_a_median_of_100_has_the_ranks_of_the_tables() -> None:
    """Binomial 95 %: the 40th and the 61st value. The 5 % quantile: the first and the 11th."""
    found = figure_statistics("x", lambda: [np.arange(1.0, 101.0)], ())
    ends = {each.part: (each.low, each.high) for each in found.quantiles}
    assert ends[0.5] == (40.0, 61.0)
    assert ends[0.05] == (1.0, 11.0)


def test_a_plant_that_was_refused_has_no_figure() -> None:
    head = SimpleNamespace(outputs={"a_deg": None}, design=SimpleNamespace(sampling="random", widths=()))
    batch = {"a_deg": np.array([1.0, math.nan, 3.0]), "error": np.array([10.0, 20.0, 30.0])}
    rows = SimpleNamespace(head=head, batches=lambda names: [(0, {name: batch[name] for name in names})])
    assert [each.tolist() for each in _plants(rows, "error")] == [[10.0, 30.0]]  # type: ignore[arg-type]


def test_rows_of_another_drift_are_rows_of_another_campaign() -> None:
    made = load_campaign("compensations")
    assert made.drift
    assert replace(made, drift=made.drift[:-1]).hash != made.hash


def test_one_plant_in_thousands_that_breaks_a_limit_is_seen() -> None:
    assert [percent(part) for part in (0.99996, 0.00004, 1.0)] == ["99.996 %", "0.004 %", "100.0 %"]
