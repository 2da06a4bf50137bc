"""Clocks: virtual time for simulation and tests, absolute deadlines for real time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final

from gantryctl.errors import UsageError
from gantryctl.ports import ScanStart

# A scan later than this part of its period, and than this time, is left out. A reading that is late by t looks like a
# following error of speed x t, a scan that is missing costs acceleration x t^2 / 2: for 9 ms at 6 deg/s and 2 deg/s2
# 0.054 against 0.0001 deg (decision 0005).
_LATE_PERIODS: Final = 0.25
_LATE_LEAST_S: Final = 0.001


class VirtualClock:
    """Virtual time: no waiting, no lateness; the engine leaves it out."""

    def start(self) -> None:
        """Do nothing."""

    def wait_for(self, deadline: int) -> ScanStart:
        """Return at once, on time."""
        return ScanStart(deadline, 0.0)

    def elapsed_s(self) -> float:
        """Return 0: no time passes inside a scan."""
        return 0.0


class RealClock:
    """Absolute deadlines: number k at `base + k x period` of the monotonic clock; a late scan does not shift the next.

    A deadline that was missed by more than a quarter of a period (and 1 ms) is skipped, and so are all others until
    the next that can be met: never a burst, and every scan is near its own time.

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
        """Count time from the next scan on: the first one, or one after an intended pause."""
        self._base_s = None

    def wait_for(self, deadline: int) -> ScanStart:
        """Sleep until `deadline`, or until a later one where it was missed."""
        if self._base_s is None:
            self._scan_start_s = self._now()
            self._base_s = self._scan_start_s - deadline * self.period_s
            return ScanStart(deadline, 0.0)
        late_s = self._sleep_until(deadline)
        if late_s > max(_LATE_PERIODS * self.period_s, _LATE_LEAST_S):
            deadline += math.ceil(late_s / self.period_s)
            late_again_s = self._sleep_until(deadline)
            # Without another wait: a computer that is always late would never come to a scan.
            deadline += int(late_again_s / self.period_s)
        return ScanStart(deadline, late_s)

    def _sleep_until(self, deadline: int) -> float:
        """Sleep, and give the lateness after it, s."""
        assert self._base_s is not None
        at_s = self._base_s + deadline * self.period_s
        now_s = self._now()
        while now_s < at_s:
            self._sleep(at_s - now_s)
            now_s = self._now()
        self._scan_start_s = now_s
        return now_s - at_s

    def elapsed_s(self) -> float:
        """Time since the present scan really started, s."""
        return self._now() - self._scan_start_s
