"""Reading a recording back: closed, still growing, or cut off by a kill."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from gantryctl.errors import UsageError
from gantryctl.files import unreadable
from gantryctl.trace.columns import SPACING_COLUMN
from gantryctl.trace.files import METADATA_KEY, STREAM_END, Metadata
from gantryctl.trace.table import Trace

# First bytes of the two formats: Parquet's name, and the continuation marker of an Arrow IPC message.
_PARQUET_MAGIC: Final = b"PAR1"
_STREAM_MAGIC: Final = b"\xff\xff\xff\xff"


def read_trace(path: str | Path, columns: Sequence[str] | None = None) -> Trace:
    """Read a recording, `*.parquet` or `*.arrows`: its first bytes tell which, not its name.

    Of a stream that was never closed, all whole blocks are read and `Trace.complete` is False.

    Args:
        path: the file.
        columns: only these, in this order, and `spacing_s` of a recording that has it; all of them when None.

    Raises:
        UsageError: no such file, not a recording of this program, or it has no such column.
        DeviceError: the disk does not give it.
    """
    import pyarrow as pa

    path = Path(path)
    try:
        with path.open("rb") as file:
            magic = file.read(4)
        if magic == _PARQUET_MAGIC:
            trace = _read_parquet(path, columns)
        elif magic == _STREAM_MAGIC:
            trace = _read_stream(path)
        else:
            content = "is empty" if not magic else "is neither an Arrow stream nor a Parquet file"
            raise UsageError(f"{path}: not a recording: the file {content}")
    # Names of columns that are no UTF-8 raise where they are first asked for.
    except (pa.ArrowException, OSError, UnicodeDecodeError) as fault:
        if isinstance(fault, OSError) and fault.errno:
            raise unreadable(path, fault) from fault
        raise UsageError(f"{path}: damaged or cut off, nothing in it can be read: {fault}") from fault
    if columns is None:
        return trace
    # Without it rows at rest would count like any other, and be taken for gaps.
    if SPACING_COLUMN in trace and SPACING_COLUMN not in columns:
        columns = (*columns, SPACING_COLUMN)
    return Trace({name: trace[name] for name in columns}, trace.metadata, complete=trace.complete)


def _read_parquet(path: Path, columns: Sequence[str] | None) -> Trace:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        metadata = check_schema(path, file.schema_arrow)
        known = [name for name in (*(columns or ()), SPACING_COLUMN) if name in file.schema_arrow.names]
        table = file.read(columns=None if columns is None else known)
    return Trace(_columns_of(path, table), metadata)


def _read_stream(path: Path) -> Trace:
    import pyarrow as pa

    with pa.memory_map(str(path)) as source:
        size = source.size()
        source.seek(max(0, size - len(STREAM_END)))
        complete = source.read() == STREAM_END
        source.seek(0)
        stream = pa.ipc.open_stream(source)
        metadata = check_schema(path, stream.schema)
        batches = []
        try:
            for batch in stream:
                batch.validate()
                batches.append(batch)
        except (pa.ArrowException, OSError):
            # The block that was being written when the process was killed.
            complete = False
        table = pa.Table.from_batches(batches, schema=stream.schema)
        return Trace(_columns_of(path, table), metadata, complete=complete)


def check_schema(path: Path, schema: Any) -> Metadata:
    """Metadata of a recording; UsageError when the file was not written by this program."""
    import pyarrow as pa

    text = (schema.metadata or {}).get(METADATA_KEY)
    if text is None:
        raise UsageError(f"{path}: not a recording of gantryctl: its metadata is missing")
    strange = [field.name for field in schema if field.type != pa.float64()]
    if strange:
        raise UsageError(f"{path}: not a recording of gantryctl: not a number: {', '.join(strange)}")
    try:
        metadata = json.loads(text)
    except (ValueError, RecursionError) as fault:
        raise UsageError(f"{path}: its metadata cannot be read: {fault}") from fault
    if not isinstance(metadata, dict):
        raise UsageError(f"{path}: its metadata cannot be read: no JSON object")
    return metadata


def _columns_of(path: Path, table: Any) -> dict[str, Any]:
    # Copies, not views: the file may be closed, removed or go on growing.
    for name, column in zip(table.column_names, table.columns, strict=True):
        if column.null_count:
            raise UsageError(f"{path}: not a recording of gantryctl: {name} has empty cells")
    return {
        name: np.concatenate([np.empty(0), *(chunk.to_numpy() for chunk in column.chunks)])
        for name, column in zip(table.column_names, table.columns, strict=True)
    }
