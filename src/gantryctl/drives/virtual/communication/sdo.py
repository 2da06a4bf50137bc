"""SDO server (CiA 301): expedited and segmented transfers and those by blocks, one at a time.

| client command (bits 7..5) | meaning            |
|----------------------------|--------------------|
| 1                          | initiate download  |
| 0                          | download segment   |
| 2                          | initiate upload    |
| 3                          | upload segment     |
| 4                          | abort              |
| 5, 6                       | block transfer: `block_transfer` |
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.communication.block_transfer import BlockDownload, BlockUpload
from gantryctl.drives.virtual.communication.dictionary import Dictionary

_MAX_BYTES: Final = 2048
# In a block download every frame is a segment: one that was left must not take the requests that follow for segments.
_BLOCK_S: Final = 0.3
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
    """Answer request frames.

    Args:
        od: objects.
        blocks: block transfer is served.
        now_s: clock, s, for a block download that the client has left.
    """

    def __init__(self, od: Dictionary, blocks: bool, now_s: Callable[[], float]) -> None:
        self._od, self._blocks, self._now_s = od, blocks, now_s
        self._transfer: _Transfer | None = None
        self._block: BlockUpload | BlockDownload | None = None
        self._block_s = 0.0

    def reset(self) -> None:
        """Discard a transfer under way."""
        self._transfer = self._block = None

    def answer(self, frame: bytes) -> tuple[bytes, ...]:
        """Responses to a request; none to an abort, to a frame of another length, and to most segments of a block."""
        if len(frame) != 8:
            return ()
        index, sub = struct.unpack_from("<HB", frame, 1)
        command = frame[0] >> 5
        under_way = self._of_a_block(frame) or (self._transfer if command in (0, 3) else None)
        if under_way is not None:
            index, sub = under_way.index, under_way.sub
        try:
            if under_way is not None and under_way is self._block:
                return self._go_on(under_way, frame)
            match command:
                case 1:
                    return (self._start_download(index, sub, frame),)
                case 0:
                    return (self._download_segment(frame),)
                case 2:
                    return (self._start_upload(index, sub),)
                case 3:
                    return (self._upload_segment(frame),)
                case 4:
                    self.reset()
                    return ()
                case 5 | 6:
                    return self._start_block(index, sub, frame)
                case _:
                    raise SdoAbort(Abort.COMMAND)
        except SdoAbort as refused:
            self.reset()
            return (abort_frame(index, sub, refused.code),)

    # --- by blocks ----------------------------------------------------------------------------------------------------

    def _of_a_block(self, frame: bytes) -> BlockUpload | BlockDownload | None:
        """Block transfer that a frame belongs to."""
        block, since = self._block, self._block_s
        if block is None or self._now_s() - since > _BLOCK_S:
            self._block = None
            return None
        self._block_s = self._now_s()
        # 80h is the abort: segments are numbered from 1.
        takes = frame[0] != 0x80 if isinstance(block, BlockDownload) else frame[0] >> 5 == 5 and frame[0] & 3
        return block if takes else None

    def _start_block(self, index: int, sub: int, frame: bytes) -> tuple[bytes, ...]:
        self.reset()
        # Only a step that begins a transfer: the others belong to one that is not under way.
        if not self._blocks or frame[0] & (3 if frame[0] >> 5 == 5 else 1):
            raise SdoAbort(Abort.COMMAND)
        self._block_s = self._now_s()
        if frame[0] >> 5 == 6:
            self._od.may_write(self._od.entry(index, sub))
            self._block = BlockDownload(index, sub, frame, _MAX_BYTES)
            return (self._block.begin(),)
        data = self._od.upload(index, sub)
        # The client's threshold: up to so many bytes the server may take the other protocol, which is shorter then.
        if len(data) <= frame[5]:
            return (self._start_upload(index, sub),)
        self._block = BlockUpload(index, sub, data, frame)
        return (self._block.begin(),)

    def _go_on(self, block: BlockUpload | BlockDownload, frame: bytes) -> tuple[bytes, ...]:
        answers = block.answer(frame)
        if block.done:
            self._block = None
            if isinstance(block, BlockDownload):
                self._od.download(block.index, block.sub, bytes(block.data))
        return answers

    # --- by segments --------------------------------------------------------------------------------------------------

    def _start_download(self, index: int, sub: int, frame: bytes) -> bytes:
        self.reset()
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
        self.reset()
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
