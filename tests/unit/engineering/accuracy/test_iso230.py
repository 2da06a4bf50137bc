"""ISO 230-2:2014 against a worked example and against what each layout can show."""

import numpy as np
import pytest

from gantryctl.engineering.accuracy.iso230 import iso230_2, position_series
from gantryctl.engineering.accuracy.paper import PAPER_TABLE
from gantryctl.engineering.accuracy.procedure.procedures import Chord, chord_procedure, evaluate
from gantryctl.engineering.accuracy.table import Direction, ErrorTable, Layout, RowKey, table_from_rows

UP = np.array([[1.0, 2.0, 3.0, 4.0, 5.0], [2.0, 2.0, 2.0, 2.0, 7.0]])
DOWN = np.array([[0.0, 0.0, 1.0, 0.0, -1.0], [9.0, 8.0, 7.0, 8.0, 8.0]])


def _table(up: np.ndarray, down: np.ndarray) -> ErrorTable:
    """Positions 5 and 10 deg from base 0, five runs; shape of the arguments (positions, runs)."""
    runs = up.shape[1]
    keys = [RowKey(0.0, way, run + 1) for way in Direction for run in range(runs)]
    errors = np.hstack([np.zeros((2 * runs, 1)), np.vstack([up.T, down.T])])
    return ErrorTable(tuple(keys), (0.0, 5.0, 10.0), errors)


def test_worked_example() -> None:
    """By hand: means up 3, 3 and down 0, 8; s up sqrt(2.5), sqrt(5), down sqrt(0.5), sqrt(0.5)."""
    s_up, s_down = np.sqrt([2.5, 5.0]), np.sqrt([0.5, 0.5])
    figures = iso230_2(_table(UP, DOWN))
    assert figures.not_computable is None
    assert figures.reversal_deg == pytest.approx(5.0)
    assert figures.mean_reversal_deg == pytest.approx((0.0 + 3.0 - 5.0) / 3.0)
    assert figures.repeatability_up_deg == pytest.approx(4.0 * s_up[1])
    assert figures.repeatability_down_deg == pytest.approx(4.0 * s_down[0])
    assert figures.repeatability_deg == pytest.approx(2.0 * s_up[1] + 2.0 * s_down[1] + 5.0)
    assert figures.systematic_up_deg == pytest.approx(3.0)
    assert figures.systematic_down_deg == pytest.approx(8.0)
    assert figures.systematic_deg == pytest.approx(8.0)
    assert figures.mean_bidirectional_deg == pytest.approx(5.5)
    assert figures.accuracy_up_deg == pytest.approx((3.0 + 2.0 * s_up[1]) - (3.0 - 2.0 * s_up[1]))
    assert figures.accuracy_down_deg == pytest.approx(8.0 + 4.0 * s_down[0])
    assert figures.accuracy_deg == pytest.approx((8.0 + 2.0 * s_down[1]) - (3.0 - 2.0 * s_up[1]))
    position = figures.positions[1]
    assert (position.base_deg, position.displacement_deg) == (0.0, 5.0)
    assert position.reversal_deg == pytest.approx(3.0)
    assert position.repeatability_deg == pytest.approx(max(2 * s_up[0] + 2 * s_down[0] + 3.0, 4 * s_up[0]))
    assert "procedure C" in figures.warnings[0]


def test_the_papers_table_has_no_iso_figures() -> None:
    figures = iso230_2(PAPER_TABLE)
    assert figures.not_computable == ("not computable: 1 run in each direction, ISO 230-2 needs 5")
    assert figures.accuracy_deg is None
    assert figures.positions == ()
    assert figures.warnings == ()


def test_four_runs_are_too_few() -> None:
    assert "4 runs" in str(iso230_2(_table(UP[:, :4], DOWN[:, :4])).not_computable)


def test_one_direction_is_not_enough() -> None:
    both = table_from_rows(
        [(0.0, "ccw", (0.0, 1.0)), (0.0, "cw", (0.0, 1.0)), (9.0, "cw", (0.0, 1.0))], (0, 5)
    )
    assert "base 9 deg" in str(iso230_2(both, min_runs=1).not_computable)
    one = table_from_rows([(0.0, "ccw", (0.0, 1.0))], (0.0, 5.0))
    assert "only ccw" in str(iso230_2(one, min_runs=1).not_computable)


def test_lost_motion_shows_as_reversal_in_procedure_c_only() -> None:
    """A slack of 0.01 deg: every stop reached going down stands 0.01 deg too high."""
    slack = 0.01
    for name, expected in (("C", slack), ("A", 0.0)):
        procedure = chord_procedure(name, bases_deg=[0.0], runs=5)
        targets = np.array([stop.target_deg for stop in procedure.stops])
        going_down = np.concatenate([[False], np.diff(targets) < 0.0])
        if name == "A":  # approached and measured in one direction: the slack is taken up before the base
            going_down = np.array([stop.direction is Direction.CW for stop in procedure.stops])
        table = evaluate(procedure, np.radians(targets + slack * going_down), 2.5)
        figures = iso230_2(table)
        assert figures.reversal_deg == pytest.approx(expected, abs=1e-12)
        assert figures.repeatability_up_deg == pytest.approx(0.0, abs=1e-12)
        assert figures.same_positions is (name == "C")


def test_the_turning_point_of_procedure_c_is_reached_from_below_only() -> None:
    procedure = chord_procedure("C", bases_deg=[0.0], runs=5)
    series = position_series(evaluate(procedure, procedure.targets_rad, 2.5))
    assert series.positions[-1] == (0.0, 20.0)
    assert np.isnan(series.down_deg[-1]).all()
    assert not np.isnan(series.down_deg[:-1]).any()
    figures = iso230_2(evaluate(procedure, procedure.targets_rad, 2.5))
    assert figures.positions[-1].reversal_deg is None
    assert figures.accuracy_deg == pytest.approx(0.0, abs=1e-12)
    assert figures.warnings == ()


def repeated(
    base: float, way: Direction, runs: int, errors: tuple[float, ...]
) -> list[tuple[RowKey, tuple[float, ...]]]:
    """The same row so many times: no scatter."""
    return [(RowKey(base, way, run + 1), errors) for run in range(runs)]


def table_of(
    series: list[tuple[RowKey, tuple[float, ...]]], displacements: tuple[float, ...], layout: Layout
) -> ErrorTable:
    return ErrorTable(
        tuple(key for key, _ in series), displacements, np.array([row for _, row in series]), layout
    )


def test_up_and_down_on_the_same_stops_by_hand() -> None:
    """Up 1, 2 and 4 too far at 5, 10 and 20 deg, so it turns at 24.

    Back by 5, 10 and 20 with errors of -1, 0 and 3: it stands at 20, 14 and 1. That is 4 beyond 10 and 1 beyond 0; 15
    is no stop of the way up, and 5 none of the way back.
    """
    up, down = (0.0, 1.0, 2.0, 4.0), (0.0, -1.0, 0.0, 3.0)
    series = repeated(0.0, Direction.CCW, 5, up) + repeated(0.0, Direction.CW, 5, down)
    figures = iso230_2(table_of(series, (0.0, 5.0, 10.0, 20.0), Layout.RETURN))
    assert [each.mean_up_deg for each in figures.positions] == [0.0, 1.0, 2.0, 4.0]
    assert [each.mean_down_deg for each in figures.positions] == [1.0, None, 4.0, None]
    # B is up less down: the axis stands too high on its way back.
    assert [each.reversal_deg for each in figures.positions] == [-1.0, None, -2.0, None]
    assert (figures.reversal_deg, figures.mean_reversal_deg) == (2.0, -1.5)
    assert (figures.repeatability_deg, figures.repeatability_up_deg) == (2.0, 0.0)
    # E: 0 to 4 up, 1 to 4 down; M: the means 0.5 and 3 of the two stops that both ways reach.
    assert (figures.systematic_up_deg, figures.systematic_down_deg, figures.systematic_deg) == (4.0, 3.0, 4.0)
    assert figures.mean_bidirectional_deg == 2.5
    assert (figures.accuracy_up_deg, figures.accuracy_down_deg, figures.accuracy_deg) == (4.0, 3.0, 4.0)
    assert figures.same_positions


def test_stops_of_tenths_of_a_degree_are_met_on_the_way_back() -> None:
    """0.3 - 0.1 is not 0.2 to the last bit."""
    displacements = (0.0, 0.1, 0.2, 0.3)
    series = [each for way in Direction for each in repeated(0.0, way, 5, (0.0, 1.0, 2.0, 3.0))]
    figures = iso230_2(table_of(series, displacements, Layout.RETURN))
    # Back by 0.1, 0.2 and 0.3 from 3 too far: 2, 1 and 0 are left.
    assert [each.mean_down_deg for each in figures.positions] == [0.0, 1.0, 2.0, None]
    assert figures.reversal_deg == 0.0


@pytest.mark.parametrize("layout", [Layout.APART, Layout.RETURN])
@pytest.mark.parametrize("base_more", [0.0, 90.0])
@pytest.mark.parametrize("ways_more", [(Direction.CCW,), (Direction.CW,), tuple(Direction)])
def test_a_series_that_was_repeated_once_more_is_cut(
    layout: Layout, base_more: float, ways_more: tuple[Direction, ...]
) -> None:
    """Five runs of everything, and a sixth of one base, one way or both, that is far off: it is in no figure."""
    series = []
    for base, error in ((0.0, 1.0), (90.0, 2.0)):
        for way in Direction:
            series += repeated(base, way, 5, (0.0, error))
            if base == base_more and way in ways_more:
                series.append((RowKey(base, way, 6), (0.0, 50.0)))
    figures = iso230_2(table_of(series, (0.0, 5.0), layout))
    assert [(each.base_deg, each.displacement_deg, each.mean_up_deg) for each in figures.positions] == [
        (0.0, 0.0, 0.0), (0.0, 5.0, 1.0), (90.0, 0.0, 0.0), (90.0, 5.0, 2.0),
    ]  # fmt: skip
    assert (figures.repeatability_deg, figures.reversal_deg) == (0.0, 0.0)


def test_steps_are_not_positions() -> None:
    procedure = chord_procedure("A", runs=5, chord=Chord.ADJACENT)
    assert procedure.layout is Layout.STEPS
    assert "single steps" in str(iso230_2(evaluate(procedure, procedure.targets_rad, 2.5)).not_computable)
