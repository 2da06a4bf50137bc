"""Trace rows on their way out of the scan: into a ring, while power is on."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from gantryctl.errors import UsageError
from gantryctl.service.memory.memory import ROW_BYTES
from gantryctl.service.memory.ring import Ring


class RingRecorder:
    """A `Recorder` that packs rows into a ring; the recorder process writes the file.

    Attributes:
        number: of the recording under way; 0 while nothing is recorded.
        lost: rows that found the ring full.
    """

    def __init__(self, ring: Ring, columns: Sequence[str]) -> None:
        if (len(columns) + 1) * 8 > ROW_BYTES - 8:
            raise UsageError(f"a trace of {len(columns)} columns: the ring takes {ROW_BYTES // 8 - 2}")
        self.columns = tuple(columns)
        self.number = 0
        self.lost = 0
        self._ring = ring
        self._pack = struct.Struct(f"<{len(columns) + 1}d").pack

    def record(self, row: tuple[float, ...]) -> None:
        """Pack one row of the recording under way."""
        if self.number and not self._ring.put(self._pack(self.number, *row)):
            self.lost += 1

    def stop(self) -> None:
        """End the recording under way."""
        # A record of the number alone marks the end.
        if self.number:
            self._ring.put(struct.pack("<d", self.number))
            self.number = 0

    def close(self) -> None:
        """End the recording under way."""
        self.stop()
