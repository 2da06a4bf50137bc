"""The latest frames of a bus in bounded memory, numbered from 0."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple, Protocol

# 30 s of a bus that is full: 1 Mbit/s and 130 bits a frame with eight bytes are 7700 frames a second.
FRAMES_KEPT: Final = 1 << 18
# Time, identifier, sent, length, data of a classic frame.
_RECORD: Final = struct.Struct("<dIBB8s")
_SETUP_KEPT: Final = 1024

# SDO of CiA 301: requests and answers of all nodes; command specifier in the upper three bits of the first byte.
_SDO: Final = range(0x580, 0x680)
_REQUESTS: Final = 0x600
_DOWNLOAD, _UPLOAD = 1, 2
# Identifiers and mapping of the telegrams.
_TELEGRAMS: Final = range(0x1400, 0x1C00)
# Identity, rated torque, counts per turn, gear, unit of velocities.
_UNITS: Final = frozenset((0x1018, 0x6076, 0x608F, 0x6091, 0x60A9))

FrameLog = Callable[[float, int, bytes, bool], None]
"""Takes each data frame: time on the clock of its link, identifier, data, and whether this controller sent it."""


class LinkLog(Protocol):
    """What keeps the frames of a bus."""

    def link(self, channel: str, *, virtual: bool) -> FrameLog:
        """Make the log of one link; `virtual`: its clock begins at 0."""
        ...

    def alarm(self, code: str, path: Path, ago_s: float = 0.0) -> None:
        """Freeze the frames around an alarm that was raised some time ago."""
        ...


class BusFrame(NamedTuple):
    """Classic data frame with an 11-bit identifier, on the clock of the controller."""

    time_s: float
    can_id: int
    data: bytes
    sent: bool
    """By the controller; False for a received frame."""


def tells_telegrams(can_id: int, data: bytes) -> bool:
    """Whether a frame is part of an SDO transfer that tells what the process data and their units are."""
    if can_id not in _SDO or len(data) != 8:
        return False
    index = data[1] | data[2] << 8
    # What is written, and what the node answers to a read.
    specifier = _DOWNLOAD if can_id >= _REQUESTS else _UPLOAD
    return data[0] >> 5 == specifier and (index in _TELEGRAMS or index in _UNITS)


class FrameRing:
    """The latest frames; one thread writes, another one may read.

    Args:
        slots: frames kept.

    Attributes:
        written: number of the next frame, and so the frames put so far.
        setup: what the bus has told of its telegrams and units, oldest first: without it the frames that are left
            could not be decoded when the set-up itself has been overwritten.
    """

    # Packed into bytes made at the start: the garbage collector is off while an axis runs, and 30 s of tuples would
    # take 50 MB.

    def __init__(self, slots: int = FRAMES_KEPT) -> None:
        self._slots = slots
        self._bytes = bytearray(slots * _RECORD.size)
        self.written = 0
        self.setup: dict[tuple[int, bytes], BusFrame] = {}

    @property
    def oldest(self) -> int:
        """Number of the oldest frame that is left."""
        return max(0, self.written - self._slots)

    @property
    def last_s(self) -> float:
        """Time of the newest frame, s; 0 before the first."""
        return self.frame(self.written - 1).time_s if self.written else 0.0

    def put(self, frame: BusFrame) -> None:
        """Append one frame in place of the oldest."""
        time_s, can_id, data, sent = frame
        at = self.written % self._slots * _RECORD.size
        _RECORD.pack_into(self._bytes, at, time_s, can_id, sent, len(data), data)
        if tells_telegrams(can_id, data):
            # The last of each object counts, in the order in which it was said.
            key = (can_id, data[:4])
            self.setup.pop(key, None)
            if len(self.setup) < _SETUP_KEPT:
                self.setup[key] = frame
        # Last: a reader in another thread sees whole frames only.
        self.written += 1

    def frame(self, number: int) -> BusFrame:
        """Read one frame that is left."""
        at = number % self._slots * _RECORD.size
        time_s, can_id, sent, length, data = _RECORD.unpack_from(self._bytes, at)
        return BusFrame(time_s, can_id, data[:length], bool(sent))

    def first_since(self, time_s: float) -> int:
        """Number of the first frame that is left and not older than a time."""
        low, high = self.oldest, self.written
        while low < high:
            middle = (low + high) // 2
            if self.frame(middle).time_s < time_s:
                low = middle + 1
            else:
                high = middle
        return low
