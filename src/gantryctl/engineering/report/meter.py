"""Progress of something that takes its time, with the time that is left."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, TypeAlias

from gantryctl.engineering.report.text import duration
from gantryctl.operation.client import Snapshot

Watch: TypeAlias = Callable[[float], None]
"""Is told which part of a work is done, 0 to 1, as it goes on."""

# What takes less shows no progress.
FIRST_S: Final = 2.0
# Later on, so many lines for what is left.
_LINES: Final = 15.0
# What takes longer than was expected is nearly done, and never done.
_MOST: Final = 0.98


def nobody(part: float) -> None:
    """Watch nothing."""


class Meter:
    """Tells how far a work has got.

    Args:
        say: a line for the person who watches.
        expected: how much work it is, about: seconds of the axis, plants, trials.
        now_s: the clock of the person, who waits less than the axis does in virtual time.

    Attributes:
        done: so much of it is done.
    """

    def __init__(self, say: Callable[[str], None], expected: float, now_s: Callable[[], float]) -> None:
        self._say, self._expected, self._now_s = say, expected, now_s
        self._begun_s = now_s()
        self._next_s = self._begun_s + FIRST_S
        self.done = 0.0

    def advance(self, more: float) -> None:
        """So much more of it is done."""
        self.done += more
        now_s = self._now_s()
        if now_s < self._next_s:
            return
        left_s = self._left_s(now_s)
        self._next_s = now_s + max(FIRST_S, left_s / _LINES)
        self._say(f"  {100.0 * self.part:.0f} %, about {duration(left_s)} left")

    @property
    def part(self) -> float:
        """Part that is done, about, 0 to 1."""
        return min(self.done / self._expected, _MOST) if self.done < self._expected else _MOST

    @property
    def left_s(self) -> float:
        """Time that is left for the person who waits, about, s; NaN before anything is done."""
        return self._left_s(self._now_s()) if self.done > 0.0 else math.nan

    def _left_s(self, now_s: float) -> float:
        return max(1.0, (now_s - self._begun_s) * (1.0 - self.part) / max(self.part, 1e-6))

    def reach(self, done: float) -> None:
        """So much of it is done in all."""
        self.advance(done - self.done)

    def observer(self) -> Callable[[Snapshot], None]:
        """An observer of a run of the axis."""
        before_s = 0.0

        def observe(seen: Snapshot) -> None:
            nonlocal before_s
            self.advance(seen.time_s - before_s)
            before_s = seen.time_s

        return observe
