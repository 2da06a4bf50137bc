"""A process that did not run for a time reports that itself: stopped, starved, or with a disk that hangs."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

# Shorter ones do no harm that is not told anyway: a key is let go after 250 ms, a late scan has alarms of its own.
HELD_UP_S: Final = 1.0


class HeldUp:
    """Watches the loop of one process.

    Args:
        process: its name. tell: takes the line for the journal. now: the monotonic time, s.
    """

    def __init__(
        self, process: str, tell: Callable[[str], object], now: Callable[[], float] = time.monotonic
    ) -> None:
        self._process, self._tell, self._now = process, tell, now
        self._last_s = now()

    def look(self) -> None:
        """Once in each turn of the loop."""
        now_s = self._now()
        gap_s, self._last_s = now_s - self._last_s, now_s
        if gap_s > HELD_UP_S:
            self._tell(f"{self._process} was held up for {gap_s:.1f} s")
