"""The log in force: every link that this process opens meanwhile tells it its frames."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from gantryctl.trace.frames.ring import FrameLog, LinkLog

# One process, one bus, one log; the links come and go. A commissioning opens one for each step, deep inside of it: a
# parameter would pass through every function that opens a drive.
_IN_FORCE: ContextVar[LinkLog | None] = ContextVar("bus log", default=None)


@contextmanager
def logged_links(log: LinkLog) -> Iterator[None]:
    """Put a log in force."""
    before = _IN_FORCE.set(log)
    try:
        yield
    finally:
        _IN_FORCE.reset(before)


def log_in_force() -> LinkLog | None:
    """The log of the links that are open, or None."""
    return _IN_FORCE.get()


def link_log(channel: str, *, virtual: bool) -> FrameLog | None:
    """Log of a link that is being opened; None where none is in force."""
    log = _IN_FORCE.get()
    return None if log is None else log.link(channel, virtual=virtual)
