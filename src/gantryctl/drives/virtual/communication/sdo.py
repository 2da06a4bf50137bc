"""SDO server (CiA 301): expedited and segmented transfers, one at a time; block transfer is refused.

| client command (bits 7..5) | meaning            |
|----------------------------|--------------------|
| 1                          | initiate download  |
| 0                          | download segment   |
| 2                          | initiate upload    |
| 3                          | upload segment     |
| 4                          | abort              |
| 5, 6                       | block transfer     |
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Final

from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.communication.dictionary import Dictionary

_MAX_BYTES: Final = 1024
_TOGGLE: Final = 0x10
_LAST: Final = 0x01


@dataclass(slots=True)
class _Transfer:
    """Segmented transfer under way."""

    index: int
    sub: int
    upload: bool
    data: bytearray = field(default_factory=bytearray)
    size: int | None = None
    toggle: int = 0


class SdoServer:
    """Answer one request frame with one response frame."""

    def __init__(self, od: Dictionary) -> None:
        self._od = od
        self._transfer: _Transfer | None = None

    def reset(self) -> None:
        """Discard a transfer under way."""
        self._transfer = None

    def answer(self, frame: bytes) -> bytes | None:
        """Response to a request; None to an abort and to a frame of another length."""
        if len(frame) != 8:
            return None
        index, sub = struct.unpack_from("<HB", frame, 1)
        command = frame[0] >> 5
        if command in (0, 3) and self._transfer is not None:
            index, sub = self._transfer.index, self._transfer.sub
        try:
            match command:
                case 1:
                    return self._start_download(index, sub, frame)
                case 0:
                    return self._download_segment(frame)
                case 2:
                    return self._start_upload(index, sub)
                case 3:
                    return self._upload_segment(frame)
                case 4:
                    self._transfer = None
                    return None
                case _:
                    raise SdoAbort(Abort.COMMAND)
        except SdoAbort as refused:
            self._transfer = None
            return abort_frame(index, sub, refused.code)

    def _start_download(self, index: int, sub: int, frame: bytes) -> bytes:
        self._transfer = None
        expedited, sized = frame[0] & 2, frame[0] & 1
        self._od.may_write(self._od.entry(index, sub))
        if expedited:
            data = frame[4 : 8 - (frame[0] >> 2 & 3)] if sized else frame[4:8]
            # Without a size in the frame the server knows how many of the four bytes count.
            if not sized:
                data = data[: len(self._od.packed(self._od.entry(index, sub))) or 4]
            self._od.download(index, sub, data)
        else:
            size = struct.unpack_from("<I", frame, 4)[0] if sized else None
            if size is not None and size > _MAX_BYTES:
                raise SdoAbort(Abort.SIZE_HIGH)
            self._transfer = _Transfer(index, sub, upload=False, size=size)
        return struct.pack("<BHBI", 0x60, index, sub, 0)

    def _download_segment(self, frame: bytes) -> bytes:
        transfer = self._running(upload=False, toggle=frame[0] & _TOGGLE)
        transfer.data += frame[1 : 8 - (frame[0] >> 1 & 7)]
        if len(transfer.data) > _MAX_BYTES:
            raise SdoAbort(Abort.OUT_OF_MEMORY)
        if frame[0] & _LAST:
            self._transfer = None
            if transfer.size is not None and len(transfer.data) != transfer.size:
                raise SdoAbort(Abort.SIZE)
            self._od.download(transfer.index, transfer.sub, bytes(transfer.data))
        reply = 0x20 | transfer.toggle
        transfer.toggle ^= _TOGGLE
        return bytes((reply, 0, 0, 0, 0, 0, 0, 0))

    def _start_upload(self, index: int, sub: int) -> bytes:
        self._transfer = None
        data = self._od.upload(index, sub)
        if 0 < len(data) <= 4:
            return struct.pack("<BHB", 0x43 | (4 - len(data)) << 2, index, sub) + data.ljust(4, b"\0")
        self._transfer = _Transfer(index, sub, upload=True, data=bytearray(data))
        return struct.pack("<BHBI", 0x41, index, sub, len(data))

    def _upload_segment(self, frame: bytes) -> bytes:
        transfer = self._running(upload=True, toggle=frame[0] & _TOGGLE)
        part, transfer.data = bytes(transfer.data[:7]), transfer.data[7:]
        last = not transfer.data
        reply = transfer.toggle | (7 - len(part)) << 1 | last
        transfer.toggle ^= _TOGGLE
        if last:
            self._transfer = None
        return bytes((reply,)) + part.ljust(7, b"\0")

    def _running(self, upload: bool, toggle: int) -> _Transfer:
        transfer = self._transfer
        if transfer is None or transfer.upload is not upload:
            raise SdoAbort(Abort.COMMAND)
        if toggle != transfer.toggle:
            raise SdoAbort(Abort.TOGGLE)
        return transfer


def abort_frame(index: int, sub: int, code: int) -> bytes:
    """Abort transfer message."""
    return struct.pack("<BHBI", 0x80, index, sub, code & 0xFFFFFFFF)
