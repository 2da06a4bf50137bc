"""SDO block transfer of the client (CiA 301): up to 127 segments for each answer, with a CRC over the whole."""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable
from enum import IntEnum
from typing import Final, NoReturn, Protocol

# Client commands; the low bits hold the step and what goes with it.
_DOWNLOAD: Final = 0xC0
_UPLOAD: Final = 0xA0
_WITH_CRC: Final = 0x04
_WITH_SIZE: Final = 0x02
_START_UPLOAD: Final = 0xA3
_SEGMENTS_TAKEN: Final = 0xA2
_UPLOAD_ENDED: Final = 0xA1
_END_DOWNLOAD: Final = 0xC1
# Answers of the server: command and the bits that name it.
_STEP: Final = 0xE3
_DOWNLOAD_STARTED: Final = 0xA0
_DOWNLOAD_TAKEN: Final = 0xA2
_DOWNLOAD_ENDED: Final = 0xA1
_KIND: Final = 0xE1
_UPLOAD_STARTED: Final = 0xC0
_END_UPLOAD: Final = 0xC1

_LAST: Final = 0x80
_MOST_SEGMENTS: Final = 127
_SEGMENT: Final = 7
# Without progress: segments or an acknowledgement are lost again and again.
_STALLS: Final = 4


class BlockAbort(IntEnum):
    """Abort codes of CiA 301 that end a block transfer."""

    TIMED_OUT = 0x0504_0000
    BLOCK_SIZE = 0x0504_0002
    SEQUENCE = 0x0504_0003
    CHECKSUM = 0x0504_0004
    OUT_OF_MEMORY = 0x0504_0005
    LENGTH = 0x0607_0010


class Exchange(Protocol):
    """Frames to and from the SDO server of a node, for one object."""

    @property
    def head(self) -> bytes:
        """Index and sub-index, as they stand in a frame."""

    def send(self, request: bytes) -> None:
        """Send a frame."""

    def receive(self, accept: Callable[[bytes], bool]) -> bytes | None:
        """Wait for a frame that is accepted; None without one. An abort of the server ends the transfer."""

    def abort(self, code: int) -> NoReturn:
        """End the transfer: tell the server, and raise."""


def crc(data: bytes) -> int:
    """CRC of CiA 301: x^16 + x^12 + x^5 + 1, begun with 0."""
    return crc_hqx(data, 0)


def upload(exchange: Exchange, most_bytes: int) -> bytes | None:
    """Upload an object by blocks; None where the server goes over to segments.

    Raises:
        whatever `exchange` raises for an abort and for silence.
    """
    head = exchange.head
    exchange.send(bytes((_UPLOAD | _WITH_CRC,)) + head + bytes((_MOST_SEGMENTS, 0, 0, 0)))
    # A server may answer with the initiate upload of a transfer by segments instead.
    answer = exchange.receive(
        lambda f: f[1:4] == head and (f[0] & _KIND == _UPLOAD_STARTED or f[0] >> 5 == 2)
    )
    if answer is None:
        exchange.abort(BlockAbort.TIMED_OUT)
    if answer[0] >> 5 == 2:
        return None
    size = struct.unpack_from("<I", answer, 4)[0] if answer[0] & _WITH_SIZE else None
    exchange.send(bytes((_START_UPLOAD,)).ljust(8, b"\0"))
    data, stalls = bytearray(), 0
    while True:
        taken, last = _take_segments(exchange, data)
        stalls = 0 if taken else stalls + 1
        if stalls >= _STALLS:
            exchange.abort(BlockAbort.TIMED_OUT)
        if len(data) > most_bytes:
            exchange.abort(BlockAbort.OUT_OF_MEMORY)
        # What is missing behind the last segment in order is sent again.
        exchange.send(bytes((_SEGMENTS_TAKEN, taken, _MOST_SEGMENTS)).ljust(8, b"\0"))
        if last:
            break
    end = exchange.receive(lambda f: f[0] & _STEP == _END_UPLOAD)
    if end is None:
        exchange.abort(BlockAbort.TIMED_OUT)
    found = bytes(data[: len(data) - (end[0] >> 2 & 7)])
    if answer[0] & _WITH_CRC and struct.unpack_from("<H", end, 1)[0] != crc(found):
        exchange.abort(BlockAbort.CHECKSUM)
    if size is not None and len(found) != size:
        exchange.abort(BlockAbort.LENGTH)
    exchange.send(bytes((_UPLOAD_ENDED,)).ljust(8, b"\0"))
    return found


def _take_segments(exchange: Exchange, data: bytearray) -> tuple[int, bool]:
    """Take the segments of one block in order; their number, and whether the last of the object was among them."""
    taken = 0
    while (frame := exchange.receive(lambda _: True)) is not None:
        number, last = frame[0] & ~_LAST, bool(frame[0] & _LAST)
        if number == taken + 1:
            taken = number
            data += frame[1:8]
            if last:
                return taken, True
        # Behind a gap nothing is taken, but the end of the block is seen. A copy of one before changes nothing.
        if (number > taken and last) or number == _MOST_SEGMENTS:
            break
    return taken, False


def download(exchange: Exchange, data: bytes) -> None:
    """Download an object by blocks.

    Raises:
        whatever `exchange` raises for an abort and for silence.
    """
    head = exchange.head
    exchange.send(bytes((_DOWNLOAD | _WITH_CRC | _WITH_SIZE,)) + head + struct.pack("<I", len(data)))
    answer = exchange.receive(lambda f: f[0] & _STEP == _DOWNLOAD_STARTED and f[1:4] == head)
    if answer is None:
        exchange.abort(BlockAbort.TIMED_OUT)
    segments = answer[4]
    at = stalls = 0
    while at < len(data):
        if not 1 <= segments <= _MOST_SEGMENTS:
            exchange.abort(BlockAbort.BLOCK_SIZE)
        sent = _send_segments(exchange, data, at, segments)
        taken = exchange.receive(lambda f: f[0] & _STEP == _DOWNLOAD_TAKEN)
        if taken is not None:
            if taken[1] > sent:
                exchange.abort(BlockAbort.SEQUENCE)
            at, segments = at + _SEGMENT * taken[1], taken[2]
        stalls = 0 if taken is not None and taken[1] else stalls + 1
        if stalls >= _STALLS:
            exchange.abort(BlockAbort.TIMED_OUT)
    unused = -len(data) % _SEGMENT
    checksum = struct.pack("<H", crc(data)) if answer[0] & _WITH_CRC else b"\0\0"
    exchange.send((bytes((_END_DOWNLOAD | unused << 2,)) + checksum).ljust(8, b"\0"))
    if exchange.receive(lambda f: f[0] & _STEP == _DOWNLOAD_ENDED) is None:
        exchange.abort(BlockAbort.TIMED_OUT)


def _send_segments(exchange: Exchange, data: bytes, at: int, most: int) -> int:
    """Send the segments of one block; their number."""
    for number in range(1, most + 1):
        part = data[at : at + _SEGMENT]
        at += _SEGMENT
        last = at >= len(data)
        exchange.send(bytes((number | (_LAST if last else 0),)) + part.ljust(_SEGMENT, b"\0"))
        if last:
            return number
    return most
