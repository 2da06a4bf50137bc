"""Files of a recording: an Arrow stream while it grows, Parquet when it is closed, CSV for others.

pyarrow is imported where it is used: it costs a third of a second.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gantryctl.errors import DeviceError
from gantryctl.files import replacing, unwritable

Floats: TypeAlias = NDArray[np.float64]
Metadata: TypeAlias = Mapping[str, "str | int | float | bool | None"]
"""What a recording says of itself: `machine`, `config_hash`, `version`, `seed`, `epoch`, `period_s` ..."""

LIVE_SUFFIX: Final = ".arrows"
CLOSED_SUFFIX: Final = ".parquet"
# Key of the schema metadata; its value is one JSON object. A file without it is not a recording of this program.
METADATA_KEY: Final = b"gantryctl"
# End of an Arrow IPC stream: continuation marker and a length of 0. A file that ends otherwise was never closed.
STREAM_END: Final = b"\xff\xff\xff\xff\0\0\0\0"
# Seconds in a row group of the closed file: a window of a long recording is read without the rest.
ROW_GROUP_S: Final = 30.0
# As many as 30 s hold at the 1 ms of the reference machine.
_ROWS_WITHOUT_PERIOD: Final = 30_000


def arrow_schema(columns: Sequence[str], metadata: Metadata) -> Any:
    """Arrow schema of a recording: every column float64, the metadata as JSON."""
    import pyarrow as pa

    text = json.dumps(dict(metadata), allow_nan=False)
    fields = [pa.field(name, pa.float64(), nullable=False) for name in columns]
    return pa.schema(fields, metadata={METADATA_KEY: text.encode()})


def record_batch(schema: Any, rows: Floats) -> Any:
    """Turn rows of shape (rows, columns) into an Arrow record batch."""
    import pyarrow as pa

    return pa.record_batch([pa.array(column) for column in np.ascontiguousarray(rows.T)], schema=schema)


def whole_part(path: Path) -> tuple[int, float]:
    """End of the last whole block of a live file, and the time of its last row, s.

    (0, -inf) when there is no such file or not even its head is whole.
    """
    import pyarrow as pa

    end, last_s = 0, -math.inf
    try:
        with pa.OSFile(str(path), "rb") as source, pa.ipc.open_stream(source) as stream:
            end = source.tell()
            for batch in stream:
                end = source.tell()
                if batch.num_rows:
                    last_s = batch.column(0)[-1].as_py()
    except (pa.ArrowException, OSError):
        # No such file, or the kill cut the block after `end`.
        pass
    return end, last_s


def head_of(path: Path) -> tuple[tuple[str, ...], Metadata]:
    """Columns and metadata of a live file.

    Raises:
        DeviceError: it cannot be read.
    """
    import pyarrow as pa

    try:
        with pa.OSFile(str(path), "rb") as source, pa.ipc.open_stream(source) as stream:
            return tuple(stream.schema.names), json.loads(stream.schema.metadata[METADATA_KEY])
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, RecursionError) as fault:
        raise DeviceError(f"{path}: not a recording, or cut off at its head: {fault}") from fault


def write_parquet(path: Path, schema: Any, batches: Iterable[Any]) -> None:
    """Write the batches as a Parquet file that is there whole or not at all.

    Raises:
        DeviceError: the file cannot be written; what stood there before is untouched.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    # Neighbouring scans share the high bytes of their floats: as streams of bytes these compress, while a dictionary
    # of values that hardly ever repeat only grows.
    options = {"compression": "zstd", "use_dictionary": False, "use_byte_stream_split": True}
    try:
        with replacing(path) as draft, pq.ParquetWriter(draft, schema, **options) as writer:
            for group in _row_groups(batches, rows_per_group(schema)):
                table = pa.Table.from_batches(group, schema=schema)
                writer.write_table(table, row_group_size=max(1, table.num_rows))
    except pa.ArrowException as fault:
        raise DeviceError(f"{path}: cannot be written: {fault}") from fault


def rows_per_group(schema: Any) -> int:
    """Rows of `ROW_GROUP_S`, by the period that the metadata gives."""
    period_s = json.loads(schema.metadata[METADATA_KEY]).get("period_s")
    if isinstance(period_s, int | float) and period_s > 0:
        return max(1, round(ROW_GROUP_S / period_s))
    return _ROWS_WITHOUT_PERIOD


def _row_groups(batches: Iterable[Any], rows_per_group: int) -> Iterator[list[Any]]:
    """Collect batches into groups of exactly `rows_per_group` rows, the last one shorter."""
    group: list[Any] = []
    missing = rows_per_group
    for batch in batches:
        rest = batch
        while rest.num_rows >= missing:
            yield [*group, rest.slice(0, missing)]
            group, rest, missing = [], rest.slice(missing), rows_per_group
        if rest.num_rows:
            group.append(rest)
            missing -= rest.num_rows
    if group:
        yield group


def write_csv(path: Path, columns: Mapping[str, Floats]) -> None:
    """Write columns as CSV: a header line, numbers in the shortest form that reads back to the same value.

    Raises:
        UsageError: there is no place of this name. DeviceError: the disk does not take it.
    """
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    options = pa_csv.WriteOptions(include_header=False, quoting_style="none")
    try:
        # Not by way of a draft: the name may be that of a pipe.
        with path.open("wb") as file:
            file.write((",".join(columns) + "\n").encode())
            pa_csv.write_csv(pa.table(dict(columns)), file, options)
    except OSError as fault:
        raise unwritable(path, fault) from fault
