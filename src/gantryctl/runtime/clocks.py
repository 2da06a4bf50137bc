"""Clocks: virtual time for simulation and tests, absolute deadlines for real time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from gantryctl.errors import UsageError


class VirtualClock:
    """Never waits and is never late; the engine does not even ask."""

    def start(self) -> None:
        """Nothing to start."""

    def wait_for(self, scan: int) -> float:
        """Returns at once, on time."""
        return 0.0

    def elapsed_s(self) -> float:
        """No time passes inside a scan."""
        return 0.0


class RealClock:
    """Scan k starts at `base + k x period` of the monotonic clock: a late scan does not shift the next.

    When a whole period or more was missed, the missed deadlines are skipped, never caught up in a burst:
    the base moves on by whole periods.

    Args:
        period_s: scan period, s.
        now: the monotonic time, s.
        sleep: sleeps for a time in s. Python's own sleeps to an absolute deadline of the monotonic clock.
    """

    def __init__(
        self,
        period_s: float,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] = time.sleep,
    ) -> None:
        if not (math.isfinite(period_s) and period_s > 0.0):
            raise UsageError(f"scan period must be above 0 s, got {period_s} s")
        self.period_s = period_s
        self._now, self._sleep = now, sleep
        self._base_s: float | None = None
        self._scan_start_s = 0.0

    def start(self) -> None:
        """Call the next scan on time whenever it comes: the first one, or one after an intended pause."""
        self._base_s = None

    def wait_for(self, scan: int) -> float:
        """Sleep until `scan` is due; how late it starts, s, measured before missed deadlines are skipped."""
        now_s = self._now()
        if self._base_s is None:
            self._base_s = now_s - scan * self.period_s
            self._scan_start_s = now_s
            return 0.0
        deadline_s = self._base_s + scan * self.period_s
        while now_s < deadline_s:
            self._sleep(deadline_s - now_s)
            now_s = self._now()
        self._scan_start_s = now_s
        late_s = now_s - deadline_s
        if late_s >= self.period_s:
            self._base_s += int(late_s / self.period_s) * self.period_s
        return late_s

    def elapsed_s(self) -> float:
        """Since the present scan really started, s."""
        return self._now() - self._scan_start_s
