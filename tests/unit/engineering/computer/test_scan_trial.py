"""Verdicts of the doctor, under clocks that are as late as the test says; no time is measured."""

from __future__ import annotations

import math

import pytest

from gantryctl.engineering.computer.scan_trial import ScanTrial, scan_trial
from gantryctl.engineering.computer.text import trial_lines
from gantryctl.errors import UsageError
from gantryctl.image import StopCause, SystemStop
from gantryctl.ports import ScanStart


class LateClock:
    """On time, but for every so many scans, which are late by `late_s` and leave out deadlines."""

    def __init__(self, every: int = 0, late_s: float = 0.0, skip: int = 0, computing_s: float = 1e-4) -> None:
        self.every, self.late_s, self.skip, self.computing_s = every, late_s, skip, computing_s
        self.count = 0

    def start(self) -> None:
        """Nothing: it has no time of its own."""

    def wait_for(self, deadline: int) -> ScanStart:
        self.count += 1
        late = self.every > 0 and self.count > 200 and self.count % self.every == 0
        return ScanStart(deadline + self.skip, self.late_s) if late else ScanStart(deadline, 20e-6)

    def elapsed_s(self) -> float:
        return self.computing_s


def trial(clock: LateClock) -> ScanTrial:
    return scan_trial(1.0, 1.0, clock)


def test_a_clock_that_is_on_time_is_good() -> None:
    found = trial(LateClock())
    assert found.good
    assert found.statistics.lateness.count == 1000
    # 20 us at 6 deg/s, rounded up by a bin of 5 %.
    assert found.to_dict(6.0)["late_p99_deg"] == pytest.approx(6.0 * 20e-6, rel=0.05)


def test_one_scan_that_would_stop_an_axis_is_not_good() -> None:
    found = trial(LateClock(every=700, late_s=0.040, skip=40))
    assert [stop.cause for stop in found.stops] == [StopCause.SCAN_LATE]
    assert not found.good
    assert "40.0 ms late (limit 30 ms)" in trial_lines(found, 6.0)[-1]


def test_scans_that_are_missing_are_not_good_although_nothing_stops() -> None:
    found = trial(LateClock(every=200, late_s=0.002, skip=2))
    assert not found.stops
    # Eight scans in a thousand are left out, one is permitted.
    assert found.skipped_share == pytest.approx(8.0e-3, abs=2.1e-3)
    assert not found.good


def test_a_computer_that_is_too_slow_is_not_good() -> None:
    found = trial(LateClock(computing_s=1.5e-3))
    assert StopCause.OVERRUNS in {stop.cause for stop in found.stops}
    assert not found.good


def test_the_histogram_shows_every_scan_once() -> None:
    found = trial(LateClock(every=100, late_s=0.0008))
    lines = trial_lines(found, 6.0)
    counts = [int(line.split()[4]) for line in lines if " deg " in line and "#" in line]
    assert sum(counts) == found.statistics.lateness.count


@pytest.mark.parametrize(
    ("period_ms", "seconds", "named"),
    [
        (0.0, 1.0, "scan period"),
        (math.nan, 1.0, "scan period"),
        (50.0, 1.0, "scan period"),
        (1.0, 0.0, "time of a trial"),
        (1.0, math.inf, "time of a trial"),
    ],
)
def test_what_cannot_be_tried_is_refused(period_ms: float, seconds: float, named: str) -> None:
    with pytest.raises(UsageError, match=named):
        scan_trial(period_ms, seconds)


def test_the_worst_stop_is_the_one_farthest_beyond_its_own_limit() -> None:
    """A scan of 300 ms where 30 are allowed is ten times too late; 12 overruns where 10 are allowed are 1.2 times."""
    stops = (SystemStop(StopCause.OVERRUNS, 12.0, 10.0, 0.0), SystemStop(StopCause.SCAN_LATE, 0.3, 0.03, 0.0))
    assert (
        "the worst for a scan 300.0 ms late (limit 30 ms)"
        in trial_lines(trial(LateClock())._replace(stops=stops), 6.0)[-1]
    )
