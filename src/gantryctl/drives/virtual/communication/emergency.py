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
# Class of an error code (its highest hex digit) -> bit of the error register.
_REGISTER: Final = {2: 0x02, 3: 0x04, 4: 0x08, 8: 0x10, 9: 0x10, 0xF: 0x80}


def register_bits(code: int) -> int:
    """Bits of 1001 that go with an error code; generic is always among them."""
    return GENERIC | _REGISTER.get(code >> 12, 0)


class Emergency:
    """Errors that are there, the messages about them, and the history.

    Args:
        od: holds 1001, 1003, 1014, 1015.
        send: takes (identifier, data).
        short: messages of 3 bytes only.
    """

    def __init__(self, od: Dictionary, send: Callable[[int, bytes], None], short: bool) -> None:
        self._od, self._send, self.short = od, send, short
        self._active: list[int] = []
        self._queue: deque[bytes] = deque(maxlen=_QUEUE)
        self._free_us = 0
        self._now_us = 0
        od.readers[0x1001, 0] = self.register
        od.checks[0x1003, 0] = self._check_clear
        od.actions[0x1003, 0] = self._clear_history
        od.checks[0x1014, 0] = self._check_cob_id
        self.reset()

    def reset(self) -> None:
        """As after power on: no errors, empty history."""
        self._active.clear()
        self._queue.clear()
        self._clear_history(0)

    def register(self) -> int:
        """1001."""
        bits = 0
        for code in self._active:
            bits |= register_bits(code)
        return bits

    def raise_error(self, code: int, vendor: bytes = b"") -> None:
        """An error has come: message, register, history."""
        if code not in self._active:
            self._active.append(code)
        count = min(self._od.number(0x1003) + 1, ERRORS)
        for sub in range(count, 1, -1):
            self._od.set(0x1003, sub, self._od.number(0x1003, sub - 1))
        self._od.set(0x1003, 1, code)
        self._od.set(0x1003, 0, count)
        self._message(code, vendor)

    def clear_error(self, code: int) -> None:
        """An error has gone; the last one that goes says so with code 0000, another tells what is left."""
        if code in self._active:
            self._active.remove(code)
            self._message(_NO_ERROR, b"")

    def clear_faults(self) -> None:
        """Fault reset: every error but those of communication is gone."""
        gone = [code for code in self._active if code >> 12 != 8]
        self._active = [code for code in self._active if code >> 12 == 8]
        if gone:
            self._message(_NO_ERROR, b"")

    def warn(self, code: int) -> None:
        """A message without an error that stays (warnings)."""
        self._message(code, b"")

    def tick(self, now_us: int) -> None:
        """Send what the inhibit time held back."""
        self._now_us = now_us
        while self._queue and now_us >= self._free_us:
            self._out(self._queue.popleft())

    def raw(self, code: int, register: int, vendor: bytes) -> None:
        """A message with any content; for fault injection."""
        self._put(struct.pack("<HB", code & 0xFFFF, register & 0xFF) + vendor[:5].ljust(5, b"\0"))

    def _message(self, code: int, vendor: bytes) -> None:
        self.raw(code, self.register(), vendor)

    def _put(self, data: bytes) -> None:
        data = data[:3] if self.short else data
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
