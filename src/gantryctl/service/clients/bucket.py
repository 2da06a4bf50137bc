"""How many messages a second: a bucket that fills up by itself."""

from __future__ import annotations

import time
from collections.abc import Callable


class Bucket:
    """So many a second, and as many at once after a pause.

    Args:
        per_s: its size, and how much comes back in a second.
    """

    def __init__(self, per_s: float, now: Callable[[], float] = time.monotonic) -> None:
        self.per_s, self._now = per_s, now
        self._left, self._filled_s = per_s, now()

    def take(self) -> bool:
        """One more; False when it is empty."""
        now_s = self._now()
        self._left = min(self.per_s, self._left + (now_s - self._filled_s) * self.per_s)
        self._filled_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
