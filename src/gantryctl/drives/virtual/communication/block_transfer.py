"""SDO block transfer of the server (CiA 301): segments by blocks, a CRC over the whole.

| client command | upload                    | download            |
|----------------|---------------------------|---------------------|
| A0             | initiate                  |                     |
| A3             | start: send a block       |                     |
| A2             | taken so many, send more  |                     |
| A1             | end                       |                     |
| C0             |                           | initiate            |
| 01 to FF       |                           | segment 1 to 127    |
| C1             |                           | end                 |
"""

from __future__ import annotations

import struct
from typing import Final

from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort

_SEGMENT: Final = 7
_MOST: Final = 127
_LAST: Final = 0x80
_CRC: Final = 0x04
_SIZE: Final = 0x02


def checksum(data: bytes) -> int:
    """CRC of CiA 301, bit by bit: polynomial 1021h, begun with 0."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
    return value


class BlockUpload:
    """Upload under way.

    Args:
        index, sub: object. data: its value.
        frame: initiate request of the client.

    Raises:
        SdoAbort: a block size that there is not.
    """

    def __init__(self, index: int, sub: int, data: bytes, frame: bytes) -> None:
        self.index, self.sub = index, sub
        self._data, self._with_crc = data, bool(frame[0] & _CRC)
        self._block = _block_size(frame[4])
        self._at = self._sent = 0
        self.done = False

    def begin(self) -> bytes:
        """Answer to the initiate request."""
        return struct.pack("<BHBI", 0xC0 | _CRC | _SIZE, self.index, self.sub, len(self._data))

    def answer(self, frame: bytes) -> tuple[bytes, ...]:
        """Frames for one frame of the client.

        Raises:
            SdoAbort: it fits no step.
        """
        match frame[0] & 3:
            case 3:
                return self._segments()
            case 2:
                if frame[1] > self._sent:
                    raise SdoAbort(Abort.SEQUENCE)
                self._at += _SEGMENT * frame[1]
                self._block = _block_size(frame[2])
                return self._segments() if self._at < len(self._data) else (self._end(),)
            case 1:
                self.done = True
                return ()
        raise SdoAbort(Abort.COMMAND)

    def _segments(self) -> tuple[bytes, ...]:
        left = -(-(len(self._data) - self._at) // _SEGMENT)
        self._sent = min(self._block, left)
        frames = []
        for number in range(1, self._sent + 1):
            begin = self._at + _SEGMENT * (number - 1)
            part = self._data[begin : begin + _SEGMENT].ljust(_SEGMENT, b"\0")
            frames.append(bytes((number | (_LAST if number == left else 0),)) + part)
        return tuple(frames)

    def _end(self) -> bytes:
        unused = -len(self._data) % _SEGMENT
        crc = checksum(self._data) if self._with_crc else 0
        return struct.pack("<BH5x", 0xC1 | unused << 2, crc)


class BlockDownload:
    """Download under way.

    Args:
        index, sub: object.
        frame: initiate request of the client.
        most_bytes: that this server takes.

    Attributes:
        data: what was downloaded, once `done`.

    Raises:
        SdoAbort: too long.
    """

    def __init__(self, index: int, sub: int, frame: bytes, most_bytes: int) -> None:
        self.index, self.sub, self._most = index, sub, most_bytes
        self._with_crc = bool(frame[0] & _CRC)
        self._size = struct.unpack_from("<I", frame, 4)[0] if frame[0] & _SIZE else None
        if self._size is not None and self._size > most_bytes:
            raise SdoAbort(Abort.SIZE_HIGH)
        self._taken = 0
        self._final: int | None = None
        self.data = bytearray()
        self.done = False

    def begin(self) -> bytes:
        """Answer to the initiate request."""
        return struct.pack("<BHBB3x", 0xA0 | _CRC, self.index, self.sub, _MOST)

    def answer(self, frame: bytes) -> tuple[bytes, ...]:
        """Frames for one frame of the client.

        Raises:
            SdoAbort: a wrong checksum or length, or too many bytes.
        """
        if self._final is None:
            return self._segment(frame)
        if frame[0] == self._final:
            # The acknowledgement was lost: the last segment came again.
            return (self._acknowledge(self._final & ~_LAST),)
        if frame[0] & 0xE3 != 0xC1:
            return ()
        del self.data[len(self.data) - (frame[0] >> 2 & 7) :]
        if self._with_crc and struct.unpack_from("<H", frame, 1)[0] != checksum(bytes(self.data)):
            raise SdoAbort(Abort.CHECKSUM)
        if self._size is not None and len(self.data) != self._size:
            raise SdoAbort(Abort.SIZE)
        self.done = True
        return (b"\xa1".ljust(8, b"\0"),)

    def _segment(self, frame: bytes) -> tuple[bytes, ...]:
        number, last = frame[0] & ~_LAST, bool(frame[0] & _LAST)
        if number == self._taken + 1:
            self._taken = number
            self.data += frame[1:8]
            if len(self.data) > self._most + _SEGMENT:
                raise SdoAbort(Abort.OUT_OF_MEMORY)
            if last:
                self._final = frame[0]
                return (self._acknowledge(number),)
        elif number <= self._taken:
            return ()
        if not last and number != _MOST:
            return ()
        # The block is over: what lies behind a gap is sent again.
        taken, self._taken = self._taken, 0
        return (self._acknowledge(taken),)

    @staticmethod
    def _acknowledge(taken: int) -> bytes:
        return bytes((0xA2, taken, _MOST)).ljust(8, b"\0")


def _block_size(value: int) -> int:
    if not 1 <= value <= _MOST:
        raise SdoAbort(Abort.BLOCK_SIZE)
    return value
