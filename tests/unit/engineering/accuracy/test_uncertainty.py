"""Uncertainty of a chord test, and what it does to a verdict."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure, evaluate
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.accuracy.uncertainty import COVERAGE_K, chord_uncertainty
from gantryctl.engineering.accuracy.verdict import Conformity, judge
from gantryctl.engineering.instruments import SimulatedTracker, TrackerErrors
from gantryctl.machine import Requirement

REQUIRED = Requirement(0.1, "dish", "tender 4711")
PROCEDURE = chord_procedure("A")
WAVY_DEG = np.degrees(
    PROCEDURE.targets_rad
    + 3e-5 * np.sin(9.0 * PROCEDURE.targets_rad + 1.0)
    + 1.5e-5 * np.sin(26.0 * PROCEDURE.targets_rad + 2.0)
)
"""An axis with the gear error of the other tests."""


def errors(angles_deg: np.ndarray) -> np.ndarray:
    return evaluate(PROCEDURE, np.radians(angles_deg), 1.0).errors_deg


def test_a_chord_has_the_uncertainty_of_its_two_ends() -> None:
    each = np.linspace(1e-4, 4e-4, len(WAVY_DEG))
    found = chord_uncertainty(PROCEDURE, WAVY_DEG, each).chord_deg
    for index, stop in enumerate(PROCEDURE.stops):
        if stop.reference is None:
            continue
        row = [(r.base_deg, r.direction) for r in PROCEDURE.rows].index((stop.base_deg, stop.direction))
        column = 1 + PROCEDURE.displacements_deg.index(stop.displacement_deg)
        # Central differences of angles of some 1e-7 deg: six digits are left.
        assert found[row, column] == pytest.approx(math.hypot(each[index], each[stop.reference]), rel=1e-5)
    assert np.all(found[:, 0] == 0.0)


def test_a_of_independent_noise_spreads_as_stated() -> None:
    """The linear propagation against draws: 0.0001 deg of noise over errors of 0.003 deg turn no maximum."""
    sigma = np.full(len(WAVY_DEG), 1e-4)
    stated = chord_uncertainty(PROCEDURE, WAVY_DEG, sigma).a_deg
    rng = np.random.default_rng(1)
    drawn = [float(accuracy_a(errors(WAVY_DEG + rng.normal(0.0, 1e-4, len(WAVY_DEG))))) for _ in range(800)]
    # 800 draws give a standard deviation to 2.5 %; the rest is curvature.
    assert np.std(drawn) == pytest.approx(stated, rel=0.1)


def test_the_expanded_uncertainty_covers_the_errors_of_a_tracker() -> None:
    """Over many set-ups, with errors that all readings share: at least 95 % of chords and of A lie inside k = 2."""
    true, true_a = errors(WAVY_DEG), float(accuracy_a(errors(WAVY_DEG)))
    a_inside, chords_inside = [], []
    for seed in range(100):
        stop = iter(WAVY_DEG.tolist())
        tracker = SimulatedTracker(lambda _, stop=stop: next(stop), seed, TrackerErrors())
        readings = [tracker.read(25.0 * k) for k in range(len(WAVY_DEG))]
        angles, each = (np.array(column) for column in zip(*readings, strict=True))
        known = chord_uncertainty(PROCEDURE, angles, each)
        a_inside.append(abs(float(accuracy_a(errors(angles))) - true_a) <= COVERAGE_K * known.a_deg)
        chords_inside.append(np.abs(errors(angles) - true)[:, 1:] <= COVERAGE_K * known.chord_deg[:, 1:])
    assert np.mean(chords_inside) >= 0.95
    assert np.mean(a_inside) >= 0.95


def test_the_floor_is_what_a_perfect_axis_would_show() -> None:
    known = chord_uncertainty(PROCEDURE, np.degrees(PROCEDURE.targets_rad), np.full(len(WAVY_DEG), 2.3e-4))
    # docs/explanation/accuracy.md: 10 um at 2.5 m, 2.3e-4 deg, have a floor of 0.0024 deg, 0.0017 to 0.0033.
    assert known.floor.median_deg == pytest.approx(0.0024, abs=2e-4)


def test_readings_that_are_less_certain_scatter_and_are_not_shifted() -> None:
    """Those at 5 deg alone, six chords: the median of S of six draws is sqrt(4.351 / 5) u, and A is six of them."""
    u = np.array([1e-4 if stop.displacement_deg == 5.0 else 0.0 for stop in PROCEDURE.stops])
    known = chord_uncertainty(PROCEDURE, np.degrees(PROCEDURE.targets_rad), u)
    # A base that is certain leaves a chord the error of its own reading.
    assert known.largest_chord_deg == pytest.approx(1e-4, rel=1e-5)
    # A median of 500 draws of S is known to 1.9 %.
    assert known.floor.median_deg == pytest.approx(6.0 * 0.9329 * 1e-4, rel=0.06)


@pytest.mark.parametrize(
    ("value", "expanded", "conformity"),
    [
        (0.08, 0.01, Conformity.PASS),
        (0.1, 0.0, Conformity.PASS),
        (0.095, 0.01, Conformity.UNDECIDED),
        (0.105, 0.01, Conformity.UNDECIDED),
        (0.12, 0.01, Conformity.FAIL),
        (math.nan, 0.01, Conformity.FAIL),
        (0.08, math.nan, Conformity.FAIL),
    ],
)
def test_a_verdict_needs_the_whole_uncertainty_on_one_side(
    value: float, expanded: float, conformity: Conformity
) -> None:
    verdict = judge({"A": value}, REQUIRED, {"A": expanded})
    assert verdict.conformity is conformity
    assert verdict.passed is {Conformity.PASS: True, Conformity.FAIL: False}.get(conformity)


def test_the_worst_figure_decides_and_is_told() -> None:
    verdict = judge({"A": 0.02, "chord": 0.098}, REQUIRED, {"chord": 0.004})
    assert verdict.text == (
        "chord 0.0980 +- 0.0040 deg: 0.1 deg lies within the uncertainty, so this is neither passed nor failed; "
        "required by dish (tender 4711)"
    )
    verdict = judge({"A": 0.2, "chord": 0.098}, REQUIRED, {"chord": 0.004})
    assert verdict.text == "A 0.2000 deg: outside 0.1 deg; required by dish (tender 4711)"


def test_the_floor_is_that_of_an_axis_without_error() -> None:
    """Whatever the axis has shown: 0.003 deg of its waves, beside 1e-5 deg of the readings."""
    sigma = np.full(len(WAVY_DEG), 1e-5)
    wavy, perfect = (
        chord_uncertainty(PROCEDURE, angles, sigma).floor
        for angles in (WAVY_DEG, np.degrees(PROCEDURE.targets_rad))
    )
    assert wavy == perfect
    assert wavy.median_deg < 2e-4
    # The same draws each time, unless others are asked for.
    seeds = [chord_uncertainty(PROCEDURE, WAVY_DEG, sigma, *seed).floor for seed in ((), (0,), (1,))]
    assert seeds[0] == seeds[1] != seeds[2]
    assert seeds[0].draws == 500
