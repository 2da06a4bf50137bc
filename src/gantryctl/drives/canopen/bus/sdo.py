"""SDO client (CiA 301): expedited and segmented, in the thread of its caller; never used inside the cycle."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Final

from gantryctl.drives.canopen.bus.link import BusLink, Frame
from gantryctl.drives.od.standard import standard_of
from gantryctl.drives.od.types import Value, decode, encode
from gantryctl.errors import DeviceError

_REQUEST: Final = 0x600
_RESPONSE: Final = 0x580
_ABORT: Final = 0x80
_TRIES: Final = 3
_LONGEST: Final = 4096
_TIMED_OUT: Final = 0x0504_0000

# Abort codes of CiA 301, table "SDO abort codes".
_TEXTS: Final = {
    0x0503_0000: "toggle bit not alternated",
    0x0504_0000: "no answer",
    0x0504_0001: "unknown command",
    0x0601_0000: "access not possible",
    0x0601_0001: "cannot be read",
    0x0601_0002: "cannot be written",
    0x0602_0000: "no such object",
    0x0604_0041: "cannot be mapped into a process data telegram",
    0x0604_0042: "the mapping would be longer than a telegram",
    0x0604_0043: "does not go together with other parameters",
    0x0606_0000: "hardware error in the drive",
    0x0607_0010: "wrong length",
    0x0609_0011: "no such sub-index",
    0x0609_0030: "value out of range",
    0x0609_0031: "value too high",
    0x0609_0032: "value too low",
    0x0800_0000: "general error",
    0x0800_0020: "cannot be stored",
    0x0800_0021: "not possible, local control",
    0x0800_0022: "not possible in the drive's present state",
}


class SdoError(DeviceError):
    """Request that the drive refused or did not answer.

    Attributes:
        code: abort code of CiA 301.
    """

    def __init__(self, index: int, sub: int, code: int) -> None:
        self.index, self.sub, self.code = index, sub, code
        text = _TEXTS.get(code, "refused")
        super().__init__(f"object {index:04X}:{sub:02X}: {text} (abort code {code:08X})")

    @property
    def silent(self) -> bool:
        """The drive did not answer at all."""
        return self.code == _TIMED_OUT


def decode_object(index: int, sub: int, data: bytes) -> Value:
    """Value of an object by the type that CiA 301 and CiA 402 give it; of any other, a whole number.

    Raises:
        ValueError: the type has another length.
    """
    known = standard_of(index, sub)
    return int.from_bytes(data, "little") if known is None else decode(known.data_type, data)


class SdoClient:
    """Read and write objects of one node.

    Args:
        link: the bus.
        node: its node id.
        other: takes every frame that does not answer the request under way.
        timeout_s: for one answer; a read is tried three times.
    """

    def __init__(self, link: BusLink, node: int, other: Callable[[Frame], None], timeout_s: float) -> None:
        # One client for a drive: with two threads on one client, 82 % of the reads of a library failed. While it
        # waits, heartbeats and emergency messages still have to be taken: `other` does.
        self._link, self._other = link, other
        self.request_id, self.response_id = _REQUEST + node, _RESPONSE + node
        self.timeout_s = timeout_s

    # --- values ------------------------------------------------------------------------------------------------

    def value(self, index: int, sub: int = 0) -> Value:
        """Read an object by its standard type.

        Raises:
            SdoError: refused, or no answer. DeviceError: an answer of another length than the type has.
        """
        try:
            return decode_object(index, sub, self.read(index, sub))
        except ValueError as wrong:
            raise DeviceError(f"object {index:04X}:{sub:02X}: {wrong}") from None

    def number(self, index: int, sub: int = 0) -> int:
        """Read a whole number."""
        found = self.value(index, sub)
        if not isinstance(found, int):
            raise DeviceError(f"object {index:04X}:{sub:02X}: a whole number was expected, got {found!r}")
        return found

    def optional(self, index: int, sub: int = 0) -> int | None:
        """Read a whole number; None where the drive has no such object. Silence is still an error."""
        try:
            return self.number(index, sub)
        except SdoError as refused:
            if refused.silent:
                raise
            return None

    def text(self, index: int) -> str:
        """Read a string object, or ""."""
        try:
            return self.read(index, 0).split(b"\0", 1)[0].decode("latin-1").strip()
        except SdoError as refused:
            if refused.silent:
                raise
            return ""

    def set(self, index: int, sub: int, value: int, size: int | None = None) -> None:
        """Write a whole number by its standard type, or of `size` bytes.

        Raises:
            SdoError: refused, or no answer. DeviceError: a value that the type cannot hold.
        """
        known = standard_of(index, sub)
        try:
            if known is not None:
                data = encode(known.data_type, value)
            else:
                data = (value & (1 << 8 * (size or 4)) - 1).to_bytes(size or 4, "little")
        except ValueError as wrong:
            raise DeviceError(f"object {index:04X}:{sub:02X}: {wrong}") from None
        self.write(index, sub, data)

    # --- transfers ---------------------------------------------------------------------------------------------

    def read(self, index: int, sub: int) -> bytes:
        """Upload an object; a read without an answer is tried again."""
        for left in reversed(range(_TRIES)):
            try:
                return self._read(index, sub)
            except SdoError as refused:
                if not (refused.silent and left):
                    raise
        raise AssertionError

    def _read(self, index: int, sub: int) -> bytes:
        answer = self._ask(struct.pack("<BHB4x", 0x40, index, sub), index, sub, expect=0x40)
        # Initiate upload (CiA 301): bit 1 expedited, bit 0 size indicated, bits 2 and 3 bytes without data. An
        # expedited answer without a size has four bytes.
        command = answer[0]
        if command & 2:
            size = 4 - (command >> 2 & 3) if command & 1 else 4
            return answer[4 : 4 + size]
        # Upload segments: bit 4 toggles, bits 1 to 3 are bytes without data, bit 0 marks the last one.
        data, toggle = b"", 0
        while True:
            answer = self._ask(bytes((0x60 | toggle,)).ljust(8, b"\0"), index, sub)
            if answer[0] & 0xE0 or answer[0] & 0x10 != toggle or len(data) > _LONGEST:
                self._abort(index, sub, 0x0503_0000)
            data += answer[1 : 8 - (answer[0] >> 1 & 7)]
            if answer[0] & 1:
                return data
            toggle ^= 0x10

    def write(self, index: int, sub: int, data: bytes) -> None:
        """Download an object."""
        # Initiate download, expedited up to four bytes; then segments of seven with the bits of the upload.
        head = struct.pack("<HB", index, sub)
        if 0 < len(data) <= 4:
            request = bytes((0x23 | (4 - len(data)) << 2,)) + head + data.ljust(4, b"\0")
            self._ask(request, index, sub, expect=0x60)
            return
        self._ask(b"\x21" + head + struct.pack("<I", len(data)), index, sub, expect=0x60)
        toggle = 0
        for at in range(0, len(data), 7):
            part = data[at : at + 7]
            last = at + 7 >= len(data)
            self._ask(bytes((toggle | (7 - len(part)) << 1 | last,)) + part.ljust(7, b"\0"), index, sub)
            toggle ^= 0x10

    def _ask(self, request: bytes, index: int, sub: int, expect: int | None = None) -> bytes:
        """Send a request and wait for its answer.

        Args:
            expect: command of an answer that names its object; None for segments, which do not.
        """
        # An answer to an earlier request that had timed out names another object, or another command: it is passed
        # over.
        head = struct.pack("<HB", index, sub)
        self._link.send(self.request_id, request)
        end = self._link.now_s() + self.timeout_s
        while (left := end - self._link.now_s()) > 0.0:
            frame = self._link.receive(left)
            if frame is None:
                break
            if frame.can_id != self.response_id or len(frame.data) < 8:
                self._other(frame)
            elif frame.data[0] == _ABORT:
                if frame.data[1:4] == head:
                    raise SdoError(index, sub, struct.unpack_from("<I", frame.data, 4)[0])
            elif expect is None or (frame.data[0] & 0xE0 == expect and frame.data[1:4] == head):
                return frame.data
        raise SdoError(index, sub, _TIMED_OUT)

    def _abort(self, index: int, sub: int, code: int) -> None:
        self._link.send(self.request_id, struct.pack("<BHBI", _ABORT, index, sub, code))
        raise SdoError(index, sub, code)
