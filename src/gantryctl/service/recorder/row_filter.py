"""Which rows of the scan are recorded: every one around whatever happens, one in a while at rest."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeAlias

from gantryctl.service.memory.trace_ring import BAND_KEY, REST_S
from gantryctl.trace.columns import unit_of

# Every scan is recorded for so long before and after an event: the load swings for some seconds after a stop.
BEFORE_S: Final = 2.0
AFTER_S: Final = 5.0
_SET_POINT: Final = "pos_ref_rad"
_SPEEDS: Final = ("vel_ref_rad_s", "acc_ref_rad_s2")

Row: TypeAlias = tuple[float, ...]


class RowFilter:
    """Filter of the rows of one recording.

    An event is: the set-point changes or has a speed, a state (a column without a unit) changes, a column leaves its
    band around the row in which rest began, rows are missing, or the scan says that something happened (`mark`): a
    command, refused or not, an alarm, a setting, a tag that is a flag or a word.

    Args:
        columns: names of the row's values, `time_s` first.
        period_s: the scan period.
        metadata: of the recording; with `rest_metadata`, how far columns may stray while the axis rests.
        last_s: time of the last row that is recorded already, -inf for none.

    The rows that it returns have one value more, `spacing_s`: the time for which the row stands.
    """

    def __init__(
        self,
        columns: Sequence[str],
        period_s: float,
        metadata: Mapping[str, Any],
        last_s: float = -math.inf,
    ) -> None:
        self._period_s = period_s
        self._bands = tuple(
            (at, metadata[BAND_KEY + name]) for at, name in enumerate(columns) if BAND_KEY + name in metadata
        )
        self._speeds = tuple(columns.index(name) for name in _SPEEDS if name in columns)
        # States, and the set-point: any change counts.
        self._states = tuple(
            at for at, name in enumerate(columns) if name == _SET_POINT or not unit_of(name).suffix
        )
        self._waiting: deque[Row] = deque()
        self._before_rows = max(1, round(BEFORE_S / period_s))
        self._mark = math.nan
        self._last_s = self._newest_s = last_s
        self._before: Row = ()
        self._rest: Row = ()
        self._until_s = -math.inf

    @property
    def held(self) -> int:
        """How many of the newest rows are not decided yet."""
        return len(self._waiting)

    def take(self, mark: float, row: Row) -> list[Row]:
        """Take the next row; return the rows that are decided to be recorded, oldest first.

        Args:
            mark: a number that changes when something has happened.
        """
        time_s, first = row[0], not self._before
        # A killed recorder has written it.
        if first and time_s <= self._last_s:
            return []
        # Rows that this recorder has not seen may have been left out by the one before.
        step_s = REST_S if first else self._period_s
        gap = time_s - self._newest_s > step_s + 0.5 * self._period_s
        happened = first or gap or self._is_event(mark, row)
        self._newest_s, self._before, self._mark = time_s, row, mark
        if happened:
            # What stays out of its band becomes the rest that follows: it is no event in every scan from now on.
            self._rest = ()
            self._until_s = time_s + AFTER_S + 0.5 * self._period_s
            found = self.flush()
            found.append(self._spaced(row, gap))
            return found
        if time_s <= self._until_s:
            self._rest = row
            return [self._spaced(row, gap)]
        waiting = self._waiting
        waiting.append(row)
        if len(waiting) <= self._before_rows:
            return []
        oldest = waiting.popleft()
        # Half a period: times are k x period, rounded.
        if oldest[0] - self._last_s < REST_S - 0.5 * self._period_s:
            return []
        return [self._spaced(oldest)]

    def flush(self) -> list[Row]:
        """Return the rows before an event, or before the end: every one of them is recorded."""
        found = [self._spaced(each) for each in self._waiting]
        self._waiting.clear()
        return found

    def _is_event(self, mark: float, row: Row) -> bool:
        before, rest = self._before, self._rest
        return (
            mark != self._mark
            or any(row[at] != 0.0 for at in self._speeds)
            or any(_differ(row[at], before[at]) for at in self._states)
            or any(_differ(row[at], rest[at], band) for at, band in self._bands if rest)
        )

    def _spaced(self, row: Row, gap: bool = False) -> Row:
        """Add the time for which the row stands: since the row recorded before, one period after a gap."""
        periods = 1 if gap else max(1, round((row[0] - self._last_s) / self._period_s))
        self._last_s = row[0]
        return (*row, periods * self._period_s)


def _differ(a: float, b: float, band: float = 0.0) -> bool:
    """Whether two values are further apart than a band; one that is not known is as far as can be from one that is."""
    return not abs(a - b) <= band and not (math.isnan(a) and math.isnan(b))
