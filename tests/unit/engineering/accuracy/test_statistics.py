"""Eq. (6) and the figures of table 2."""

import numpy as np
import pytest

from gantryctl.engineering.accuracy import paper
from gantryctl.engineering.accuracy.paper import (
    PAPER_A_DEG,
    PAPER_LOWER_DEG,
    PAPER_MEAN_DEG,
    PAPER_TABLE,
    PAPER_THREE_S_DEG,
    PAPER_UPPER_DEG,
)
from gantryctl.engineering.accuracy.statistics import a_by_direction, accuracy_a, statistics
from gantryctl.engineering.accuracy.table import Direction, ErrorTable, RowKey, table_from_rows
from gantryctl.errors import UsageError
from gantryctl.machine import configs_folder


def test_the_papers_table_gives_the_papers_figure() -> None:
    figures = statistics(PAPER_TABLE)
    assert round(figures.a_deg, 4) == PAPER_A_DEG
    assert figures.n == 6
    assert figures.reversal_pooled
    assert any("reversal" in warning for warning in figures.warnings)
    assert max(figures.upper_deg) == pytest.approx(PAPER_UPPER_DEG, abs=5e-5)
    assert min(figures.lower_deg) == pytest.approx(PAPER_LOWER_DEG, abs=5e-5)
    np.testing.assert_allclose(figures.mean_deg, PAPER_MEAN_DEG, atol=5e-5)
    # 5 deg recomputes to .00198; the paper prints .0019: inside the rounding of its rows
    np.testing.assert_allclose(figures.three_s_deg, PAPER_THREE_S_DEG, atol=1e-4)


def test_the_papers_table_is_that_of_the_file_beside_the_examples() -> None:
    """Both were typed from the print."""
    table = paper.PAPER_TABLE
    lines = (configs_folder() / "examples" / "paper_table2.csv").read_text(encoding="utf-8").splitlines()[1:]
    printed = {
        (float(base), way, float(d)): float(error) for base, way, d, error in (x.split(",") for x in lines)
    }
    assert printed == {
        (row.base_deg, row.direction.value, d): table.errors_deg[k, column]
        for k, row in enumerate(table.rows)
        for column, d in enumerate(table.displacements_deg)
    }


def test_directions_kept_apart_give_a_larger_figure() -> None:
    assert a_by_direction(PAPER_TABLE) == pytest.approx(0.0146, abs=5e-5)


def test_the_zero_column_belongs_to_a() -> None:
    """Errors that are all the same and far from zero: only the zero column makes A of them."""
    rows = [(base, way, (0.0, 1.0)) for base in (90.0, 0.0) for way in ("ccw", "cw")]
    assert statistics(table_from_rows(rows, (0.0, 5.0))).a_deg == 1.0


def test_an_ensemble_of_tables_is_one_call() -> None:
    errors = np.stack([PAPER_TABLE.errors_deg, 2.0 * PAPER_TABLE.errors_deg])
    a = accuracy_a(errors)
    assert a.shape == (2,)
    assert a[1] == pytest.approx(2.0 * a[0], rel=1e-12)


def test_one_direction_has_no_reversal_and_no_figure_by_direction() -> None:
    figures = statistics(table_from_rows([(0.0, "ccw", (0.0, 1e-3)), (90.0, "ccw", (0.0, 2e-3))], (0.0, 5.0)))
    assert not figures.reversal_pooled
    assert figures.a_by_direction_deg is None
    assert figures.warnings == ("S comes from 2 rows only; three bases both ways give six",)


@pytest.mark.parametrize(("count", "few"), [(5, True), (6, False)])
def test_s_of_less_than_six_rows_is_said(count: int, few: bool) -> None:
    rows = [(float(base), "ccw", (0.0, 1e-3)) for base in range(count)]
    warnings = statistics(table_from_rows(rows, (0.0, 5.0))).warnings
    assert warnings == ((f"S comes from {count} rows only; three bases both ways give six",) if few else ())


def test_one_row_is_refused() -> None:
    with pytest.raises(UsageError, match="at least 2 rows"):
        statistics(table_from_rows([(0.0, "ccw", (0.0, 1e-3))], (0.0, 5.0)))


@pytest.mark.parametrize(
    ("rows", "columns", "errors", "what"),
    [
        (1, (0.0, 5.0), [[0.0]], "values for"),
        (1, (5.0, 10.0), [[0.0, 0.0]], "0 deg as its first"),
        (1, (0.0, 5.0, 5.0), [[0.0, 0.0, 0.0]], "ascend"),
        (1, (0.0, 5.0), [[0.0, np.nan]], "finite"),
        (1, (0.0, 5.0), [[1e-3, 0.0]], "zero column"),
        (1, (0.0, 5.0), [[-1e-3, 0.0]], "zero column"),
        (2, (0.0, 5.0), [[0.0, 0.0], [0.0, 0.0]], "twice"),
        (0, (0.0, 5.0), np.zeros((0, 2)), "at least one row"),
    ],
)
def test_a_table_that_cannot_be_is_refused(
    rows: int, columns: tuple[float, ...], errors: object, what: str
) -> None:
    with pytest.raises(UsageError, match=what):
        ErrorTable((RowKey(0.0, Direction.CCW),) * rows, columns, np.array(errors))


def test_a_table_cannot_be_changed() -> None:
    values = np.zeros((1, 2))
    table = ErrorTable((RowKey(0.0, Direction.CCW),), (0.0, 5.0), values)
    values[0, 1] = 1.0
    assert table.errors_deg[0, 1] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        table.errors_deg[0, 1] = 1.0
    assert table == ErrorTable((RowKey(0.0, Direction.CCW),), (0.0, 5.0), np.zeros((1, 2)))
    assert table != PAPER_TABLE
    assert table.runs == 1


def test_each_base_of_the_paper_has_its_own_range() -> None:
    assert statistics(PAPER_TABLE).range_deg == {
        90.0: (-0.0012, 0.003),
        0.0: (-0.0016, 0.0005),
        -90.0: (-0.0005, 0.0042),
    }


def test_a_table_has_the_runs_of_its_least_measured_series() -> None:
    rows = (RowKey(0.0, Direction.CCW, 1), RowKey(0.0, Direction.CCW, 2), RowKey(0.0, Direction.CW, 1))
    assert ErrorTable(rows, (0.0, 5.0), np.zeros((3, 2))).runs == 1
