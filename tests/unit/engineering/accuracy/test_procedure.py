"""The chord procedures and their evaluation."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.engineering.accuracy.noise import a_draws, chord_result, noise_floor
from gantryctl.engineering.accuracy.procedure.procedures import (
    Chord,
    Procedure,
    StopRole,
    chord_procedure,
    evaluate,
)
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.accuracy.table import Direction
from gantryctl.errors import UsageError

RADIUS_M = 2.5
SIGMA_M = 10e-6


def _targets(procedure: Procedure) -> list[float]:
    return [stop.target_deg for stop in procedure.stops]


def test_procedure_a_is_the_papers() -> None:
    procedure = chord_procedure("A")
    assert len(procedure.stops) == 36
    assert _targets(procedure)[:12] == [80, 90, 95, 100, 105, 110, 100, 90, 85, 80, 75, 70]
    assert procedure.start_deg == 80.0
    assert procedure.travel_deg == (-110.0, 110.0)
    assert [stop.role for stop in procedure.stops[:3]] == [StopRole.START, StopRole.BASE, StopRole.POINT]
    assert [stop.reference for stop in procedure.stops[:8]] == [None, None, 1, 1, 1, 1, None, None]
    assert procedure.rows[:3] == ((90.0, Direction.CCW, 1), (90.0, Direction.CW, 1), (0.0, Direction.CCW, 1))


def test_procedure_b_measures_from_the_base_visited_just_before() -> None:
    procedure = chord_procedure("B", bases_deg=[0.0])
    assert _targets(procedure)[:9] == [0, 5, 0, 10, 0, 15, 0, 20, 0]
    assert [stop.reference for stop in procedure.stops if stop.role is StopRole.POINT] == [
        0,
        2,
        4,
        6,
        9,
        11,
        13,
        15,
    ]


def test_procedure_c_comes_back_over_its_own_stops() -> None:
    procedure = chord_procedure("C", bases_deg=[0.0])
    assert _targets(procedure) == [-10, 0, 5, 10, 15, 20, 15, 10, 5, 0]
    back = procedure.stops[6:]
    assert {stop.reference for stop in back} == {5}
    assert [stop.displacement_deg for stop in back] == [5, 10, 15, 20]
    assert {stop.direction for stop in back} == {Direction.CW}


def test_procedure_d_always_comes_from_below() -> None:
    procedure = chord_procedure("D", bases_deg=[0.0])
    targets = _targets(procedure)
    assert targets[:3] == [-5, 0, 5]
    assert targets[12:15] == [-5, 0, -5]
    assert all(
        targets[k - 1] == targets[k] - 5 for k, s in enumerate(procedure.stops) if s.role is StopRole.BASE
    )


def test_adjacent_chords_are_single_steps() -> None:
    procedure = chord_procedure("A", bases_deg=[0.0], chord=Chord.ADJACENT)
    step = np.radians(0.01)
    readings = procedure.targets_rad.copy()
    readings[3] += step  # the stop at 10 deg is too far: the step to it too long, the step from it too short
    table = evaluate(procedure, readings, RADIUS_M)
    np.testing.assert_allclose(table.errors_deg[0], [0.0, 0.0, 0.01, -0.01, 0.0], atol=1e-12)
    from_base = evaluate(chord_procedure("A", bases_deg=[0.0]), readings, RADIUS_M)
    np.testing.assert_allclose(from_base.errors_deg[0], [0.0, 0.0, 0.01, 0.0, 0.0], atol=1e-12)


def test_the_short_procedure_reaches_every_base_from_both_sides_without_a_way_back() -> None:
    procedure = chord_procedure("E")
    assert _targets(procedure) == [0, 90, 105, 90, 75, 0, -15, 0, 15, -90, -105, -90, -75]
    assert len(procedure.rows) == 6
    assert procedure.whole_ratio > 1.0
    table = evaluate(procedure, procedure.targets_rad, RADIUS_M)
    np.testing.assert_allclose(table.errors_deg, 0.0, atol=1e-12)


@pytest.mark.parametrize("bases", [(90.0, 75.0), (-90.0, -80.0), (0.0,), (20.0, 10.0, 35.0)])
def test_the_short_procedure_takes_up_lost_motion_at_every_base(bases: tuple[float, ...]) -> None:
    """A base is reached from 10 deg away at least, in the direction of its series."""
    procedure = chord_procedure("E", bases_deg=bases)
    for before, stop in pairwise(procedure.stops):
        if stop.role is StopRole.BASE:
            assert stop.direction.sign * (stop.target_deg - before.target_deg) >= 10.0


@pytest.mark.parametrize("chord", list(Chord))
@pytest.mark.parametrize("name", list("ABCD"))
def test_a_perfect_axis_has_no_error(name: str, chord: Chord) -> None:
    procedure = chord_procedure(name, runs=2, chord=chord)
    table = evaluate(procedure, procedure.targets_rad, RADIUS_M)
    assert table.errors_deg.shape == (12, 5)
    assert table.runs == 2
    np.testing.assert_allclose(table.errors_deg, 0.0, atol=1e-12)


@given(
    name=st.sampled_from("ABCD"),
    seed=st.integers(0, 2**32 - 1),
    radius=st.floats(0.1, 10.0),
)
def test_noise_off_gives_the_exact_angles(name: str, seed: int, radius: float) -> None:
    """Errors equal the differences of the readings, whatever the radius."""
    procedure = chord_procedure(name)
    wrong = np.random.default_rng(seed).normal(0.0, 1e-3, len(procedure.stops))
    table = evaluate(procedure, procedure.targets_rad + np.radians(wrong), radius)
    seen = {(*row, d): table.errors_deg[k, j] for k, row in enumerate(table.rows)
            for j, d in enumerate(table.displacements_deg)}  # fmt: skip
    for k, stop in enumerate(procedure.stops):
        if stop.reference is not None:
            expected = stop.direction.sign * (wrong[k] - wrong[stop.reference])
            key = (stop.base_deg, stop.direction, stop.run, stop.displacement_deg)
            assert seen[key] == pytest.approx(expected, abs=1e-11)


def test_tracker_noise_floor() -> None:
    """Noise alone, 10 um at 2.5 m: 0.0024 deg, 5..95 % 0.0017..0.0033."""
    floor = noise_floor(chord_procedure("A"), RADIUS_M, SIGMA_M)
    assert floor.draws == 500
    assert floor.median_deg == pytest.approx(0.0024, abs=1e-4)
    assert floor.low_deg == pytest.approx(0.0017, abs=1e-4)
    assert floor.high_deg == pytest.approx(0.0033, abs=1.5e-4)


def test_the_floor_scales_with_noise_over_radius() -> None:
    procedure = chord_procedure("A")
    one = noise_floor(procedure, RADIUS_M, SIGMA_M).median_deg
    assert noise_floor(procedure, RADIUS_M, 2 * SIGMA_M).median_deg == pytest.approx(2 * one, rel=1e-3)
    assert noise_floor(procedure, 2 * RADIUS_M, SIGMA_M).median_deg == pytest.approx(one / 2, rel=1e-3)


def test_noise_on_and_off_are_kept_apart() -> None:
    procedure = chord_procedure("A")
    readings = procedure.targets_rad + 1e-5 * np.sin(7 * procedure.targets_rad)
    result = chord_result(procedure, readings, RADIUS_M, SIGMA_M, seed=3)
    assert result.true == evaluate(procedure, readings, RADIUS_M)
    assert result.measured == evaluate(procedure, readings, RADIUS_M, SIGMA_M, seed=3)
    assert result.measured != result.true
    assert result.a_floor == noise_floor(procedure, RADIUS_M, SIGMA_M, seed=3)
    draws = a_draws(procedure, readings, RADIUS_M, SIGMA_M, seed=3)
    assert result.a_measured.median_deg == np.median(draws)
    quiet = a_draws(procedure, readings, RADIUS_M, 0.0, draws=2)
    np.testing.assert_allclose(quiet, accuracy_a(result.true.errors_deg), rtol=1e-12)


def test_one_draw_equals_the_evaluation_with_its_seed() -> None:
    procedure = chord_procedure("B")
    one = a_draws(procedure, procedure.targets_rad, RADIUS_M, SIGMA_M, draws=1, seed=8)
    table = evaluate(procedure, procedure.targets_rad, RADIUS_M, SIGMA_M, seed=8)
    assert one[0] == accuracy_a(table.errors_deg)


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ({"name": "F"}, "there are A, B, C, D, E"),
        ({"runs": 0}, "at least 1"),
        ({"bases_deg": []}, "at least one"),
        ({"bases_deg": [float("nan")]}, "at least one"),
        ({"bases_deg": [0.0, 0.0]}, "twice"),
        ({"displacements_deg": []}, "ascending"),
        ({"displacements_deg": [5.0, 5.0]}, "ascending"),
        ({"displacements_deg": [-5.0]}, "ascending"),
        ({"displacements_deg": [5.0, 180.0]}, "below 180"),
        ({"displacements_deg": [float("nan")]}, "ascending"),
    ],
)
def test_a_procedure_that_cannot_be_is_refused(arguments: dict[str, object], what: str) -> None:
    with pytest.raises(UsageError, match=what):
        chord_procedure(**arguments)


@pytest.mark.parametrize(("readings", "what"), [([0.0], "1 readings for the 36"), ([np.nan] * 36, "finite")])
def test_readings_that_do_not_fit_are_refused(readings: list[float], what: str) -> None:
    with pytest.raises(UsageError, match=what):
        evaluate(chord_procedure("A"), readings, RADIUS_M)
