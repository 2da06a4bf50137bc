"""Recorders: a row is packed into bytes when it comes, and turned into columns a block at a time."""

from __future__ import annotations

import contextlib
import math
import os
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from gantryctl.errors import DeviceError
from gantryctl.trace.columns import validate_columns
from gantryctl.trace.files import (
    CLOSED_SUFFIX,
    LIVE_SUFFIX,
    STREAM_END,
    Floats,
    Metadata,
    arrow_schema,
    head_of,
    record_batch,
    whole_part,
    write_parquet,
)
from gantryctl.trace.table import Trace

# Rows in a block of the live file: what a kill may cost. Rows are packed into bytes as they come: turning a thousand
# tuples into columns takes about five times as long in one scan, once a second, and that scan would be late (0006).
FLUSH_ROWS: Final = 1000
# Names and metadata of 64 columns are below: a shorter file that cannot be read has lost nothing but its head.
_HEAD_MOST_BYTES: Final = 16 * 1024


class MemoryRecorder:
    """Recording in memory, eight bytes a value; `trace()` at any time."""

    def __init__(self, columns: Sequence[str], metadata: Metadata | None = None) -> None:
        self.columns = validate_columns(columns)
        self.metadata = dict(metadata or {})
        self._pack = struct.Struct(f"{len(columns)}d").pack
        self._bytes = bytearray()

    def record(self, row: tuple[float, ...]) -> None:
        """Append one row."""
        self._bytes += self._pack(*row)

    def forget(self) -> None:
        """Drop the rows so far: the recording goes on from here."""
        self._bytes.clear()

    def close(self) -> None:
        """Do nothing: there is no file to finish."""

    def rows(self) -> Floats:
        """Copy the rows so far, shape (rows, columns)."""
        return np.frombuffer(bytes(self._bytes)).reshape(-1, len(self.columns))

    def trace(self) -> Trace:
        """Copy the recording so far."""
        return Trace.from_rows(self.columns, self.rows(), self.metadata)


class ArrowRecorder:
    """Records into `<path>.arrows`, readable at any time and after a kill; `close()` makes `<path>.parquet`
    of it.

    Args:
        flush_rows: rows in a block.
        resume: go on with the live file that a killed run has left, after its last whole block.

    Raises:
        DeviceError: the file cannot be made or is there already, and from `record`, `flush` and `close` when a block
            or the closed file cannot be written. The blocks before it stay readable.

    Attributes:
        live_path: the stream while it grows.
        path: the closed file.
        resumed_s: time of the last row of the file that is gone on with, -inf for a new one.
    """

    def __init__(
        self,
        path: str | Path,
        columns: Sequence[str],
        metadata: Metadata | None = None,
        flush_rows: int = FLUSH_ROWS,
        *,
        resume: bool = False,
    ) -> None:
        self.columns = validate_columns(columns)
        path = Path(path)
        stem = path.stem if path.suffix in {LIVE_SUFFIX, CLOSED_SUFFIX} else path.name
        self.live_path = path.with_name(stem + LIVE_SUFFIX)
        self.path = path.with_name(stem + CLOSED_SUFFIX)
        self.resumed_s = -math.inf
        self._schema = arrow_schema(self.columns, metadata or {})
        self._pack = struct.Struct(f"{len(self.columns)}d").pack
        self._bytes = bytearray()
        self._block_bytes = flush_rows * 8 * len(self.columns)
        self._closed = self._failed = False
        try:
            self._file = self._open(resume)
            # Columns and metadata are in the file from the start.
            self.flush()
        except FileExistsError:
            raise DeviceError(
                f"{self.live_path}: left by a run that was killed, or in use; export it or move it away"
            ) from None
        except OSError as fault:
            raise DeviceError(f"{self.live_path}: cannot be made: {fault.strerror or fault}") from fault

    @classmethod
    def finish(cls, live: Path) -> None:
        """Close the live file of a run that was killed; remove one that was killed before its first block.

        Raises:
            DeviceError: it is no recording, or the disk does not take the closed file.
        """
        end, last_s = whole_part(live)
        if last_s == -math.inf and (end or live.stat().st_size < _HEAD_MOST_BYTES):
            live.unlink()
            return
        cls(live, *head_of(live), resume=True).close()

    def _open(self, resume: bool) -> Any:
        """Open the live file for the next block."""
        import pyarrow as pa

        begun, self.resumed_s = whole_part(self.live_path) if resume else (0, -math.inf)
        if begun:
            os.truncate(self.live_path, begun)
            return pa.OSFile(str(self.live_path), "ab")
        # Never over the recording of a run that was killed.
        with self.live_path.open("wb" if resume else "xb"):
            pass
        # Arrow's own file has no buffer in the process: a kill costs the last block and no more (decision 0006).
        file = pa.OSFile(str(self.live_path), "wb")
        file.write(self._schema.serialize())
        return file

    def record(self, row: tuple[float, ...]) -> None:
        """Append one row; every `flush_rows` of them go to the file."""
        self._bytes += self._pack(*row)
        if len(self._bytes) >= self._block_bytes:
            self.flush()

    def close(self) -> None:
        """Write what is left, make the Parquet file, remove the live one; may be called twice.

        After a block that could not be written, the live file is left as it is.
        """
        if self._closed:
            return
        self._closed = True
        try:
            if not self._failed:
                self.flush()
                self._write(STREAM_END)
        finally:
            with contextlib.suppress(OSError):
                self._file.close()
        if not self._failed:
            self._convert()

    def leave(self) -> None:
        """Close the live file as it is: `resume` goes on with it."""
        self.flush()
        self._closed = True
        self._file.close()

    def flush(self) -> None:
        """Write the rows so far as one block: no kill of this process takes it back."""
        rows = np.frombuffer(bytes(self._bytes)).reshape(-1, len(self.columns))
        self._bytes.clear()
        self._write(record_batch(self._schema, rows).serialize())

    def _write(self, data: Any) -> None:
        try:
            self._file.write(data)
        except OSError as fault:
            self._failed = True
            raise DeviceError(f"{self.live_path}: cannot be written: {fault.strerror or fault}") from fault

    def _convert(self) -> None:
        import pyarrow as pa

        with pa.memory_map(str(self.live_path)) as source, pa.ipc.open_stream(source) as stream:
            write_parquet(self.path, self._schema, stream)
        # The stream goes last: until the closed file is on the disk it is the only copy.
        self.live_path.unlink()
