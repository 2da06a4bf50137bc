"""Rows of the result of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gantryctl.engineering.campaign.job import INDEX, REFUSED
from gantryctl.engineering.campaign.result import ResultFolder
from gantryctl.engineering.scheduler.job import Rows


def sorted_bytes(folder: Path) -> bytes:
    """Every column of a result, rows in order."""
    rows = ResultFolder(folder).rows()
    columns = rows_of(folder, [INDEX, REFUSED, *rows.head.outputs, *rows.head.scalar_keys])
    return b"".join(
        name.encode() + ("\0".join(column).encode() if column.dtype == object else column.tobytes())
        for name, column in columns.items()
    )


def rows_of(folder: Path, columns: Sequence[str]) -> Rows:
    """Columns of a result, rows in order."""
    parts = [batch for _, batch in ResultFolder(folder).rows().batches(columns)]
    return {name: np.concatenate([part[name] for part in parts]) for name in columns}
