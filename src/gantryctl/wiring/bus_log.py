"""The log in force: every link that this process opens meanwhile tells it its frames."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Protocol

from gantryctl.trace.frames.ring import FrameLog


class LinkLog(Protocol):
    """What keeps the frames of a bus."""

    def link(self, channel: str, *, virtual: bool) -> FrameLog:
        """Make the log of one link; `virtual`: its clock begins at 0."""
        ...

    def alarm(self, code: str, path: Path, ago_s: float = 0.0) -> None:
        """Freeze the frames around an alarm that was raised some time ago."""
        ...


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
