"""Scans in slices: what is handed to the program at which slice, when waiting ends, and what a display is shown."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.operation.client import Snapshot, Stop
from gantryctl.operation.sliced_scan import SlicedScan
from gantryctl.program import AxisState
from gantryctl.runtime import FixedOperator
from gantryctl.units import rad

approx = pytest.approx


class Engine:
    """Scans of 10 ms that do nothing but pass, and what the operator asked for in each of them."""

    def __init__(self, operator: FixedOperator) -> None:
        self.time_s, self.operator = 0.0, operator
        self.slices: list[float] = []
        self.seen: list[Any] = []
        self.image = SimpleNamespace(drive=SimpleNamespace(vel_act_rad_s=rad(1144.0)))

    def run_until(self, condition: Callable[[object], bool], timeout_s: float) -> bool:
        self.slices.append(round(timeout_s, 6))
        for _ in range(round(timeout_s / 0.01)):
            self.time_s = round(self.time_s + 0.01, 6)
            self.seen.append(self.operator.command)
            if condition(self):
                return True
        return False


class Bench:
    def __init__(self, observer: Callable[[Snapshot], None] | None = None) -> None:
        self.operator = FixedOperator()
        self.engine = Engine(self.operator)
        self.looks: list[float] = []
        self.axis = SimpleNamespace(
            state=AxisState.DISCRETE_MOTION, pos_act_rad=rad(20.0), pos_err_rad=rad(0.02), plan_end_s=1.5,
            feedback=SimpleNamespace(position_valid=True, speed_known=True, in_doubt=False),
            settings=SimpleNamespace(
                law=SimpleNamespace(ratio=1144.0), travel=SimpleNamespace(shown_rad=lambda angle: angle)
            ),
        )  # fmt: skip
        frames: Any = SimpleNamespace(look=self.looks.append)
        engine: Any = self.engine
        axis: Any = self.axis
        self.scans = SlicedScan(engine, axis, self.operator, frames, observer)

    def at(self, time_s: float, act: Callable[[], None]) -> Callable[[], bool]:
        """Never done; acts in the scan that ends at a time."""

        def done() -> bool:
            if self.engine.time_s == approx(time_s):
                act()
            return False

        return done

    def stop(self, urgency: Stop) -> Callable[[], None]:
        return lambda: setattr(self.scans, "stop", urgency)


def never() -> bool:
    return False


def test_it_ends_with_its_time_in_slices_of_a_tenth_of_a_second() -> None:
    bench = Bench()
    bench.scans.until(never, 0.25)
    assert bench.engine.time_s == approx(0.25)
    assert bench.engine.slices == [0.1, 0.1, 0.05]
    assert bench.looks == approx([0.1, 0.2, 0.25])


def test_it_ends_in_the_scan_in_which_it_is_done() -> None:
    bench = Bench()
    bench.scans.until(lambda: bench.engine.time_s > 0.135, 9.0)
    assert bench.engine.time_s == approx(0.14)


def test_the_lease_is_renewed_every_30_ms_while_a_key_is_held() -> None:
    """[monitors] lease_ms is 250: eight renewals may be late."""
    bench = Bench()
    bench.scans.until(never, 0.3, held=True)
    assert bench.engine.slices == [0.03] * 10
    assert bench.operator.command.lease == 10
    idle = Bench()
    idle.scans.until(never, 0.3)
    assert idle.operator.command.lease == 0


@pytest.mark.parametrize(("urgency", "level"), [(Stop.RAMP, "stop"), (Stop.QUICK, "quick_stop")])
def test_a_request_to_stop_is_in_the_next_scan_and_waiting_goes_on(urgency: Stop, level: str) -> None:
    bench = Bench()
    bench.scans.until(bench.at(0.05, bench.stop(urgency)), 0.3)
    levels = [getattr(command, level) for command in bench.engine.seen]
    assert levels == [False] * 5 + [True] * 25
    other = "quick_stop" if level == "stop" else "stop"
    assert not any(getattr(command, other) for command in bench.engine.seen)


def test_a_more_urgent_request_follows_at_once() -> None:
    bench = Bench()
    asked = {0.05: Stop.RAMP, 0.12: Stop.QUICK}

    def done() -> bool:
        bench.scans.stop = asked.get(bench.engine.time_s, bench.scans.stop)
        return False

    bench.scans.until(done, 0.3)
    assert [command.quick_stop for command in bench.engine.seen] == [False] * 12 + [True] * 18


def test_a_request_to_stop_lets_a_key_go() -> None:
    bench = Bench()
    bench.scans.until(bench.at(0.05, bench.stop(Stop.RAMP)), 9.0, held=True)
    assert bench.engine.time_s == approx(0.05)
    assert bench.operator.command.stop
    # Of one that was asked before nothing is held.
    bench.scans.until(never, 9.0, held=True)
    assert bench.engine.time_s == approx(0.05)


@pytest.mark.parametrize("urgency", [Stop.NO, Stop.RAMP, Stop.QUICK])
def test_where_stops_are_not_watched_nothing_is_handed_over_and_time_goes_on(urgency: Stop) -> None:
    """A power-down is under way already."""
    bench = Bench()
    bench.scans.stop = urgency
    bench.scans.until(never, 0.2, watch=False)
    assert bench.engine.slices == [0.1, 0.1]
    assert not bench.operator.command.stop
    assert not bench.operator.command.quick_stop


# --- the display ------------------------------------------------------------------------------------------------------


def test_a_snapshot_is_in_degrees_at_the_gantry() -> None:
    bench = Bench()
    bench.scans.until(never, 0.1)
    seen = bench.scans.snapshot()
    assert (seen.angle_deg, seen.speed_deg_s) == approx((20.0, 1.0))
    assert seen.following_error_deg == approx(0.02)
    assert (seen.time_s, seen.time_left_s, seen.state) == (approx(0.1), approx(1.4), "discrete motion")
    bench.axis.plan_end_s = 0.0
    assert bench.scans.snapshot().time_left_s == 0.0
    bench.axis.state = AxisState.STANDSTILL
    assert bench.scans.snapshot().time_left_s is None


@pytest.mark.parametrize(
    ("valid", "known", "doubt", "shown"),
    [
        (True, True, False, (True, True)),
        (False, True, False, (False, True)),
        (True, False, False, (True, False)),
        (True, True, True, (True, False)),
    ],
)
def test_what_is_in_doubt_is_not_shown(
    valid: bool, known: bool, doubt: bool, shown: tuple[bool, bool]
) -> None:
    bench = Bench()
    bench.axis.feedback = SimpleNamespace(position_valid=valid, speed_known=known, in_doubt=doubt)
    seen = bench.scans.snapshot()
    assert (seen.angle_deg is not None, seen.speed_deg_s is not None) == shown


@pytest.mark.parametrize(
    ("asked", "after"), [(Stop.NO, Stop.RAMP), (Stop.RAMP, Stop.RAMP), (Stop.QUICK, Stop.QUICK)]
)
def test_a_display_that_fails_is_left_out_and_stops_the_axis(asked: Stop, after: Stop) -> None:
    shown: list[float] = []

    def fails(snapshot: Snapshot) -> None:
        shown.append(snapshot.time_s)
        raise BrokenPipeError

    bench = Bench(fails)
    bench.scans.stop = asked
    bench.scans.until(never, 0.3)
    assert shown == approx([0.1])
    assert bench.scans.stop is after


def test_after_the_last_scan_the_frames_since_the_last_slice_are_taken() -> None:
    bench = Bench()
    bench.engine.time_s = 7.0
    bench.scans.end()
    assert bench.looks == [7.0]
