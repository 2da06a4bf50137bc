"""Recorders: rows packed into bytes as they come, turned into columns in blocks."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from gantryctl.trace import Floats, Metadata, Trace, validate_columns


class MemoryRecorder:
    """Keeps the recording in memory, eight bytes a value; `trace()` at any time."""

    def __init__(self, columns: Sequence[str], metadata: Metadata | None = None) -> None:
        self.columns = validate_columns(columns)
        self.metadata = dict(metadata or {})
        self._pack = struct.Struct(f"{len(columns)}d").pack
        self._bytes = bytearray()

    def record(self, row: tuple[float, ...]) -> None:
        """Append one row."""
        self._bytes += self._pack(*row)

    def close(self) -> None:
        """Nothing to finish."""

    def rows(self) -> Floats:
        """A copy of the rows so far, shape (rows, columns)."""
        return np.frombuffer(bytes(self._bytes)).reshape(-1, len(self.columns))

    def trace(self) -> Trace:
        """A copy of the recording so far."""
        return Trace.from_rows(self.columns, self.rows(), self.metadata)
