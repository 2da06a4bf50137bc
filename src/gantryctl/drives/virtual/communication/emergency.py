"""EMCY producer, error register 1001 and error history 1003 (CiA 301)."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable
from typing import Final

from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.objects import ERRORS

_INVALID: Final = 0x8000_0000
_QUEUE: Final = 16
_NO_ERROR: Final = 0x0000

GENERIC: Final = 0x01
# Class of an error code (its highest hex digit) -> bit of the error register 1001 (CiA 301): 1 current, 2 voltage,
# 3 temperature, 4 communication, 7 manufacturer-specific; bit 0 is the generic error.
_REGISTER: Final = {2: 0x02, 3: 0x04, 4: 0x08, 8: 0x10, 9: 0x10, 0xF: 0x80}


def register_bits(code: int) -> int:
    """Bits of 1001 for an error code; the generic bit is always set."""
    return GENERIC | _REGISTER.get(code >> 12, 0)


class Emergency:
    """Present errors, their messages and their history.

    Args:
        od: holds 1001, 1003, 1014, 1015.
        send: takes (identifier, data).
        short: messages of 3 bytes only.
    """

    def __init__(self, od: Dictionary, send: Callable[[int, bytes], None], short: bool) -> None:
        self._od, self._send, self.short = od, send, short
        self._active: list[int] = []
        self._queue: deque[bytes] = deque(maxlen=_QUEUE)
        self._free_us = self._now_us = 0
        od.readers[0x1001, 0] = self.register
        od.checks[0x1003, 0] = self._check_clear
        od.actions[0x1003, 0] = self._clear_history
        od.checks[0x1014, 0] = self._check_cob_id
        self.reset()

    def reset(self) -> None:
        """State after power on: no errors, empty history."""
        self._active.clear()
        self._queue.clear()
        self._clear_history(0)

    def register(self) -> int:
        """Error register 1001."""
        bits = 0
        for code in self._active:
            bits |= register_bits(code)
        return bits

    def report(self, code: int, active: bool) -> None:
        """Begin or end an error."""
        if active:
            self.raise_error(code)
        else:
            self.clear_error(code)

    def raise_error(self, code: int) -> None:
        """Report an error: register, history, message."""
        if code not in self._active:
            self._active.append(code)
        count = min(self._od.number(0x1003) + 1, ERRORS)
        for sub in range(count, 1, -1):
            self._od.set(0x1003, sub, self._od.number(0x1003, sub - 1))
        self._od.set(0x1003, 1, code)
        self._od.set(0x1003, 0, count)
        self.warn(code)

    def clear_error(self, code: int) -> None:
        """End an error; the register in the message tells which errors are left."""
        # Error code 0000 is "error reset or no error" (CiA 301).
        if code in self._active:
            self._active.remove(code)
            self.warn(_NO_ERROR)

    def clear_faults(self) -> None:
        """End every error but those of communication (8xxx), by a fault reset."""
        gone = [code for code in self._active if code >> 12 != 8]
        self._active = [code for code in self._active if code >> 12 == 8]
        if gone:
            self.warn(_NO_ERROR)

    def warn(self, code: int) -> None:
        """Send a message with the present error register; the code itself does not stay."""
        self.raw(code, self.register())

    def tick(self, now_us: int) -> None:
        """Send the messages that the inhibit time 1015 has held back."""
        self._now_us = now_us
        while self._queue and now_us >= self._free_us:
            self._out(self._queue.popleft())

    def raw(self, code: int, register: int) -> None:
        """Send a message with any content, for fault injection."""
        data = struct.pack("<HB5x", code & 0xFFFF, register & 0xFF)[: 3 if self.short else 8]
        if self._queue or self._now_us < self._free_us:
            self._queue.append(data)
        else:
            self._out(data)

    def _out(self, data: bytes) -> None:
        cob_id = self._od.number(0x1014)
        self._free_us = self._now_us + 100 * self._od.number(0x1015)
        if not cob_id & _INVALID:
            self._send(cob_id & 0x7FF, data)

    def _check_clear(self, value: int) -> None:
        if value:
            raise SdoAbort(Abort.VALUE)

    def _clear_history(self, value: int) -> None:
        for sub in range(ERRORS + 1):
            self._od.set(0x1003, sub, 0)

    def _check_cob_id(self, value: int) -> None:
        if value & 0x7FFF_F800 or (not value & _INVALID and not 0x80 < value & 0x7FF < 0x580):
            raise SdoAbort(Abort.VALUE)
