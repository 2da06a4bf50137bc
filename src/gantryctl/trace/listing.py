"""The recordings of a folder, by what their names and their ends tell: no row is read."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from gantryctl.trace.naming import begun_at, oldest_first


class Recorded(NamedTuple):
    """A recording.

    Attributes:
        begun: UTC by its name; None where that has none. rows, duration_s: None where the file does not tell: it was
            not closed, or is damaged.
        closed: the run that wrote it has ended as it should.
    """

    file: Path
    begun: datetime | None
    rows: int | None
    duration_s: float | None
    size_bytes: int
    closed: bool


def recordings(folder: Path) -> list[Recorded]:
    """All recordings of a folder, newest last."""
    return [recorded(file) for file in oldest_first([*folder.glob("*.parquet"), *folder.glob("*.arrows")])]


def recorded(file: Path) -> Recorded:
    """One recording."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    closed, rows, duration_s = file.suffix == ".parquet", None, None
    if closed:
        try:
            with pq.ParquetFile(file) as found:
                head = found.metadata
                rows = head.num_rows
                # The time is the first column, and a row group keeps its smallest and largest value.
                ends = [head.row_group(k).column(0).statistics for k in {0, head.num_row_groups - 1} if rows]
            if ends and all(end is not None and end.has_min_max for end in ends):
                duration_s = max(end.max for end in ends) - min(end.min for end in ends)
        except (pa.ArrowException, OSError):
            closed = False
    return Recorded(file, begun_at(file), rows, duration_s, file.stat().st_size, closed)
