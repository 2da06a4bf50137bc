"""SDO requests of the running axis: sent behind the process data, one at a time; no scan waits for an answer."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Final

from gantryctl.drives.canopen.bus.node import RemoteNode

_ABORT: Final = 0x80
_UPLOAD: Final = 0x40
_DOWNLOAD: Final = 0x20
_DOWNLOADED: Final = 0x60
_EXPEDITED: Final = 0x02
_SIZED: Final = 0x01

Answer = Callable[[bytes | None], None]
"""Takes the data of a read, b"" for a write that was done, None for a refusal."""


class SdoRequests:
    """Expedited transfers with one node (CiA 301); the answer comes with the frames of a later scan.

    A new request takes the place of one that was not answered: a drive that stays silent has alarms of its own.

    Args:
        node: sends and takes the frames.

    Attributes:
        answered, unanswered: requests so far.
        abort_code: of the last answer; 0 where it was no refusal.
    """

    # One client for a drive, in the thread of the scan: a thread of its own would need the bus for itself, and waiting
    # would cost the scan (decision 0012).

    def __init__(self, node: RemoteNode) -> None:
        self._node = node
        self._head = b""
        self._command = 0
        self._then: Answer | None = None
        self.answered = self.unanswered = self.abort_code = 0
        node.listen(node.sdo.response_id, self._answer)

    @property
    def waiting(self) -> bool:
        """A request is under way."""
        return self._then is not None

    def wait(self, seconds: float) -> None:
        """Dispatch frames until the answer to the request under way has come, for a time at most."""
        link = self._node.link
        end = link.now_s() + seconds
        while self.waiting and (left := end - link.now_s()) > 0.0:
            frame = link.receive(left)
            if frame is not None:
                self._node.dispatch(frame)

    def read(self, index: int, sub: int, then: Answer) -> None:
        """Ask for an object of up to four bytes."""
        self._send(_UPLOAD, index, sub, b"", then)

    def write(self, index: int, sub: int, data: bytes, then: Answer) -> None:
        """Write one to four bytes."""
        self._send(_DOWNLOAD | (4 - len(data)) << 2 | _EXPEDITED | _SIZED, index, sub, data, then)

    def _send(self, command: int, index: int, sub: int, data: bytes, then: Answer) -> None:
        self.unanswered += self._then is not None
        self._head, self._then = struct.pack("<HB", index, sub), then
        self._command = _UPLOAD if command == _UPLOAD else _DOWNLOADED
        request = bytes((command,)) + self._head + data.ljust(4, b"\0")
        self._node.link.send(self._node.sdo.request_id, request)

    def _answer(self, data: bytes) -> None:
        """Take a frame of the drive's SDO server, whatever it is."""
        then = self._then
        if then is None or len(data) < 8 or data[1:4] != self._head:
            return
        command = data[0]
        found: bytes | None = None
        if command != _ABORT:
            if command & 0xE0 != self._command:
                return
            found = b""
            if self._command == _UPLOAD:
                if not command & _EXPEDITED:
                    return
                found = data[4 : 8 - (command >> 2 & 3 if command & _SIZED else 0)]
        self._then = None
        self.abort_code = 0 if found is not None else struct.unpack_from("<I", data, 4)[0]
        self.answered += 1
        then(found)
