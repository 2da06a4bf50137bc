"""A calendar of its own for everything that writes or judges dates: brake tests, events, journal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime, tzinfo
from importlib import import_module
from typing import Any, Final
from unittest.mock import patch

# Every module of a running controller that reads the calendar; the scan reads none (tests/unit/test_wall_clock.py).
DATED: Final = (
    "gantryctl.operation.brake_policy",
    "gantryctl.operation.run_memory",
    "gantryctl.operation.store",
    "gantryctl.service.controller.brake_watch",
    "gantryctl.service.memory.events",
    "gantryctl.service.recorder.journal.file",
)


@contextmanager
def dated(now: Callable[[], datetime]) -> Iterator[None]:
    """Let these modules read `now` where they read the wall clock.

    Args:
        now: date and time, UTC.
    """

    class Dated(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> Any:
            return now()

    with ExitStack() as changed:
        for name in DATED:
            module = import_module(name)
            if hasattr(module, "datetime"):
                changed.enter_context(patch.object(module, "datetime", Dated))
        yield
