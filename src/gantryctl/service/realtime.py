"""Real time as far as the system grants it: SCHED_FIFO, locked memory, no garbage collection, end with the parent."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import sys
from typing import Final

from gantryctl.runtime.priority import ask_for_priority

PRIORITY: Final = 80
_MCL_CURRENT_AND_FUTURE: Final = 3
_PR_SET_PDEATHSIG: Final = 1


def prepare_scan_process() -> bool:
    """Prepare the process of the scan; True if both scheduling and memory were granted."""
    # A scan makes no cycles, so collection is off; everything allocated so far is taken out of it. With this the scan
    # is late by 33 us (median) on two processors (docs/evidence/service_lateness.json).
    gc.collect()
    gc.freeze()
    gc.disable()
    return ask_for_priority(PRIORITY) and _lock_memory()


def die_with_parent(parent: int) -> None:
    """Ask the system for SIGTERM at the end of the parent process, however it ends.

    Args:
        parent: its process number, which it has told: one that was killed while it started this process is gone before
            the first line here. Of the kills of everything some left a controller that ran on alone.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGTERM), 0, 0, 0)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGTERM)


def _lock_memory() -> bool:
    try:
        return bool(ctypes.CDLL(None).mlockall(_MCL_CURRENT_AND_FUTURE) == 0)
    except (OSError, AttributeError):
        return False
