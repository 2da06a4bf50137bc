"""The statistics of the paper's table 2 and its figure A, eq. (6).

X_j and S_j are mean and sample standard deviation (n - 1) of column j over all rows, both directions and all
bases pooled; A = max_j (X_j + 3 S_j) - min_j (X_j - 3 S_j), the zero column included. Array functions take
errors of shape (..., rows, columns) in deg, so that an ensemble of tables is one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantryctl.engineering.accuracy.table import Direction, ErrorTable, FloatArray
from gantryctl.errors import UsageError

# Standard deviations on either side of the mean in eq. (6).
COVERAGE = 3.0


def column_mean(errors_deg: FloatArray) -> FloatArray:
    """X_j over the rows, deg: shape (..., rows, columns) -> (..., columns)."""
    return np.asarray(errors_deg.mean(axis=-2))


def column_std(errors_deg: FloatArray) -> FloatArray:
    """S_j over the rows with n - 1, deg: shape (..., rows, columns) -> (..., columns)."""
    # With n - 1 the paper's six rows give the printed A (0.011295); with n it would be 0.0104.
    return np.asarray(errors_deg.std(axis=-2, ddof=1))


def spread(mean_deg: FloatArray, std_deg: FloatArray, coverage: float = COVERAGE) -> FloatArray:
    """Largest mean + coverage x std minus smallest mean - coverage x std, deg: (..., columns) -> (...)."""
    upper = (mean_deg + coverage * std_deg).max(axis=-1)
    lower = (mean_deg - coverage * std_deg).min(axis=-1)
    return np.asarray(upper - lower)


def accuracy_a(errors_deg: FloatArray) -> FloatArray:
    """A by eq. (6), deg, rows pooled: shape (..., rows, columns) -> (...)."""
    return spread(column_mean(errors_deg), column_std(errors_deg))


@dataclass(frozen=True)
class TableStatistics:
    """The figures under the paper's table 2, from any `ErrorTable`. All in deg.

    Attributes:
        n: rows pooled in every column.
        mean_deg, three_s_deg, upper_deg, lower_deg: X_j, 3 S_j, X_j + 3 S_j, X_j - 3 S_j, one per column.
        a_deg: eq. (6).
        a_by_direction_deg: the same 3s figure with the directions kept apart: X_j and S_j of each direction
            alone, then the largest upper minus the smallest lower of both. None without two rows in each
            direction.
        rms_deg: per base, over its rows without the zero column.
        range_deg: per base, smallest and largest error.
        largest_deg: largest absolute error of the table.
        reversal_pooled: both directions are inside S, so reversal is counted as scatter.
    """

    n: int
    mean_deg: tuple[float, ...]
    three_s_deg: tuple[float, ...]
    upper_deg: tuple[float, ...]
    lower_deg: tuple[float, ...]
    a_deg: float
    a_by_direction_deg: float | None
    rms_deg: dict[float, float]
    range_deg: dict[float, tuple[float, float]]
    largest_deg: float
    reversal_pooled: bool

    @property
    def warnings(self) -> tuple[str, ...]:
        """Limits of A for the reader, one sentence each."""
        found = []
        if self.reversal_pooled:
            found.append(
                "S pools both directions and all bases: reversal and pose are counted as "
                "scatter, and A is not an ISO 230-2 figure"
            )
        # Three bases times two directions: what the paper pools, and every plan of [accuracy] by default.
        if self.n < 6:
            found.append(f"S comes from {self.n} rows only; three bases both ways give six")
        return tuple(found)


def statistics(table: ErrorTable) -> TableStatistics:
    """The paper's figures of one table; needs at least two rows.

    Raises:
        UsageError: one row has no standard deviation.
    """
    errors = table.errors_deg
    if len(table.rows) < 2:
        raise UsageError(
            "accuracy statistics need at least 2 rows (S is a sample standard deviation); there is 1"
        )
    mean, three_s = column_mean(errors), COVERAGE * column_std(errors)
    return TableStatistics(
        n=len(table.rows),
        mean_deg=tuple(mean.tolist()),
        three_s_deg=tuple(three_s.tolist()),
        upper_deg=tuple((mean + three_s).tolist()),
        lower_deg=tuple((mean - three_s).tolist()),
        a_deg=float(accuracy_a(errors)),
        a_by_direction_deg=a_by_direction(table),
        rms_deg={base: base_rms(table, base) for base in table.bases_deg},
        range_deg={base: error_range(table, [base]) for base in table.bases_deg},
        largest_deg=float(np.abs(errors).max()),
        reversal_pooled=len(table.directions) == 2,
    )


def a_by_direction(table: ErrorTable) -> float | None:
    """The figure of eq. (6) with ccw and cw kept apart, deg; None unless each direction has two rows or
    more.
    """
    # 0.0146 deg for the paper's table: its A of 0.0113 counts reversal as scatter, not as a range of its own.
    parts = [table.select(direction=direction) for direction in Direction]
    if any(len(part) < 2 for part in parts):
        return None
    mean = np.concatenate([column_mean(part) for part in parts])
    std = np.concatenate([column_std(part) for part in parts])
    return float(spread(mean, std))


def base_rms(table: ErrorTable, base_deg: float) -> float:
    """Root mean square of the errors around one base, deg, both directions, without the zero column."""
    # The base is its own reference: its exact zeros would only make the mean smaller.
    errors = table.select([base_deg])[:, 1:]
    return float(np.sqrt(np.mean(errors**2))) if errors.size else 0.0


def error_range(table: ErrorTable, bases_deg: Sequence[float]) -> tuple[float, float]:
    """Smallest and largest error around these bases, deg, the zero column included."""
    errors = table.select(bases_deg)
    return float(errors.min()), float(errors.max())
