"""Timing of the scans, and what lateness means in degrees."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import Final

# 10^(1/50) = 1.047: a quantile is rounded up by less than 5 %, from 1 us to 10 s. With bins that are fixed a scan
# costs one bisection, however long the engine runs.
_PER_DECADE: Final = 50
# 10^(15/50) = 2.00, 10^(35/50) = 5.01.
_STEPS: Final = (0, 15, 35)
_EDGES_S: Final[list[float]] = [1e-6 * 10.0 ** (i / _PER_DECADE) for i in range(7 * _PER_DECADE + 1)]


class Histogram:
    """Times in logarithmic bins of 5 %, fixed at construction; adding one costs a bisection.

    Attributes:
        counts: one per bin; bin i ends at edge i, the last one has no end.
        count, worst_s, worst_scan: of all values added.
    """

    def __init__(self) -> None:
        self.counts = [0] * (len(_EDGES_S) + 1)
        self.count = 0
        self.worst_s = 0.0
        self.worst_scan = -1

    def add(self, scan: int, value_s: float) -> None:
        """Count one time."""
        self.counts[bisect_left(_EDGES_S, value_s)] += 1
        self.count += 1
        if value_s > self.worst_s:
            self.worst_s, self.worst_scan = value_s, scan

    def quantile_s(self, part: float) -> float:
        """Time that `part` of the values do not exceed, rounded up to the edge of its bin; 0 without a value."""
        rank = part * self.count
        seen = 0
        for edge_s, count in zip([*_EDGES_S, math.inf], self.counts, strict=True):
            seen += count
            if count and seen >= rank:
                return min(edge_s, self.worst_s)
        return 0.0

    def steps(self) -> list[tuple[float, int]]:
        """Upper edge in s and count of coarser bins, three a decade (1, 2, 5, to 1 %), from the first to the last
        that is not empty; the last of all ends at infinity.
        """
        found, seen = [], 0
        for number, count in enumerate(self.counts):
            seen += count
            last = number == len(_EDGES_S)
            if last or number % _PER_DECADE in _STEPS:
                found.append((math.inf if last else _EDGES_S[number], seen))
                seen = 0
        filled = [number for number, (_, count) in enumerate(found) if count]
        return found[filled[0] : filled[-1] + 1] if filled else []

    def since(self, counts: Sequence[int]) -> Histogram:
        """Values added after its `counts` were these; the worst is that of all."""
        found = Histogram()
        found.counts = [now - before for now, before in zip(self.counts, counts, strict=True)]
        found.count = sum(found.counts)
        found.worst_s, found.worst_scan = self.worst_s, self.worst_scan
        return found

    def to_dict(self) -> dict[str, object]:
        """Figures and the bins that are not empty, as [upper edge in s or null, count]."""
        edges = [*_EDGES_S, None]
        return {
            "count": self.count,
            "p50_s": self.quantile_s(0.5),
            "p99_s": self.quantile_s(0.99),
            "p99_9_s": self.quantile_s(0.999),
            "worst_s": self.worst_s,
            "worst_scan": self.worst_scan,
            "bins": [[edge, count] for edge, count in zip(edges, self.counts, strict=True) if count],
        }


class ScanStatistics:
    """Lateness, period and run time of the scans in real time, and the overruns among them.

    An overrun is a scan that ended after the next one was due: lateness + run time > period.
    """

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self.lateness = Histogram()
        self.run_time = Histogram()
        self.period = Histogram()
        self.overruns = 0
        self.skipped = 0
        """Deadlines that passed without a scan."""
        self._last_offset_s: float | None = None

    @property
    def _times(self) -> dict[str, Histogram]:
        return {"lateness": self.lateness, "run_time": self.run_time, "period": self.period}

    def add(self, scan: int, lateness_s: float, run_time_s: float, skipped: int = 0) -> bool:
        """Count one scan, which began `skipped` deadlines later than it should; True when it was an overrun."""
        period_s = self.period_s
        self.lateness.add(scan, lateness_s)
        self.run_time.add(scan, run_time_s)
        # After a skipped deadline the clock has waited for the next one: the scan began on time.
        offset_s = 0.0 if skipped else lateness_s
        if self._last_offset_s is not None:
            self.period.add(scan, (skipped + 1) * period_s + offset_s - self._last_offset_s)
        self.skipped += skipped
        self._last_offset_s = offset_s
        overrun = lateness_s + run_time_s > period_s
        self.overruns += overrun
        return overrun

    def report(self, speed_deg_s: float) -> str:
        """Figures in words; at `speed_deg_s` of the gantry a late scan acts that much angle too late."""
        if not self.lateness.count:
            return "virtual time: no scan is ever late"
        lines = [f"{self.lateness.count} scans of {self.period_s * 1e3:g} ms in real time"]
        for name, times in self._times.items():
            p50, p99, p99_9 = (f"{times.quantile_s(part) * 1e3:.3f}" for part in (0.5, 0.99, 0.999))
            title, worst = name.replace("_", " "), f"{times.worst_s * 1e3:.3f} ms"
            lines.append(f"{title:9} p50 {p50}  p99 {p99}  p99.9 {p99_9}  worst {worst}")
        late = self.lateness
        lines.append(
            f"at {speed_deg_s:g} deg/s: lateness p99 is {late.quantile_s(0.99) * speed_deg_s:.4f} deg, "
            f"the worst {late.worst_s * speed_deg_s:.4f} deg (scan {late.worst_scan}, "
            f"t = {late.worst_scan * self.period_s:.3f} s)"
        )
        lines.append(f"overruns {self.overruns}, deadlines skipped {self.skipped}")
        return "\n".join(lines)

    def to_dict(self) -> dict[str, object]:
        return {
            "period_s": self.period_s,
            "overruns": self.overruns,
            "skipped": self.skipped,
            **{name: times.to_dict() for name, times in self._times.items()},
        }
