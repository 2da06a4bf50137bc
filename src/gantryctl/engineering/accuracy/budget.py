"""Uncertainty budget of A (JCGM 100:2008; ISO/TR 230-9 for machine tools), and a Monte Carlo beside it (JCGM 101:2008).

Contribution of a source: |dA/dreadings| through the source's pattern times its standard uncertainty; all are combined
as squares (eq. 10, independent sources), degrees of freedom by Welch and Satterthwaite (G.2b), expanded with k = 2. The
Monte Carlo draws the sources and computes A anew each time: eq. (6) is a maximum of standard deviations, not a line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from gantryctl.engineering.accuracy.procedure.procedures import Procedure, errors_from_points, target_points
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.accuracy.table import ErrorTable, FloatArray
from gantryctl.engineering.accuracy.uncertainty import COVERAGE_K
from gantryctl.engineering.instruments.sources import Acting, Source
from gantryctl.errors import UsageError

DRAWS: Final = 2000
# Far above rounding, far below what turns the maximum of eq. (6) to another column.
_STEP_DEG: Final = 1e-7
# Move and dwell of a stop, where no plan tells: procedure A takes 537 s for 36.
STOP_S: Final = 15.0


@dataclass(frozen=True)
class Contribution:
    """One row of a budget.

    Attributes:
        value: standard uncertainty of the source, in `unit`. sensitivity: deg of A per unit.
        contribution_deg: their product. degrees_of_freedom: of the value.
    """

    name: str
    distribution: str
    acting: str
    value: float
    unit: str
    sensitivity: float
    contribution_deg: float
    degrees_of_freedom: float


@dataclass(frozen=True)
class Budget:
    """Uncertainty of A.

    Attributes:
        instrument: whose sources they are. combined_deg: standard uncertainty of A.
        degrees_of_freedom: effective ones.
        low_deg, high_deg: 2.5 and 97.5 % of A less A without errors, by `draws` draws.
    """

    instrument: str
    contributions: tuple[Contribution, ...]
    combined_deg: float
    degrees_of_freedom: float
    low_deg: float
    high_deg: float
    draws: int

    @property
    def expanded_deg(self) -> float:
        """k = 2: about 95 %."""
        return COVERAGE_K * self.combined_deg


Figure = Callable[[FloatArray], FloatArray]


def budget(
    instrument: str,
    figure: Figure,
    angles_deg: FloatArray,
    times_s: FloatArray,
    sources: Sequence[Source],
    draws: int = DRAWS,
    seed: int = 0,
) -> Budget:
    """Budget of a figure of readings.

    Args:
        figure: readings in deg, shape (..., stops), to the figure in deg, shape (...).
        angles_deg, times_s: of the readings, shape (stops,); times must not fall.
    """
    steps = _STEP_DEG * np.eye(len(angles_deg))
    slope = (figure(angles_deg + steps) - figure(angles_deg - steps)) / (2.0 * _STEP_DEG)
    rows = []
    for source in sources:
        size = math.sqrt(max(0.0, float(slope @ source.covariance(angles_deg, times_s) @ slope)))
        rows.append(
            Contribution(
                source.name,
                source.distribution,
                source.acting.value,
                source.value,
                source.unit,
                size,
                size * source.value,
                source.degrees_of_freedom,
            )
        )
    combined = math.sqrt(math.fsum(row.contribution_deg**2 for row in rows))
    fourth = math.fsum(row.contribution_deg**4 / row.degrees_of_freedom for row in rows)
    rng = np.random.default_rng(seed)
    drawn = np.zeros((draws, len(angles_deg)))
    for source in sources:
        drawn += source.draws(angles_deg, times_s, draws, rng)
    apart = figure(angles_deg + drawn) - figure(angles_deg)
    low, high = np.percentile(apart, [2.5, 97.5])
    freedom = combined**4 / fourth if fourth > 0.0 else math.inf
    return Budget(instrument, tuple(rows), combined, freedom, float(low), float(high), draws)


def procedure_figure(procedure: Procedure) -> Figure:
    """A of a chord test as a figure of the readings at its stops."""
    return lambda angles: accuracy_a(
        errors_from_points(procedure, target_points(np.radians(angles), 1.0), 1.0)
    )


def stop_times_s(count: int, stop_s: float = STOP_S) -> FloatArray:
    """Times of the readings, one stop after the other."""
    return stop_s * np.arange(1.0, count + 1.0)


def table_budget(table: ErrorTable, instrument: str, sources: Sequence[Source], seed: int = 0) -> Budget:
    """Budget of A of a table whose readings are not known: bases and targets in the order of its rows.

    What a table rounds is a source of its own: half of its last digit, uniform.
    """
    signs = np.array([row.direction.sign for row in table.rows])
    bases = np.array([row.base_deg for row in table.rows])
    nominal = np.array(table.displacements_deg)
    targets = bases[:, None] + signs[:, None] * nominal
    angles = (targets + signs[:, None] * table.errors_deg).ravel()

    def figure(readings: FloatArray) -> FloatArray:
        seen = readings.reshape((*readings.shape[:-1], *targets.shape))
        return accuracy_a(signs[:, None] * (seen - seen[..., :1]) - nominal)

    digit = _last_digit_deg(table.errors_deg)
    points = np.tile(nominal > 0.0, len(bases)).astype(np.float64)
    rounding = Source(
        f"rounding of the table (+-{0.5 * digit:.1g} deg)", 0.5 * digit / math.sqrt(3.0), "deg", "rectangular",
        lambda a, _: points[:, None], Acting.READING,
    )  # fmt: skip
    found = [*sources, rounding] if digit > 0.0 else list(sources)
    return budget(instrument, figure, angles, stop_times_s(angles.size), found, seed=seed)


def _last_digit_deg(errors_deg: FloatArray) -> float:
    """Unit of the last digit that a table has, 0 for one with more than six."""
    for digits in range(1, 7):
        if np.allclose(errors_deg, np.round(errors_deg, digits), rtol=0.0, atol=1e-12):
            return float(10.0**-digits)
    return 0.0


def stated_budget(
    procedure: Procedure, angles_deg: FloatArray, stated_deg: FloatArray, seed: int = 0
) -> Budget:
    """Budget of readings of which only what their instrument states is known: independent, normal.

    Args:
        stated_deg: standard uncertainty of every stop's reading, 0 where nothing is read.
    """
    if not np.any(stated_deg > 0.0):
        raise UsageError("uncertainty budget: no reading has an uncertainty")
    largest = float(stated_deg.max())
    source = Source(
        "readings, as the instrument states (largest)", largest, "deg", "normal",
        lambda a, _: (stated_deg / largest)[:, None], Acting.READING,
    )  # fmt: skip
    return budget(
        "as stated by the instrument",
        procedure_figure(procedure),
        angles_deg,
        stop_times_s(len(angles_deg)),
        [source],
        seed=seed,
    )


_WIDTHS: Final = (15, 12, 11, 6)


def budget_rows(found: Budget) -> list[tuple[str, ...]]:
    """Cells of every source: name, distribution, how it acts, value, deg of A a unit, contribution in deg, degrees of
    freedom.
    """
    return [
        (
            row.name,
            "uniform" if row.distribution == "rectangular" else row.distribution,
            row.acting,
            f"{row.value:.3g} {row.unit}" if row.unit != "-" else f"{row.value:.3g}",
            f"{row.sensitivity:.2e}",
            f"{row.contribution_deg:.5f}",
            freedom_text(row.degrees_of_freedom),
        )
        for row in found.contributions
    ]


def budget_text(found: Budget) -> str:
    """The budget for a terminal, at most 100 columns."""
    lines = [
        f"uncertainty of A, {found.instrument} (GUM; {found.draws} draws beside it)",
        f"  {'':<46}{'':<8}{'value':>15}{'deg a unit':>12}{'u(A), deg':>11}{'dof':>6}",
    ]
    for row in budget_rows(found):
        name, law, _, *numbers = row
        lines.append(
            f"  {name:<46}{law:<8}"
            + "".join(f"{cell:>{n}}" for cell, n in zip(numbers, _WIDTHS, strict=True))
        )
    lines.append(f"  {'combined':<81}{found.combined_deg:>11.5f}{freedom_text(found.degrees_of_freedom):>6}")
    lines.append(
        f"  expanded, k = {COVERAGE_K:g}: {found.expanded_deg:.4f} deg; 95 % of the draws: A {found.low_deg:+.4f} .. "
        f"{found.high_deg:+.4f} deg"
    )
    return "\n".join(lines)


def freedom_text(value: float) -> str:
    """Degrees of freedom for people."""
    # Beyond some hundred they change no coverage factor.
    return f"{value:.0f}" if value < 1000.0 else "inf"


def budget_data(found: Budget | None) -> dict[str, Any] | None:
    """The budget as plain data for JSON; infinite degrees of freedom are null."""
    if found is None:
        return None
    return {
        "instrument": found.instrument,
        "contributions": [
            {**vars(row), "degrees_of_freedom": _finite(row.degrees_of_freedom)}
            for row in found.contributions
        ],
        "combined_deg": found.combined_deg,
        "degrees_of_freedom": _finite(found.degrees_of_freedom),
        "coverage_factor": COVERAGE_K,
        "expanded_deg": found.expanded_deg,
        "monte_carlo": {"draws": found.draws, "low_deg": found.low_deg, "high_deg": found.high_deg},
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
