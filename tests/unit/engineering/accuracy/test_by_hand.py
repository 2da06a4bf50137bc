"""Figures of small tables computed by hand: where signs, n - 1 and the worse of two directions decide."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.accuracy.iso230 import iso230_2
from gantryctl.engineering.accuracy.statistics import a_by_direction, base_rms, statistics
from gantryctl.engineering.accuracy.table import Direction, ErrorTable, RowKey
from gantryctl.engineering.accuracy.verdict import (
    ChordFigures,
    Conformity,
    conformity_of,
    judge,
    judge_chords,
    worst_verdict,
)
from gantryctl.machine import Requirement

LIMIT = Requirement(0.01, "the test")


def one_base(ccw: list[float], cw: list[float]) -> ErrorTable:
    """Errors at 5 deg from base 0, one run each."""
    keys = [RowKey(0.0, Direction.CCW, run + 1) for run in range(len(ccw))]
    keys += [RowKey(0.0, Direction.CW, run + 1) for run in range(len(cw))]
    return ErrorTable(tuple(keys), (0.0, 5.0), np.array([[0.0, error] for error in (*ccw, *cw)]))


def test_a_direction_that_repeats_badly_does_not_hide_behind_the_other() -> None:
    """Up 0, 4, 0, -4, 0: s = sqrt(32 / 4), R up = 4 s = 11.3; down exact, B = 0: two times 2 s would be 5.7."""
    up, down = np.array([[0.0], [4.0], [0.0], [-4.0], [0.0]]), np.zeros((5, 1))
    keys = tuple(RowKey(0.0, way, run + 1) for way in Direction for run in range(5))
    for first, second in ((up, down), (down, up)):
        errors = np.hstack([np.zeros((10, 1)), np.vstack([first, second])])
        figures = iso230_2(ErrorTable(keys, (0.0, 5.0), errors))
        assert figures.positions[1].repeatability_deg == pytest.approx(4.0 * math.sqrt(8.0))
        assert figures.repeatability_deg == pytest.approx(4.0 * math.sqrt(8.0))
        assert figures.accuracy_deg == pytest.approx(4.0 * math.sqrt(8.0))


def test_a_of_four_rows() -> None:
    """Errors at 5 deg: ccw -3, -1, cw 1, 3. Mean 0, S = sqrt(20 / 3); directions apart: -2 and 2 with S = sqrt(2)."""
    table = one_base([-3.0, -1.0], [1.0, 3.0])
    found = statistics(table)
    assert found.a_deg == pytest.approx(6.0 * math.sqrt(20.0 / 3.0))
    assert found.a_by_direction_deg == pytest.approx(4.0 + 6.0 * math.sqrt(2.0))
    assert found.largest_deg == 3.0
    assert base_rms(table, 0.0) == pytest.approx(math.sqrt(5.0))


def test_a_base_of_which_nothing_else_was_measured_has_no_error() -> None:
    assert base_rms(ErrorTable((RowKey(0.0, Direction.CCW),), (0.0,), np.zeros((1, 1))), 0.0) == 0.0


def test_the_largest_error_may_be_negative_and_one_row_has_no_direction_of_its_own() -> None:
    table = one_base([-4.0], [1.0, 2.0])
    assert statistics(table).largest_deg == 4.0
    assert a_by_direction(table) is None


def test_the_scatter_of_the_second_direction_counts() -> None:
    """ccw exact, cw -1 and 1: S cw = sqrt(2), A with directions apart 6 sqrt(2)."""
    assert a_by_direction(one_base([0.0, 0.0], [-1.0, 1.0])) == pytest.approx(6.0 * math.sqrt(2.0))


# Binary fractions, so that the limit is met exactly.
@pytest.mark.parametrize(
    ("value", "expanded", "said"),
    [
        (1.0, 0.0, Conformity.PASS), (0.75, 0.25, Conformity.PASS), (0.75, 0.375, Conformity.UNDECIDED),
        (1.25, 0.25, Conformity.UNDECIDED), (1.375, 0.25, Conformity.FAIL), (1.0625, 0.0, Conformity.FAIL),
    ],
)  # fmt: skip
def test_what_a_figure_says_of_a_limit_of_1(value: float, expanded: float, said: Conformity) -> None:
    assert conformity_of(value, expanded, 1.0) is said


def test_the_worst_of_several_figures_decides() -> None:
    sure, open_, failed = {"a": 0.001}, {"b": 0.0095}, {"c": 0.02}
    assert judge(sure, LIMIT, {}).conformity is Conformity.PASS
    assert judge(sure | open_, LIMIT, {"b": 0.001}).conformity is Conformity.UNDECIDED
    assert judge(sure | open_ | failed, LIMIT, {"b": 0.001}).conformity is Conformity.FAIL


def test_a_short_procedure_is_judged_with_what_the_whole_one_may_show_and_the_angle_as_it_is() -> None:
    found = ChordFigures(0.004, 0.003, 0.0005, 0.0004, largest_angle_deg=0.001)
    verdict = judge_chords(found, LIMIT, whole_ratio=2.0)
    assert sorted(verdict.figures_deg.values()) == pytest.approx([0.001, 0.006, 0.008])
    assert sorted(verdict.uncertainties_deg.values()) == pytest.approx([0.0008, 0.001])
    assert verdict.conformity is Conformity.PASS
    assert judge_chords(found, LIMIT, whole_ratio=2.4).conformity is Conformity.UNDECIDED
    lost_turn = ChordFigures(0.004, 0.003, largest_angle_deg=0.3)
    assert judge_chords(lost_turn, LIMIT).conformity is Conformity.FAIL


def test_a_verdict_names_its_figures_and_whose_they_are() -> None:
    found = ChordFigures(0.004, 0.003, 0.0005, largest_angle_deg=0.001)
    assert list(judge_chords(found, LIMIT).figures_deg) == [
        "A as measured", "largest chord error", "largest angle error at a stop",
    ]  # fmt: skip
    short = judge_chords(found, LIMIT, whole_ratio=1.5, of="hust_gantry")
    assert short.figures_deg == {
        "hust_gantry: A as measured of the whole test, at most": pytest.approx(0.006),
        "hust_gantry: largest chord error of the whole test, at most": pytest.approx(0.0045),
        "hust_gantry: largest angle error at a stop": 0.001,
    }
    assert short.uncertainties_deg == {
        "hust_gantry: A as measured of the whole test, at most": pytest.approx(0.00075)
    }
    assert short.text == (
        "hust_gantry: A as measured of the whole test, at most 0.0060 +- 0.0008 deg, hust_gantry: largest chord error "
        "of the whole test, at most 0.0045 deg, hust_gantry: largest angle error at a stop 0.0010 deg: within 0.01 "
        "deg; required by the test"
    )
    assert short.required is LIMIT
    assert (short.passed, judge_chords(ChordFigures(1.0, 1.0), LIMIT).passed) == (True, False)
    assert judge({"a": 0.0099}, LIMIT, {"a": 0.001}).passed is None


def test_of_two_failures_the_one_that_may_lie_farthest_out_is_told() -> None:
    """0.030 +- 0.005 may be 0.035; 0.031 and nothing beside it is 0.031. One that fails stands before all of them."""
    unsure, sure = judge({"a": 0.030}, LIMIT, {"a": 0.005}), judge({"b": 0.031}, LIMIT, {})
    near, sound = judge({"c": 0.2}, LIMIT, {"c": 0.195}), judge({"d": 0.009}, LIMIT, {})
    assert worst_verdict([sure, unsure, near, sound]) is unsure
    assert worst_verdict([sound, near]) is near
    # Of the figures of one verdict the largest counts: its smallest is told in every test.
    one, two = judge({"a": 0.05, "b": 0.011}, LIMIT, {}), judge({"a": 0.03, "b": 0.02}, LIMIT, {})
    assert worst_verdict([two, one]) is one
