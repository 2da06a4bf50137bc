"""The shipped program in real time on this computer: how late its scans are, and what that is in degrees."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from gantryctl.errors import UsageError
from gantryctl.image import SystemStop
from gantryctl.machine import default_machine, with_values
from gantryctl.ports import Clock
from gantryctl.runtime import Engine, OverrunPolicy, ScanStatistics, keeps_time
from gantryctl.wiring.engine import build_engine

# Scans that are left out, as a part of all: of a thousand a second, one.
SKIPPED_SHARE_MAX: Final = 1e-3
PERIOD_MIN_MS: Final = 0.5
PERIOD_MAX_MS: Final = 40.0
SECONDS_MIN: Final = 0.1
SECONDS_MAX: Final = 86_400.0
_SLICE_S: Final = 0.1


class ScanTrial(NamedTuple):
    """One trial of one scan period."""

    statistics: ScanStatistics
    granted: bool
    """The system gave a real-time priority."""
    stops: tuple[SystemStop, ...]
    """Stops of an axis on a bus, that lateness and overruns would have caused."""

    @property
    def skipped_share(self) -> float:
        """Deadlines without a scan, as a part of all."""
        scans, skipped = self.statistics.lateness.count, self.statistics.skipped
        return skipped / (scans + skipped) if scans else 1.0

    @property
    def good(self) -> bool:
        """The axis would not have been stopped, and hardly a scan is missing."""
        return not self.stops and self.skipped_share <= SKIPPED_SHARE_MAX

    def to_dict(self, speed_deg_s: float) -> dict[str, object]:
        """Plain figures; angles are what the axis travels at this speed in the time."""
        late = self.statistics.lateness
        return {
            "good": self.good,
            "real_time_granted": self.granted,
            "stops": [
                {"cause": stop.cause.name, "measured": stop.measured, "limit": stop.limit}
                for stop in self.stops
            ],
            "skipped_share": self.skipped_share,
            "speed_deg_s": speed_deg_s,
            "late_p99_deg": late.quantile_s(0.99) * speed_deg_s,
            "late_worst_deg": late.worst_s * speed_deg_s,
            "late_steps": [[None if math.isinf(edge) else edge, count] for edge, count in late.steps()],
            **self.statistics.to_dict(),
        }


def scan_trial(
    period_ms: float,
    seconds: float,
    clock: Clock | None = None,
    watch: Callable[[float], None] = lambda more_s: None,
) -> ScanTrial:
    """Run the shipped program on the simulated gantry in real time, power off.

    A bus is not part of it: its telegrams come on top (`benchmarks/can_cycle.py`).

    Args:
        clock: another than the real one, for tests.
        watch: is told the time that has gone since it was told last, s.

    Raises:
        UsageError: a period or a time out of range.
    """
    for name, value, low, high, unit in (
        ("the scan period", period_ms, PERIOD_MIN_MS, PERIOD_MAX_MS, "ms"),
        ("the time of a trial", seconds, SECONDS_MIN, SECONDS_MAX, "s"),
    ):
        if not low <= value <= high:
            raise UsageError(f"{name} must be {low:g} to {high:g} {unit}, got {value:g}")
    machine = with_values(default_machine(), {"control.scan_period_ms": period_ms})
    engine = build_engine(machine, real_time=True)
    # As for an axis on a bus, which goes on while scans are missed.
    engine.overrun_policy = OverrunPolicy.QUICK_STOP
    engine.clock = clock or engine.clock
    stops: list[SystemStop] = []
    try:
        with keeps_time() as granted:
            # The first scans of a process are the slowest, and no axis moves in them.
            engine.run_for(_SLICE_S)
            _acknowledge(engine)
            engine.statistics = ScanStatistics(engine.period_s)
            end = engine.scan + round(seconds / engine.period_s)
            while engine.scan < end:
                engine.run_for(min(_SLICE_S, (end - engine.scan) * engine.period_s))
                stops += _acknowledge(engine)
                watch(_SLICE_S)
    finally:
        engine.close()
    return ScanTrial(engine.statistics, granted, tuple(stops))


def _acknowledge(engine: Engine) -> list[SystemStop]:
    """The stop that the engine asks for, if any; it is over with this."""
    stop, engine.system_stop = engine.system_stop, None
    return [] if stop is None else [stop]
