"""Frames of the bus on their way out of the scan: into a ring, the recorder process writes the files."""

from __future__ import annotations

import struct
from enum import IntEnum
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.service.memory.ring import Ring
from gantryctl.trace.frames.ring import BusFrame, FrameLog

# Time, identifier, kind, length, data: eight bytes of a frame, a code or the name of a bus.
_RECORD: Final = struct.Struct("<dIBB16s")


class _Kind(IntEnum):
    RECEIVED = 0
    SENT = 1
    ALARM = 2
    OPENED = 3
    OPENED_VIRTUAL = 4


class FrozenAt(NamedTuple):
    """Alarm around which the frames are to be kept."""

    code: str
    ago_s: float


class LinkOpened(NamedTuple):
    """Link that the frames behind it come from; the clock of a virtual one begins at 0."""

    channel: str
    virtual: bool


class RingFrames:
    """Log of the links of the controller.

    Attributes:
        lost: frames that found the ring full.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self.lost = 0

    def link(self, channel: str, *, virtual: bool) -> FrameLog:
        """Make the log of one link."""
        self._put(0.0, 0, _Kind.OPENED_VIRTUAL if virtual else _Kind.OPENED, channel.encode()[:16])
        return self._take

    def alarm(self, code: str, _path: Path, ago_s: float = 0.0) -> None:
        """Freeze the frames around an alarm; the recorder names the file."""
        self._put(ago_s, 0, _Kind.ALARM, code.encode()[:16])

    def _take(self, time_s: float, can_id: int, data: bytes, sent: bool) -> None:
        self._put(time_s, can_id, _Kind.SENT if sent else _Kind.RECEIVED, data)

    def _put(self, time_s: float, can_id: int, kind: _Kind, data: bytes) -> None:
        if not self._ring.put(_RECORD.pack(time_s, can_id, kind, len(data), data)):
            self.lost += 1


def unpacked(record: bytes) -> BusFrame | FrozenAt | LinkOpened:
    """What a record of the ring says.

    Raises:
        ValueError: it was not made by `RingFrames`.
    """
    try:
        time_s, can_id, number, length, data = _RECORD.unpack(record)
    except struct.error as wrong:
        raise ValueError(str(wrong)) from wrong
    kind, data = _Kind(number), data[:length]
    if kind is _Kind.ALARM:
        return FrozenAt(data.decode(), time_s)
    if kind in (_Kind.OPENED, _Kind.OPENED_VIRTUAL):
        return LinkOpened(data.decode(errors="replace"), kind is _Kind.OPENED_VIRTUAL)
    return BusFrame(time_s, can_id, data, kind is _Kind.SENT)
