"""Timing of a process: garbage collection off, real-time priority where the system allows it."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

# Above ordinary processes, below the kernel's own threads.
PRIORITY: Final = 20


@contextmanager
def keeps_time() -> Iterator[bool]:
    """Keep time while scans are paced by the clock; yield whether the system gave a real-time priority.

    What was made so far is taken out of the garbage collector's sight. Without the right to a real-time priority the
    process goes on as an ordinary one.
    """
    was_enabled = gc.isenabled()
    known = hasattr(os, "sched_getscheduler")
    before = (os.sched_getscheduler(0), os.sched_getparam(0)) if known else None
    # A collection in the middle of a scan delays it, and takes the longer the more objects there are.
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield ask_for_priority(PRIORITY)
    finally:
        if before is not None:
            with suppress(OSError):
                os.sched_setscheduler(0, *before)
        gc.unfreeze()
        if was_enabled:
            gc.enable()


def ask_for_priority(priority: int) -> bool:
    """Ask the system for SCHED_FIFO; False where it has none or does not grant it."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, AttributeError):
        return False
    return True
