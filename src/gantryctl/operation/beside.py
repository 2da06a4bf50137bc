"""Work beside the scan that takes its time: a person who types, an instrument that averages."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from threading import Thread
from typing import TypeVar

_Done = TypeVar("_Done")


def begin(work: Callable[[], _Done]) -> Future[_Done]:
    """Begin work in a thread that nobody waits for at the end of the process."""
    # Not a pool: it would wait for a person who has left.
    done: Future[_Done] = Future()
    Thread(target=_complete, args=(done, work), name="beside the scan", daemon=True).start()
    return done


def _complete(done: Future[_Done], work: Callable[[], _Done]) -> None:
    try:
        done.set_result(work())
    # Raised again where the result is taken.
    except BaseException as fault:
        done.set_exception(fault)
