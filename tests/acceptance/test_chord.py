"""The +-90/0 deg chord test of the paper on the reference gantry."""

from collections.abc import Callable
from typing import Final

import numpy as np
import pytest

from acceptance.bench import PLANT_TOLERANCE, Bench, ChordRun, chord_is_green, gantry, within
from gantryctl.engineering.accuracy.procedure.on_batch import random_gear, run_procedure
from gantryctl.engineering.accuracy.procedure.procedures import WHOLE_BY_SHORT, chord_procedure, evaluate
from gantryctl.engineering.accuracy.report.report import AccuracyReport
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.machine import default_machine

SHORT_TEST_GEARS: Final = 120
STICTION_DEG = 0.0002
"""A single error may move by a quarter of what roller friction can hold against the transmission at rest,
6.8 kN m / 5.1e8 N m/rad = 0.0008 deg: which part of it stays is decided by the last half swing of the load."""

STATISTICS_DEG = 0.0002
"""Percentiles of A over 500 noise draws scatter by 5e-5 (median) to 9e-5 deg (5 and 95 %; standard errors for a spread
of 0.0009 deg), and the reference is rounded to 1e-4: two of the one and half of the other."""


def test_a_of_the_reference_gear_is_0_011_deg_without_noise(reference: ChordRun) -> None:
    assert chord_is_green(reference.a_deg), f"A = {reference.a_deg:.5f} deg"


def test_the_report_shows_the_table_of_its_angles(report: AccuracyReport, reference: ChordRun) -> None:
    assert report.true is not None
    # the reference is made of the angles again: nothing but the rounding of radians and degrees
    assert report.true.errors_deg == pytest.approx(reference.table.errors_deg, abs=1e-11)


def test_a_as_measured_is_the_median_and_the_range_of_the_reference(report: AccuracyReport) -> None:
    seen = report.a_measured
    assert seen is not None
    assert seen.draws == 500
    # the plant's 15 % on the level; the width is noise and little else
    assert within(seen.median_deg, 0.0111)
    assert within(seen.low_deg, 0.0096)
    assert within(seen.high_deg, 0.0126)
    assert seen.high_deg - seen.low_deg == pytest.approx(0.0126 - 0.0096, abs=2.0 * STATISTICS_DEG)


def test_the_tracker_alone_gives_a_floor_of_0_0024_deg(report: AccuracyReport) -> None:
    # no plant in this figure, so only statistics and rounding are allowed
    floor = report.a_floor
    assert floor is not None
    assert floor.median_deg == pytest.approx(0.0024, abs=STATISTICS_DEG)
    assert floor.low_deg == pytest.approx(0.0017, abs=STATISTICS_DEG)
    assert floor.high_deg == pytest.approx(0.0033, abs=STATISTICS_DEG)


@pytest.mark.parametrize(
    ("procedure", "a_deg"), [("B", 0.0114), ("C", 0.0098), pytest.param("D", 0.0113, marks=pytest.mark.slow)]
)
def test_the_other_procedures_give_the_a_of_the_reference(bench: Bench, procedure: str, a_deg: float) -> None:
    found = bench.chord(default_machine(), procedure).a_deg
    assert within(found, a_deg), f"A = {found:.5f} deg"


@pytest.mark.slow
def test_the_whole_test_finds_at_most_so_many_times_what_the_short_one_finds(
    evidence: Callable[[str, dict[str, object]], None],
) -> None:
    """Gears of the same grade, phases drawn at random: quantiles of procedure A by procedure E."""
    machine, whole, short = default_machine(), chord_procedure("A"), chord_procedure("E")
    gears = [random_gear(machine, seed) for seed in range(1, SHORT_TEST_GEARS + 1)]
    figures = []
    for procedure in (whole, short):
        angles = run_procedure(gears, procedure).load_rad
        tables = np.array([evaluate(procedure, row, 2.5).errors_deg for row in angles])
        figures.append((accuracy_a(tables), np.abs(tables).max(axis=(1, 2))))
    ratios = np.array(figures[0]).T / np.array(figures[1]).T
    middle, high, most = np.quantile(ratios, (0.5, 0.95, 1.0), axis=0).tolist()
    names = ("a", "largest_chord_error")
    quantiles = {
        name: {"median": middle[k], "95 %": high[k], "largest": most[k]} for k, name in enumerate(names)
    }
    evidence("short_chord_test", {"gears": SHORT_TEST_GEARS, "whole by short": quantiles})
    assert max(high) <= WHOLE_BY_SHORT
    # Not on the safe side by far: the factor is what the gears need.
    assert max(high) > 0.9 * WHOLE_BY_SHORT


def test_rms_per_base_has_the_pattern_of_the_reference(reference: ChordRun) -> None:
    rms = reference.rms_deg
    for base, expected in {90.0: 0.0013, 0.0: 0.0008, -90.0: 0.0019}.items():
        assert rms[base] == pytest.approx(expected, rel=PLANT_TOLERANCE, abs=STICTION_DEG / 2.0)
    assert rms[-90.0] > rms[90.0] > rms[0.0]


def test_smallest_and_largest_error_are_those_of_the_reference(reference: ChordRun) -> None:
    at_0, at_90 = reference.table.select([0.0]), reference.table.select([90.0, -90.0])
    ends = (at_0.min(), at_0.max(), at_90.min(), at_90.max())
    assert ends == pytest.approx((-0.0016, 0.0005, -0.0012, 0.0031), rel=PLANT_TOLERANCE, abs=STICTION_DEG)


def test_without_gear_error_a_is_0_0040_deg_and_90_is_better_than_0(bench: Bench) -> None:
    # eccentric wind-up and friction alone: the moment changes least at +-90, the opposite of the paper's pattern
    run = bench.chord(gantry(plant__switches__gear_error=False))
    assert within(run.a_deg, 0.0040), f"A = {run.a_deg:.5f} deg"
    assert run.rms_deg[0.0] == pytest.approx(0.0011, rel=PLANT_TOLERANCE)
    assert run.rms_deg[90.0] == pytest.approx(0.0002, abs=STICTION_DEG / 2.0)
    assert run.rms_deg[-90.0] == pytest.approx(0.0002, abs=STICTION_DEG / 2.0)
    assert 2.0 * run.rms_at_90_deg < run.rms_deg[0.0]  # 5 times in the reference


def test_the_requirement_of_0_1_deg_is_met(report: AccuracyReport) -> None:
    verdict = report.verdict
    assert verdict.passed is True
    assert set(verdict.figures_deg) == {
        "A as measured",
        "largest chord error",
        "largest angle error at a stop",
    }
    assert verdict.required is not None
    assert verdict.required.limit == 0.1
    # everything is an order of magnitude inside: gear, wind-up and noise are some 0.01 deg together
    assert max(verdict.figures_deg.values()) < 0.02
