"""Ctrl-C between scans, never inside one."""

from __future__ import annotations

import signal
import threading
from types import FrameType


class DeferredInterrupt:
    """While active, the first Ctrl-C only sets `pending`; leaving raises the KeyboardInterrupt.

    So a scan is always finished: read, program, write and trace row belong together. A second Ctrl-C is
    raised at once (a program that hangs). Acts only where Python's own handler is in force, in the main
    thread: a handler that the caller installed keeps its meaning.
    """

    def __init__(self) -> None:
        self.pending = False
        self._active = False

    def __enter__(self) -> DeferredInterrupt:
        self.pending = False
        self._active = (
            signal.getsignal(signal.SIGINT) is signal.default_int_handler
            and threading.current_thread() is threading.main_thread()
        )
        if self._active:
            # Python's default raises KeyboardInterrupt between any two instructions: a scan would be cut in its middle,
            # with a command computed and not sent.
            signal.signal(signal.SIGINT, self._defer)
        return self

    def _defer(self, number: int, frame: FrameType | None) -> None:
        if self.pending:
            signal.default_int_handler(number, frame)
        self.pending = True

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if self._active:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        pending, self.pending = self.pending, False
        if pending and error is None:
            raise KeyboardInterrupt
