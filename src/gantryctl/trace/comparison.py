"""Two recordings on one time axis: how far each curve of the second lies from the first."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from gantryctl.errors import UsageError
from gantryctl.trace.columns import SPACING_COLUMN, TIME_COLUMN, degree_factor, in_degrees, unit_of
from gantryctl.trace.files import Floats
from gantryctl.trace.table import Trace

_MOVES: Final = "vel_ref_rad_s"
# Times of one scan differ by the rounding of the shift; no scan is shorter than 100 times this.
_SAME_SCAN_S: Final = 1e-6


class ColumnDifference(NamedTuple):
    """Difference of one column, second minus first, in degrees where it is an angle.

    Attributes:
        largest: largest absolute value, with its sign; None where no row of both is finite.
        time_s: of that row, on the time axis of the first. rms: over the rows.
    """

    name: str
    unit: str
    largest: float | None
    time_s: float | None
    rms: float | None


def motion_begins_s(trace: Trace) -> float | None:
    """Time of the first row whose set-point moves; None for a recording without any."""
    if _MOVES not in trace:
        return None
    moving = np.flatnonzero(trace[_MOVES] != 0.0)
    return float(trace.time_s[moving[0]]) if len(moving) else None


def difference(first: Trace, second: Trace, shift_s: float) -> Trace:
    """Second minus first, at the times of the first that both have.

    Between two rows of the second, quantities with a unit are interpolated and plain numbers (states, flags) hold.

    Args:
        shift_s: is added to the times of the second.

    Raises:
        UsageError: they have no time or no column in common.
    """
    time_s, there_s = first.time_s, second.time_s + shift_s
    if not len(time_s) or not len(there_s):
        raise UsageError("one of the recordings has no row: there is nothing to compare")
    both = (time_s >= there_s[0] - _SAME_SCAN_S) & (time_s <= there_s[-1] + _SAME_SCAN_S)
    names = [name for name in first.columns if name in second and name not in (TIME_COLUMN, SPACING_COLUMN)]
    if not both.any() or not names:
        raise UsageError(
            "the two recordings have no time in common" if names else "they have no column in common"
        )
    at_s = time_s[both]
    data = {TIME_COLUMN: at_s}
    for name in names:
        # The zero of a modulo axis moves on by whole turns.
        turns = name.startswith("pos_") and first.dial.begin_deg is not None
        there = _continued(second[name]) if turns else second[name]
        found = _at(at_s, there_s, there, steps=not unit_of(name).suffix) - first[name][both]
        data[name] = found - _turns_in(found) if turns else found
    return Trace(data, {**first.metadata, "of": "difference"})


def _turns_in(angle_rad: Floats) -> Floats:
    """Whole turns of angles, rad; NaN has none."""
    return math.tau * np.nan_to_num(np.round(angle_rad / math.tau))


def _continued(angle_rad: Floats) -> Floats:
    """The same angles without steps of whole turns: half way through such a step there is no angle of the axis."""
    return angle_rad - np.concatenate(([0.0], np.cumsum(_turns_in(np.diff(angle_rad)))))


def _at(at_s: Floats, time_s: Floats, values: Floats, *, steps: bool) -> Floats:
    if steps:
        return values[np.searchsorted(time_s, at_s + _SAME_SCAN_S, side="right") - 1]
    return np.interp(at_s, time_s, values)


def differences(found: Trace) -> list[ColumnDifference]:
    """Largest difference of every column with its time."""
    rows = []
    for name in found.columns[1:]:
        values = found[name] * degree_factor(name)
        finite = np.flatnonzero(np.isfinite(values))
        unit = unit_of(in_degrees(name)).symbol
        if not len(finite):
            rows.append(ColumnDifference(name, unit, None, None, None))
            continue
        worst = finite[np.argmax(np.abs(values[finite]))]
        rms = math.sqrt(float(np.mean(values[finite] ** 2)))
        rows.append(ColumnDifference(name, unit, float(values[worst]), float(found.time_s[worst]), rms))
    return rows
