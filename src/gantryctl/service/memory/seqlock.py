"""A record that one process publishes and many read, always whole and never waited for by the writer.

The sequence is odd while the writer writes. A reader copies, and takes the copy only if the sequence was even and has
not changed.
"""

from __future__ import annotations

import struct
import zlib
from typing import Final

from gantryctl.errors import UsageError

_HEADER: Final = 24
# Length and CRC: the check sum covers machines that reorder stores.
_LENGTHS: Final = struct.Struct("<II")
# A reader gives up after so many attempts instead of waiting for a writer that was killed inside a publication.
_TRIES: Final = 200


class SequenceLock:
    """Writer (`publish`) or reader (`read`) of one record in shared memory, zero at first.

    Args:
        memory: shared memory, aligned to eight bytes.
    """

    def __init__(self, memory: memoryview) -> None:
        self.capacity = len(memory) - _HEADER
        self._memory = memory
        self._words = memory[:8].cast("Q")

    def publish(self, data: bytes) -> None:
        """Replace the record.

        Raises:
            UsageError: it is too long; the old one stays.
        """
        if len(data) > self.capacity:
            raise UsageError(f"record of {len(data)} bytes: there is room for {self.capacity}")
        words, memory = self._words, self._memory
        # The sequence is odd already if a writer was killed inside.
        writing = words[0] | 1
        words[0] = writing
        _LENGTHS.pack_into(memory, 8, len(data), zlib.crc32(data))
        memory[_HEADER : _HEADER + len(data)] = data
        words[0] = writing + 1

    @property
    def version(self) -> int:
        """Number of publications so far."""
        return self._words[0] // 2

    def read(self) -> bytes | None:
        """Return the newest whole record; None before the first, or while the writer does not finish one."""
        words, memory = self._words, self._memory
        for _ in range(_TRIES):
            before = words[0]
            if before == 0:
                return None
            if before % 2:
                continue
            length, check = _LENGTHS.unpack_from(memory, 8)
            data = bytes(memory[_HEADER : _HEADER + min(length, self.capacity)])
            if words[0] == before and len(data) == length and zlib.crc32(data) == check:
                return data
        return None
