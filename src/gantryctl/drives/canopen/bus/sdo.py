"""SDO client (CiA 301): expedited, by blocks, by segments, in the thread of its caller; never inside the cycle."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Final, NoReturn, TypeVar

from gantryctl.drives.canopen.bus import block_transfer
from gantryctl.drives.canopen.bus.link import BusLink, Frame
from gantryctl.drives.od.standard import standard_of
from gantryctl.drives.od.types import Value, decode, encode
from gantryctl.errors import DeviceError

_REQUEST: Final = 0x600
_RESPONSE: Final = 0x580
_ABORT: Final = 0x80
_TRIES: Final = 3
# Some drives keep their EDS in an object (1021).
_LONGEST: Final = 1 << 20
_TIMED_OUT: Final = 0x0504_0000
# From here on blocks take fewer frames than segments, even where the server refuses them first.
_BLOCKS_FROM: Final = 56
# A transmit queue of Linux holds ten frames unless it was made longer: a block has 127.
_QUEUE_S: Final = 0.002
_QUEUE_TRIES: Final = 50

# Abort codes of CiA 301, table "SDO abort codes".
_TEXTS: Final = {
    0x0503_0000: "toggle bit not alternated",
    0x0504_0000: "no answer",
    0x0504_0001: "unknown command",
    0x0504_0002: "wrong block size",
    0x0504_0003: "wrong sequence number in a block",
    0x0504_0004: "wrong checksum (CRC)",
    0x0504_0005: "out of memory",
    0x0601_0000: "access not possible",
    0x0601_0001: "cannot be read",
    0x0601_0002: "cannot be written",
    0x0602_0000: "no such object",
    0x0604_0041: "cannot be mapped into a process data telegram",
    0x0604_0042: "the mapping would be longer than a telegram",
    0x0604_0043: "does not go together with other parameters",
    0x0604_0047: "internal incompatibility in the drive",
    0x0606_0000: "hardware error in the drive",
    0x0607_0010: "wrong length",
    0x0607_0012: "too long",
    0x0607_0013: "too short",
    0x0609_0011: "no such sub-index",
    0x0609_0030: "value out of range",
    0x0609_0031: "value too high",
    0x0609_0032: "value too low",
    0x0609_0036: "highest value below the lowest",
    0x060A_0023: "resource not available",
    0x0800_0000: "general error",
    0x0800_0020: "cannot be stored",
    0x0800_0021: "not possible, local control",
    0x0800_0022: "not possible in the drive's present state",
    0x0800_0023: "no object dictionary",
    0x0800_0024: "no data",
}
# Answers of a server without block transfer; some say nothing at all.
_NO_BLOCKS: Final = frozenset({_TIMED_OUT, 0x0504_0001, 0x0601_0000, 0x0800_0000})
_T = TypeVar("_T")


def abort_text(code: int) -> str:
    """Abort code of CiA 301 in words, with its number."""
    return f"{_TEXTS.get(code, 'refused')} (abort code {code:08X})"


class SdoError(DeviceError):
    """Request that the drive refused or did not answer.

    Attributes:
        code: abort code of CiA 301.
    """

    def __init__(self, index: int, sub: int, code: int) -> None:
        self.index, self.sub, self.code = index, sub, code
        super().__init__(f"object {index:04X}:{sub:02X}: {abort_text(code)}")

    @property
    def silent(self) -> bool:
        """The drive did not answer at all."""
        return self.code == _TIMED_OUT

    @property
    def disturbed(self) -> bool:
        """Frames were lost on the way: the same request may succeed."""
        return self.silent or self.code == block_transfer.BlockAbort.CHECKSUM


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
        self._blocks = True

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
        """Upload an object; a read that was disturbed is tried again."""
        return self._again(lambda: self._read(index, sub))

    def _again(self, transfer: Callable[[], _T]) -> _T:
        left = _TRIES
        while True:
            left -= 1
            try:
                return transfer()
            except SdoError as refused:
                if not (refused.disturbed and left):
                    raise

    def _read(self, index: int, sub: int) -> bytes:
        request = struct.pack("<BHB4x", 0x40, index, sub)
        answer = self._ask(request, index, sub, expect=0x40)
        # Initiate upload (CiA 301): bit 1 expedited, bit 0 size indicated, bits 2 and 3 bytes without data. An
        # expedited answer without a size has four bytes.
        command = answer[0]
        if command & 2:
            size = 4 - (command >> 2 & 3) if command & 1 else 4
            return answer[4 : 4 + size]
        if command & 1 and struct.unpack_from("<I", answer, 4)[0] >= _BLOCKS_FROM and self._blocks:
            # The server keeps the transfer by segments until it is told.
            self._tell_abort(index, sub, _TIMED_OUT)
            self._pass_over()
            exchange = _Exchange(self, index, sub)
            found, done = self._by_blocks(lambda: block_transfer.upload(exchange, _LONGEST))
            if found is not None:
                return found
            if not done:
                self._ask(request, index, sub, expect=0x40)
        return self._read_segments(index, sub)

    def _by_blocks(self, transfer: Callable[[], _T]) -> tuple[_T | None, bool]:
        """Result of a transfer by blocks, and whether the server has taken it."""
        try:
            return transfer(), True
        except SdoError as refused:
            if refused.code not in _NO_BLOCKS:
                raise
        self._blocks = False
        return None, False

    def _read_segments(self, index: int, sub: int) -> bytes:
        # Upload segments: bit 4 toggles, bits 1 to 3 are bytes without data, bit 0 marks the last one.
        data, toggle = bytearray(), 0
        while True:
            answer = self._ask(bytes((0x60 | toggle,)).ljust(8, b"\0"), index, sub)
            if answer[0] & 0xE0 or answer[0] & 0x10 != toggle or len(data) > _LONGEST:
                self.abort(index, sub, 0x0503_0000)
            data += answer[1 : 8 - (answer[0] >> 1 & 7)]
            if answer[0] & 1:
                return bytes(data)
            toggle ^= 0x10

    def write(self, index: int, sub: int, data: bytes) -> None:
        """Download an object; one of several blocks that was disturbed is tried again."""
        # Initiate download, expedited up to four bytes; then blocks, or segments of seven with the bits of the upload.
        head = struct.pack("<HB", index, sub)
        if 0 < len(data) <= 4:
            request = bytes((0x23 | (4 - len(data)) << 2,)) + head + data.ljust(4, b"\0")
            self._ask(request, index, sub, expect=0x60)
            return
        if len(data) >= _BLOCKS_FROM and self._blocks:
            exchange = _Exchange(self, index, sub)
            _, done = self._again(lambda: self._by_blocks(lambda: block_transfer.download(exchange, data)))
            if done:
                return
        self._ask(b"\x21" + head + struct.pack("<I", len(data)), index, sub, expect=0x60)
        toggle = 0
        for at in range(0, len(data), 7):
            part = data[at : at + 7]
            last = at + 7 >= len(data)
            self._ask(bytes((toggle | (7 - len(part)) << 1 | last,)) + part.ljust(7, b"\0"), index, sub)
            toggle ^= 0x10

    # --- frames ------------------------------------------------------------------------------------------------------

    def _ask(self, request: bytes, index: int, sub: int, expect: int | None = None) -> bytes:
        """Send a request and wait for its answer.

        Args:
            expect: command of an answer that names its object; None for segments, which do not.
        """
        # An answer to an earlier request that had timed out names another object, or another command: it is passed
        # over.
        head = struct.pack("<HB", index, sub)
        self.send(request)
        answer = self.receive(
            index, sub, lambda f: expect is None or (f[0] & 0xE0 == expect and f[1:4] == head)
        )
        if answer is None:
            raise SdoError(index, sub, _TIMED_OUT)
        return answer

    def send(self, request: bytes) -> None:
        """Send a frame; where the transmit queue is full, as soon as it has room."""
        for _ in range(_QUEUE_TRIES):
            if self._link.send(self.request_id, request):
                return
            self._link.pause(_QUEUE_S)

    def receive(self, index: int, sub: int, accept: Callable[[bytes], bool]) -> bytes | None:
        """Wait for a frame of the server that is accepted; None when the time is over.

        Raises:
            SdoError: the server ended the transfer of this object.
        """
        head = struct.pack("<HB", index, sub)
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
            elif accept(frame.data):
                return frame.data
        return None

    def _pass_over(self) -> None:
        """Pass over what the server has sent up to now: a copy of an answer must not answer the next request."""
        while (frame := self._link.receive(0.0)) is not None:
            if frame.can_id != self.response_id:
                self._other(frame)

    def abort(self, index: int, sub: int, code: int) -> NoReturn:
        """End a transfer.

        Raises:
            SdoError: always.
        """
        self._tell_abort(index, sub, code)
        raise SdoError(index, sub, code)

    def _tell_abort(self, index: int, sub: int, code: int) -> None:
        self.send(struct.pack("<BHBI", _ABORT, index, sub, code))


class _Exchange:
    """Frames of a block transfer of one object."""

    def __init__(self, client: SdoClient, index: int, sub: int) -> None:
        self._client, self._index, self._sub = client, index, sub
        self.head = struct.pack("<HB", index, sub)

    def send(self, request: bytes) -> None:
        """Send a frame."""
        self._client.send(request)

    def receive(self, accept: Callable[[bytes], bool]) -> bytes | None:
        """Wait for a frame that is accepted; None without one."""
        return self._client.receive(self._index, self._sub, accept)

    def abort(self, code: int) -> NoReturn:
        """End the transfer."""
        self._client.abort(self._index, self._sub, code)
