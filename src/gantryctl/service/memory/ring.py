"""A bounded ring of records in shared memory, from one process to one other, without locks.

The writer moves `tail` after the record is whole, the reader moves `head` when it is done with it.
"""

from __future__ import annotations

import struct
import zlib
from typing import Final

from gantryctl.errors import UsageError

# Head and tail are eight aligned bytes, stored at once: a process that is killed in between leaves the ring as it was.
# In words of eight bytes, each on a cache line of its own.
_HEAD: Final = 0
_TAIL: Final = 8
_DAMAGED: Final = 16
_FIRST_SLOT: Final = 192
# Length and CRC. x86 keeps the order of stores; elsewhere the check sum refuses a record that came apart
# (decision 0011).
_RECORD: Final = struct.Struct("<II")


class Ring:
    """One end of a ring: the writer's or the reader's.

    Args:
        memory: the same shared memory on both ends, zero at first, aligned to eight bytes.
        slot_bytes: room for one record.
    """

    def __init__(self, memory: memoryview, slot_bytes: int) -> None:
        if slot_bytes % 8:
            raise UsageError(f"slot of {slot_bytes} bytes: a multiple of 8 is needed")
        self.slots = (len(memory) - _FIRST_SLOT) // slot_bytes
        if self.slots < 1:
            raise UsageError(f"ring of {len(memory)} bytes has no room for a slot of {slot_bytes} bytes")
        self.record_max = slot_bytes - _RECORD.size
        self._slot = slot_bytes
        self._memory = memory
        self._words = memory[:_FIRST_SLOT].cast("Q")

    def __len__(self) -> int:
        """Waiting records."""
        return max(0, min(self.slots, self._words[_TAIL] - self._words[_HEAD]))

    @property
    def damaged(self) -> int:
        """Records that the reader has discarded."""
        return self._words[_DAMAGED]

    # --- writer -----------------------------------------------------------------------------------

    def put(self, record: bytes) -> bool:
        """Append one record; False when the ring is full and nothing was written.

        Raises:
            UsageError: the record is longer than a slot.
        """
        if len(record) > self.record_max:
            raise UsageError(f"record of {len(record)} bytes: a slot takes {self.record_max}")
        words = self._words
        tail = words[_TAIL]
        if tail - words[_HEAD] >= self.slots:
            return False
        at = _FIRST_SLOT + tail % self.slots * self._slot
        memory = self._memory
        _RECORD.pack_into(memory, at, len(record), zlib.crc32(record))
        memory[at + 8 : at + 8 + len(record)] = record
        words[_TAIL] = tail + 1
        return True

    @property
    def written(self) -> int:
        """Number of the newest record that was written."""
        return self._words[_TAIL]

    @property
    def done(self) -> int:
        """Number of the newest record that was taken."""
        return self._words[_HEAD]

    # --- reader -----------------------------------------------------------------------------------

    def take(self) -> bytes | None:
        """Remove and return the oldest record, None from an empty ring. Damaged ones are counted and left out."""
        while True:
            found = self.peek(1)
            if not found:
                return None
            self.advance(1)
            if found[0] is not None:
                return found[0]
            self._words[_DAMAGED] += 1

    def peek(self, limit: int, skip: int = 0) -> list[bytes | None]:
        """Return the oldest records but `skip`, at most `limit`, and leave them in the ring; None for a damaged one."""
        words = self._words
        head, tail = words[_HEAD], words[_TAIL]
        # No writer of this program leaves such numbers: start over at the tail.
        if not 0 <= tail - head <= self.slots:
            words[_DAMAGED] += 1
            words[_HEAD] = tail
            return []
        return [self._read(number) for number in range(head + skip, min(tail, head + skip + limit))]

    def _read(self, number: int) -> bytes | None:
        at = _FIRST_SLOT + number % self.slots * self._slot
        length, check = _RECORD.unpack_from(self._memory, at)
        record = bytes(self._memory[at + 8 : at + 8 + min(length, self.record_max)])
        return record if len(record) == length and zlib.crc32(record) == check else None

    def advance(self, count: int) -> None:
        """Remove the oldest `count` records."""
        self._words[_HEAD] = min(self._words[_HEAD] + count, self._words[_TAIL])

    def clear(self) -> int:
        """Discard all waiting records; return how many there were."""
        waiting = len(self)
        self._words[_HEAD] = self._words[_TAIL]
        return waiting

    # --- onlooker ---------------------------------------------------------------------------------

    def look(self, first: int, limit: int) -> tuple[int, list[bytes | None]]:
        """Return records that are still in memory, taken or not, and change nothing; a process beside both ends may.

        Args:
            first: number of the oldest record that is wanted, counted from 0 over all that were ever written. limit: of
                records.

        Returns:
            Number of the first record, later than wanted where older ones are overwritten, and the records from there
            on; None for a damaged one.
        """
        tail = self._words[_TAIL]
        begin = min(max(first, tail - self.slots, 0), tail)
        found = [self._read(number) for number in range(begin, min(tail, begin + limit))]
        # What the writer has overwritten meanwhile, or overwrites now, may read as a whole record of another number.
        overwritten = max(0, self._words[_TAIL] - self.slots + 1 - begin)
        return begin + min(overwritten, len(found)), found[overwritten:]
