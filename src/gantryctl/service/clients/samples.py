"""Tags of every scan, for a scope: read from the ring of trace rows beside its writer and its reader.

The controller writes a row for each scan while power is on, whoever looks; nothing here is ever written, so no number
of scopes delays a scan. The ring keeps half a minute at 1 ms.
"""

from __future__ import annotations

import json
import math
import struct
import time
from itertools import starmap
from typing import Any, Final, NamedTuple

from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.protocol.tags import BY_NAME
from gantryctl.trace.columns import degree_factor, in_degrees

# Rows of one answer. A scope of 1 ms asks four times a second for 250; one answer of this many takes 4 ms of a
# processor (loaded computer).
ROWS_MAX: Final = 500
# Answers a second to all sessions together: five scopes. What they take of the processor is bounded by it.
ANSWERS_PER_S: Final = 20.0
_DECIMALS: Final = 6
# Before a row's values: the number of its recording and its mark.
_HEAD: Final = 2


class _Column(NamedTuple):
    at: int
    factor: float


class Samples:
    """The rows of the scans that are still in memory, as values of tags."""

    def __init__(self, memory: SharedMemory) -> None:
        self._ring, self._columns = memory.rows, memory.columns

    def read(self, first: int, limit: int) -> dict[str, Any]:
        """Rows from a number on.

        Args:
            first: number of a row, counted from the start of the service; one that is not there yet stands for the
                    next that comes.
            limit: of rows; no more than `ROWS_MAX` are read.

        Returns:
            `from` and `next`, numbers of the first row and of the one after the last; `newest`, that of the one that
            comes next; `newest_s`, nominal time of the row before it, None where it is not known, and `utc_s`, the wall
            clock then: together they say when a row was; `period_s` of the scan, None before the first start of the
            controller; `tags`, the values by tag, null for an unknown one, `time_s` and the tags that a recording has
            as columns.
        """
        about = self._columns.read()
        described: dict[str, Any] = json.loads(about) if about else {"columns": [], "metadata": {}}
        columns = {
            in_degrees(name): _Column(at, degree_factor(name))
            for at, name in enumerate(described["columns"], _HEAD)
            if in_degrees(name) in BY_NAME
        }
        newest, (_, last), utc_s = self._ring.written, self._ring.look(self._ring.written - 1, 1), time.time()
        begin, records = self._ring.look(first, min(limit, ROWS_MAX))
        row = struct.Struct(f"<{len(described['columns']) + _HEAD}d")
        # Others mark the end of a recording, or were written by a controller with other columns.
        rows = [row.unpack(record) for record in records if record is not None and len(record) == row.size]
        ends = [row.unpack(record) for record in last if record is not None and len(record) == row.size]
        return {
            "period_s": described["metadata"].get("period_s"),
            "from": begin,
            "next": begin + len(records),
            "newest": newest,
            "newest_s": round(ends[0][_HEAD], _DECIMALS) if ends else None,
            "utc_s": utc_s,
            "tags": {
                name: list(starmap(_value, ((each[at], factor) for each in rows)))
                for name, (at, factor) in columns.items()
            },
        }


def _value(value: float, factor: float) -> float | None:
    return round(value * factor, _DECIMALS) if math.isfinite(value) else None
