"""Figures of a step and their limits: what is outside, or was not measured, lets no step pass."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.commissioning import Figure, Outcome, Progress, write_report
from gantryctl.commissioning.results import at_most, judged, load_progress, passed, store_progress
from support.reports import HEAD

PROGRESS = Progress("m", "0" * 64)


@pytest.mark.parametrize(
    ("figure", "within"),
    [
        (Figure(1.0), True),
        (Figure(None), True),
        (Figure(1.0, high=1.0), True),
        (Figure(1.1, high=1.0), False),
        (Figure(0.9, low=1.0), False),
        (Figure(1.0, low=1.0), True),
        (Figure(1.0, 0.8, 1.2), True),
        (Figure(None, high=1.0), False),
        (Figure(math.nan, high=1.0), False),
        (Figure(math.nan, low=1.0), False),
    ],
)
def test_a_figure_is_held_against_its_limits(figure: Figure, within: bool) -> None:
    assert figure.within is within


def test_a_figure_outside_of_its_limits_fails_the_step_whatever_else_was_seen() -> None:
    result = judged(True, "sync", "seen", "do this", answer_p99_ms=Figure(3.1, high=3.0))
    assert (result.outcome, result.to_do) == (Outcome.FAILED, "do this")
    result = judged(True, "sync", "seen", "do this", answer_p99_ms=Figure(2.9, high=3.0))
    assert (result.outcome, result.to_do) == (Outcome.PASSED, "")


def test_a_result_has_lasted_nothing_until_somebody_has_measured_it() -> None:
    result = passed("sync", "seen")
    assert (result.seconds, result.axis_s, result.at, result.by) == (0.0, 0.0, "", "")


def test_what_is_not_finite_was_not_measured() -> None:
    result = passed("sync", "seen", answer_p50_ms=math.nan)
    assert result.figures["answer_p50_ms"].value is None
    assert judged(True, "sync", "seen", "", t_ms=Figure(math.inf, low=1.0)).outcome is Outcome.FAILED


def test_figures_come_back_from_the_file(tmp_path: Path) -> None:
    result = passed("sync", "seen", answer_p50_ms=math.nan, answer_p99_ms=Figure(2.5, high=3.0))
    store_progress(tmp_path / "p.json", replace(PROGRESS, results={"sync": result}))
    kept = load_progress(tmp_path / "p.json")
    assert kept is not None
    assert kept.results["sync"] == result


def test_the_report_has_the_limit_beside_the_figure(tmp_path: Path) -> None:
    result = passed("sync", "seen", answer_p99_ms=Figure(2.5, high=3.0), dead_scans=2.0)
    page = write_report(replace(PROGRESS, results={"sync": result}), (), tmp_path, HEAD).read_text(
        encoding="utf-8"
    )
    assert (
        '<td>answer p99</td><td class="pass">2.5</td><td>ms</td><td>at most 3</td><td class="pass">within</td>'
        in page
    )
    assert '<td>dead scans</td><td class="">2</td>' in page


@pytest.mark.parametrize(
    ("permitted", "said"),
    [
        (0.204, "0.21"),
        (0.2, "0.2"),
        (0.05, "0.05"),
        (0.1885, "0.19"),
        (0.0021, "0.0021"),
        (0.00211, "0.0022"),
        (0.997, "1"),
    ],
)
def test_what_is_permitted_is_never_told_smaller_than_it_is(permitted: float, said: str) -> None:
    assert at_most(permitted) == said
