"""Real time as far as the system grants it: SCHED_FIFO, locked memory, no garbage collection, death with the parent."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import sys
from typing import Final

PRIORITY: Final = 80
_MCL_CURRENT_AND_FUTURE: Final = 3
_PR_SET_PDEATHSIG: Final = 1


def prepare_scan_process() -> bool:
    """For the process of the scan; True when both scheduling and memory were granted.

    Everything allocated so far is taken out of garbage collection, and collection is off: a scan makes no cycles.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    return _fifo() and _lock_memory()


def die_with_parent(number: signal.Signals = signal.SIGTERM) -> None:
    """Get this signal when the parent process ends, however it ends."""
    if sys.platform == "linux":
        parent = os.getppid()
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(number), 0, 0, 0)
        if os.getppid() != parent:  # it ended before the request
            os.kill(os.getpid(), number)


def _fifo() -> bool:
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (OSError, AttributeError):
        return False
    return True


def _lock_memory() -> bool:
    try:
        return bool(ctypes.CDLL(None).mlockall(_MCL_CURRENT_AND_FUTURE) == 0)
    except (OSError, AttributeError):
        return False
