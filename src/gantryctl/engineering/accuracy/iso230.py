"""ISO 230-2:2014 figures of an error table: the two directions kept apart, estimators with k = 2.

The standard wants target positions approached from both directions at least five times each. Table by table:

- `Layout.RETURN` (procedure C): the ccw row approaches base + d going up, the cw row the same stops coming
  back. Deviations of both are referred to the base as it stood on the way up, so reversal is real reversal.
- `Layout.APART` (procedures A, B, D): the ccw stops lie at base + d, the cw stops at base - d. A "position"
  is then only a displacement from a base, and what the formulas call reversal holds the gear error between
  the two sides as well. `same_positions` is then False.

Every base is its own zero (deviation 0 by definition), as in the chord test; a single zero for the whole
axis would need an instrument that spans it. Names follow the standard: up = increasing angle =
counter-clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gantryctl.engineering.accuracy.table import Direction, ErrorTable, FloatArray, Layout
from gantryctl.units import SIGNED, Dial

# Approaches of every position in each direction that the standard asks for.
MIN_RUNS = 5


@dataclass(frozen=True, eq=False)
class PositionSeries:
    """Deviations by target position. NaN columns: positions that one direction does not reach.

    Attributes:
        positions: (base_deg, displacement_deg) of every position, the base itself included.
        up_deg, down_deg: shape (positions, runs), deviation of the angle reached from the target, deg.
    """

    positions: tuple[tuple[float, float], ...]
    up_deg: FloatArray
    down_deg: FloatArray


@dataclass(frozen=True)
class IsoPosition:
    """Figures of one target position, deg. None where a direction is missing.

    Attributes:
        mean_up_deg, mean_down_deg: mean unidirectional deviations.
        s_up_deg, s_down_deg: estimators of standard uncertainty (n - 1).
        reversal_deg: B_i = mean up minus mean down.
        repeatability_up_deg, repeatability_down_deg: R_i = 4 s_i.
        repeatability_deg: R_i = max(2 s up + 2 s down + |B_i|, R_i up, R_i down).
    """

    base_deg: float
    displacement_deg: float
    mean_up_deg: float | None
    mean_down_deg: float | None
    s_up_deg: float | None
    s_down_deg: float | None
    reversal_deg: float | None
    repeatability_up_deg: float | None
    repeatability_down_deg: float | None
    repeatability_deg: float | None


@dataclass(frozen=True)
class IsoFigures:
    """The figures of ISO 230-2:2014, deg; all None when `not_computable` gives a reason.

    Attributes:
        reversal_deg: B, largest |B_i|;  mean_reversal_deg: mean of B_i.
        repeatability_*: R up, R down, R.
        systematic_*: E up, E down, E: range of the mean deviations.
        mean_bidirectional_deg: M, range of the means of both directions.
        accuracy_*: A up, A down, A, with mean +- 2 s.
    """

    runs: int
    same_positions: bool
    not_computable: str | None
    positions: tuple[IsoPosition, ...] = ()
    reversal_deg: float | None = None
    mean_reversal_deg: float | None = None
    repeatability_up_deg: float | None = None
    repeatability_down_deg: float | None = None
    repeatability_deg: float | None = None
    systematic_up_deg: float | None = None
    systematic_down_deg: float | None = None
    systematic_deg: float | None = None
    mean_bidirectional_deg: float | None = None
    accuracy_up_deg: float | None = None
    accuracy_down_deg: float | None = None
    accuracy_deg: float | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Limits of the figures for the reader."""
        if self.not_computable is not None or self.same_positions:
            return ()
        return (
            "ISO 230-2: ccw and cw stops are different positions (base +- d), so B, R, E, M and A "
            "over both directions contain the gear error between them; only procedure C shares them",
        )


def iso230_2(table: ErrorTable, min_runs: int = MIN_RUNS, dial: Dial = SIGNED) -> IsoFigures:
    """ISO 230-2:2014 figures of a table, or the reason against them, with angles as `dial` reads them."""
    reason = _why_not(table, min_runs, dial)
    same = table.layout is Layout.RETURN
    if reason is not None:
        return IsoFigures(runs=table.runs, same_positions=same, not_computable=reason)
    series = position_series(table)
    mean_up, mean_down = series.up_deg.mean(axis=1), series.down_deg.mean(axis=1)
    s_up, s_down = series.up_deg.std(axis=1, ddof=1), series.down_deg.std(axis=1, ddof=1)
    # B_i of ISO 230-2:2014: what a reversal leaves at one position.
    reversal = mean_up - mean_down
    # Widths are 2 s on either side (coverage factor k = 2), so one direction repeats within 4 s.
    r_up, r_down = 4.0 * s_up, 4.0 * s_down
    # Both directions: the bands of 2 s and the reversal between them, never less than one direction alone.
    r_both = np.maximum(2.0 * s_up + 2.0 * s_down + np.abs(reversal), np.maximum(r_up, r_down))
    # E and A range over the means of both directions together; M, below, over the mean of both.
    means = np.concatenate([mean_up, mean_down])
    stds = np.concatenate([s_up, s_down])
    columns = (mean_up, mean_down, s_up, s_down, reversal, r_up, r_down, r_both)
    return IsoFigures(
        runs=table.runs,
        same_positions=same,
        not_computable=None,
        positions=tuple(
            IsoPosition(base, displacement, *(_or_none(column[k]) for column in columns))
            for k, (base, displacement) in enumerate(series.positions)
        ),
        reversal_deg=float(np.nanmax(np.abs(reversal))),
        mean_reversal_deg=float(np.nanmean(reversal)),
        repeatability_up_deg=float(np.nanmax(r_up)),
        repeatability_down_deg=float(np.nanmax(r_down)),
        repeatability_deg=float(np.nanmax(np.concatenate([r_both, r_up, r_down]))),
        systematic_up_deg=_range(mean_up),
        systematic_down_deg=_range(mean_down),
        systematic_deg=_range(means),
        mean_bidirectional_deg=_range((mean_up + mean_down) / 2.0),
        accuracy_up_deg=_range(mean_up, 2.0 * s_up),
        accuracy_down_deg=_range(mean_down, 2.0 * s_down),
        accuracy_deg=_range(means, 2.0 * stds),
    )


def position_series(table: ErrorTable) -> PositionSeries:
    """The table's errors as deviations of positions approached going up and going down."""
    columns = len(table.displacements_deg)
    positions = tuple((base, d) for base in table.bases_deg for d in table.displacements_deg)
    up, down = [], []
    for base in table.bases_deg:
        ccw, cw = table.select([base], Direction.CCW), table.select([base], Direction.CW)
        # A direction that was repeated more often is cut: B_i compares equal numbers of approaches.
        runs = min(len(ccw), len(cw))
        going_up, going_down = ccw[:runs], cw[:runs]
        if table.layout is Layout.RETURN:
            going_down = _return_deviations(going_up, cw[:runs], table.displacements_deg)
        up.append(going_up.T)
        down.append(going_down.T)
    # The base that was measured least often decides: a column of the result is one run of every base.
    runs = min(block.shape[1] for block in up)
    shape = (len(table.bases_deg) * columns, runs)
    return PositionSeries(
        positions,
        np.concatenate([block[:, :runs] for block in up]).reshape(shape),
        np.concatenate([block[:, :runs] for block in down]).reshape(shape),
    )


def _return_deviations(ccw: FloatArray, cw: FloatArray, displacements_deg: tuple[float, ...]) -> FloatArray:
    """Deviations on the way back, at the positions of the ccw stops, shape (runs, columns), deg.

    The cw rows are measured from the turning point base + D: after moving back by d the axis stands at base
    + D - d, and its deviation is that of the turning point minus the error of the move back. The turning
    point itself is approached going up only (NaN).
    """
    farthest = displacements_deg[-1]
    deviations = np.full_like(ccw, np.nan)
    for column, d in enumerate(displacements_deg):
        position = _index_of(displacements_deg, farthest - d)
        # Displacements that are no mirror image of each other leave positions that only one direction
        # reaches.
        if d > 0.0 and position is not None:
            deviations[:, position] = ccw[:, -1] - cw[:, column]
    return deviations


def _index_of(values: tuple[float, ...], wanted: float) -> int | None:
    return next((k for k, value in enumerate(values) if abs(value - wanted) < 1e-9), None)


def _why_not(table: ErrorTable, min_runs: int, dial: Dial) -> str | None:
    if table.layout is Layout.STEPS:
        return "not computable: the table holds errors of single steps, not deviations at positions"
    if len(table.directions) < 2:
        return (
            f"not computable: only {table.directions[0].value} was measured, ISO 230-2 needs both directions"
        )
    for base in table.bases_deg:
        if any(len(table.select([base], direction)) == 0 for direction in Direction):
            return f"not computable: base {dial.text(base)} deg was measured in one direction only"
    if table.runs < min_runs:
        runs = f"{table.runs} run{'s' if table.runs > 1 else ''}"
        return f"not computable: {runs} in each direction, ISO 230-2 needs {min_runs}"
    return None


def _range(mean: FloatArray, half_width: FloatArray | float = 0.0) -> float:
    """Largest mean + half width minus smallest mean - half width; NaN positions left out."""
    return float(np.nanmax(mean + half_width) - np.nanmin(mean - half_width))


def _or_none(value: np.float64) -> float | None:
    return None if np.isnan(value) else float(value)
