"""Overruns: how many are too many, and the reaction to them."""

from __future__ import annotations

from collections import deque
from enum import Enum
from typing import Final, NamedTuple

from gantryctl.image import StopCause, SystemStop

# Time over which overruns are counted, s.
WINDOW_S: Final = 1.0


class OverrunPolicy(Enum):
    """Meaning of late scans. Missed deadlines are always skipped and counted."""

    CONTINUE = "continue"
    """The plant waits for a late scan, so nothing was missed: the scan numbers go on one by one. For a
    simulation in real time."""
    QUICK_STOP = "quick stop"
    """The axis goes on by itself meanwhile: the scan numbers go on with the time, so set-point, timers and
    recording leave out what was missed. One scan later than the limit, or too many overruns in a second: from
    this scan on the program sees `InputImage.system_stop`, and the drive gets a quick stop where the program would
    move all the same. It lasts until `Engine.system_stop` is cleared. For everything that moves."""


class OverrunLimits(NamedTuple):
    """Limits at which `OverrunPolicy.QUICK_STOP` acts."""

    # A stall below the limit costs next to nothing: with the controller held for 9 and 20 ms over UDP at 250 Hz the
    # following error was 0.006 and 0.012 deg, 0.006 deg without a stall (docs/evidence/can_stall.json).
    late_s: float = 0.030
    """A single scan that starts later than this, s."""
    frozen_s: float = 0.050
    """From here on it is reported as a frozen controller (SYS-03), not as an overrun (SYS-02), s."""
    per_window: int = 5
    """More overruns than this within `WINDOW_S`."""


class RecentOverruns:
    """Overruns of the last second; a reason to stop when there are too many."""

    def __init__(self) -> None:
        self._times_s: deque[float] = deque()

    def add(self, time_s: float) -> None:
        """Count the scan of `time_s`: it ended after the next one was due."""
        self._times_s.append(time_s)

    def reason_to_stop(self, time_s: float, late_s: float, limits: OverrunLimits) -> SystemStop | None:
        """The stop for the scan of `time_s` that starts `late_s` too late, or None."""
        times_s = self._times_s
        while times_s and time_s - times_s[0] > WINDOW_S:
            times_s.popleft()
        if late_s > limits.frozen_s:
            return SystemStop(StopCause.FROZEN, late_s, limits.frozen_s, time_s)
        if late_s > limits.late_s:
            return SystemStop(StopCause.SCAN_LATE, late_s, limits.late_s, time_s)
        if len(times_s) > limits.per_window:
            return SystemStop(StopCause.OVERRUNS, len(times_s), limits.per_window, time_s)
        return None
