"""Recordings that are longer than a row group, and those with fewer rows while the axis rests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gantryctl.trace.files import arrow_schema, record_batch, write_parquet
from gantryctl.trace.listing import recorded
from gantryctl.trace.reader import read_trace
from gantryctl.trace.table import summarize

METADATA = {"period_s": 0.01}


def written(path: Path, columns: tuple[str, ...], *values: object) -> Path:
    schema = arrow_schema(columns, METADATA)
    write_parquet(
        path, schema, [record_batch(schema, np.column_stack([np.asarray(each) for each in values]))]
    )
    return path


def test_a_recording_of_several_parts_is_as_long_as_all_of_them(tmp_path: Path) -> None:
    """35 s in parts of 30: from 0 to 34.99 s."""
    found = recorded(written(tmp_path / "long.parquet", ("time_s",), 0.01 * np.arange(3500)))
    assert (found.rows, found.closed) == (3500, True)
    assert found.duration_s == pytest.approx(34.99)


def test_a_mean_over_time_counts_rest_where_columns_are_chosen_too(tmp_path: Path) -> None:
    """1 for a scan and 3 for the nine scans of a row at rest: sqrt((1 + 9 x 9) / 10)."""
    file = written(
        tmp_path / "rest.parquet", ("time_s", "x", "spacing_s"), [0.01, 0.10], [1.0, 3.0], [0.01, 0.09]
    )
    (x,) = (each for each in summarize(read_trace(file, ["x"])) if each.name == "x")
    assert x.rms == pytest.approx(np.sqrt(8.2))
