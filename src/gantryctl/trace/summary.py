"""Summary of a trace: extremes and root mean square of every column."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gantryctl.trace.columns import unit_of
from gantryctl.trace.files import Floats
from gantryctl.trace.table import Trace


class ColumnSummary(NamedTuple):
    """Extremes and root mean square of one column over its finite values, in the unit of the column."""

    name: str
    unit: str
    minimum: float | None
    maximum: float | None
    rms: float | None
    not_finite: int
    """Values that are NaN or infinite."""


def summarize(trace: Trace) -> list[ColumnSummary]:
    """Summarise every column, in their order; None where there is no finite value."""
    return [_summary(name, trace[name]) for name in trace.columns]


def _summary(name: str, values: Floats) -> ColumnSummary:
    finite = values[np.isfinite(values)]
    missing = len(values) - len(finite)
    unit = unit_of(name).symbol
    if not len(finite):
        return ColumnSummary(name, unit, None, None, None, missing)
    # Squares of large values would overflow.
    scale = float(np.max(np.abs(finite))) or 1.0
    rms = scale * math.sqrt(float(np.mean((finite / scale) ** 2)))
    return ColumnSummary(name, unit, float(finite.min()), float(finite.max()), rms, missing)
