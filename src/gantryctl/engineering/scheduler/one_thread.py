"""Linear algebra on one thread: with several its sums have another order and other last bits."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final


class _OneThread:
    """The limit of this process, and how many hold it: several chunks may be computed side by side."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._holders = 0
        self._before: Any = None

    def take(self) -> None:
        from threadpoolctl import threadpool_limits

        with self._lock:
            if self._holders == 0:
                self._before = threadpool_limits(1, "blas")
            self._holders += 1

    def leave(self) -> None:
        with self._lock:
            self._holders -= 1
            if self._holders == 0:
                self._before.restore_original_limits()


_ONE_THREAD: Final = _OneThread()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """One thread for the linear algebra of this process, until the last of those that ask for it is done."""
    # Tried: `numpy.linalg.lstsq` of 20,000 x 33 differs in its last bits between one thread and two (OpenBLAS), and
    # takes 8 times less of the processor with one.
    _ONE_THREAD.take()
    try:
        yield
    finally:
        _ONE_THREAD.leave()
