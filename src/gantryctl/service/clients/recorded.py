"""Columns of a recording for a picture, thinned so that no peak is lost: a process of its own for each question.

    python -m gantryctl.service.clients.recorded FD NAME FROM_MS TO_MS

The gateway asks it: pyarrow takes a third of a second to import, and a recording of 64 MB as long to read, while a held
key is renewed every 30 ms.
"""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np

from gantryctl.errors import GantryctlError
from gantryctl.service.protocol.tags import BY_NAME
from gantryctl.trace.columns import SPACING_COLUMN, TIME_COLUMN, degree_factor, in_degrees, unit_of
from gantryctl.trace.files import Floats
from gantryctl.trace.naming import begun_at
from gantryctl.trace.reader import read_trace
from gantryctl.trace.thinning import drawn

# Of one curve in one answer: more than a screen has across. 40 columns are 0.6 MB.
POINTS_MAX: Final = 1000
_DECIMALS: Final = 6
# Beside the controller and the gateway this can wait.
_NICE: Final = 15


def columns_between(path: Path, name: str, from_ms: int, to_ms: int) -> dict[str, Any]:
    """What a recording has between two times from its first row, both included.

    Args:
        path: of the content. name: of the recording, which has its date.

    Returns:
        `name`, `machine`; `utc_s`, the wall clock at the first row, None where the name has no date; `end_s`, time of
        the last row; `columns`, each with `name` and `unit` (angles in degrees), `x` in s from the first row, and `y`,
        null for an unknown value.

    Raises:
        UsageError: it is no recording. DeviceError: the disk does not give it.
    """
    trace = read_trace(path)
    begun = begun_at(Path(name))
    time_s = trace[TIME_COLUMN] - trace[TIME_COLUMN][0] if len(trace) else np.empty(0)
    wanted = slice(*np.searchsorted(time_s, [1e-3 * from_ms - 1e-9, 1e-3 * to_ms + 1e-9]).tolist())
    return {
        "name": name,
        "machine": str(trace.metadata.get("machine", "")),
        "utc_s": None if begun is None else begun.timestamp(),
        "end_s": round(float(time_s[-1]), _DECIMALS) if len(time_s) else 0.0,
        "columns": [
            _curve(each, time_s[wanted], trace[each][wanted])
            for each in trace.columns
            if each not in (TIME_COLUMN, SPACING_COLUMN)
        ],
    }


def _curve(column: str, time_s: Floats, values: Floats) -> dict[str, Any]:
    kept = drawn(values, POINTS_MAX)
    name = in_degrees(column)
    shown = np.round(values[kept] * degree_factor(column), _DECIMALS).tolist()
    return {
        "name": name,
        "unit": BY_NAME[name].unit if name in BY_NAME else unit_of(name).symbol,
        "x": np.round(time_s[kept], _DECIMALS).tolist(),
        "y": [value if math.isfinite(value) else None for value in shown],
    }


def main(arguments: list[str]) -> int:
    """Print the answer as JSON; exit code 1 for what is no recording."""
    os.nice(_NICE)
    handle, name, from_ms, to_ms = arguments
    try:
        answer = columns_between(Path(f"/dev/fd/{int(handle)}"), name, int(from_ms), int(to_ms))
    except GantryctlError:
        return 1
    sys.stdout.write(json.dumps(answer, allow_nan=False))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
