"""Absolute deadlines, overruns and what the engine does about them; the time is a fake one."""

import math

import numpy as np
import pytest

from gantryctl.errors import UsageError
from gantryctl.image import DriveRequest, OutputImage, StopCause
from gantryctl.runtime import (
    Engine,
    FixedOperator,
    OverrunLimits,
    OverrunPolicy,
    RealClock,
    VirtualClock,
    trace_columns,
)
from gantryctl.runtime.recorder import MemoryRecorder
from unit.runtime.fakes import FakeDrive, FakeProgram, FakeTime

PERIOD_S = 0.010


class Bench:
    """An engine at 10 ms on a fake time; `late[k]` is how long the program of scan k works."""

    def __init__(self, policy: OverrunPolicy) -> None:
        self.time, self.drive, self.program = FakeTime(), FakeDrive(), FakeProgram()
        clock = RealClock(PERIOD_S, now=self.time.now, sleep=self.time.sleep)
        self.recorder = MemoryRecorder(trace_columns(self.program))
        self.engine = Engine(
            self.drive, self.program, FixedOperator(), clock, PERIOD_S, self.recorder, None, policy
        )

    def work(self, scan: int, seconds: float) -> None:
        self.program.hooks[scan] = lambda: self.time.work(seconds)


@pytest.fixture
def going_on() -> Bench:
    return Bench(OverrunPolicy.CONTINUE)


@pytest.fixture
def strict() -> Bench:
    return Bench(OverrunPolicy.QUICK_STOP)


# --- the clock -------------------------------------------------------------------------------------


def test_deadlines_are_absolute() -> None:
    time = FakeTime()
    clock = RealClock(PERIOD_S, now=time.now, sleep=time.sleep)
    started = []
    for scan in range(100):
        assert clock.wait_for(scan) == (scan, pytest.approx(0.0, abs=1e-9))
        started.append(time.now_s)
        time.work(0.004)
    assert started == pytest.approx([5_000.0 + k * PERIOD_S for k in range(100)], abs=1e-9)


def test_a_late_scan_does_not_shift_the_next_deadline() -> None:
    time = FakeTime()
    clock = RealClock(PERIOD_S, now=time.now, sleep=time.sleep)
    clock.wait_for(0)
    time.work(0.012)
    assert clock.wait_for(1) == (1, pytest.approx(0.002))
    assert time.now_s == pytest.approx(5_000.012)  # less than a quarter of a period: at once
    assert clock.wait_for(2) == (2, pytest.approx(0.0, abs=1e-9))
    assert time.now_s == pytest.approx(5_000.020)


@pytest.mark.parametrize(
    ("work_s", "next_deadline"), [(0.013, 2), (0.019, 2), (0.022, 3), (0.047, 5), (2.003, 201)]
)
def test_missed_deadlines_are_skipped_and_the_next_one_is_on_time(work_s: float, next_deadline: int) -> None:
    time = FakeTime()
    clock = RealClock(PERIOD_S, now=time.now, sleep=time.sleep)
    clock.wait_for(0)
    time.work(work_s)
    assert clock.wait_for(1) == (next_deadline, pytest.approx(work_s - PERIOD_S))
    assert time.now_s == pytest.approx(5_000.0 + next_deadline * PERIOD_S)  # on the old grid
    assert clock.wait_for(next_deadline + 1) == (next_deadline + 1, pytest.approx(0.0, abs=1e-9))
    assert time.now_s == pytest.approx(5_000.0 + (next_deadline + 1) * PERIOD_S)


def test_a_clock_that_wakes_late_again_does_not_wait_once_more() -> None:
    time = FakeTime()
    too_long = iter([0.033, 0.022])
    clock = RealClock(PERIOD_S, now=time.now, sleep=lambda seconds: time.sleep(seconds + next(too_long)))
    clock.wait_for(0)
    assert clock.wait_for(1) == (7, pytest.approx(0.033))
    assert time.now_s == pytest.approx(5_000.072)


def test_elapsed_counts_from_the_real_start_of_the_scan() -> None:
    time = FakeTime()
    clock = RealClock(PERIOD_S, now=time.now, sleep=time.sleep)
    clock.wait_for(0)
    time.work(0.012)
    clock.wait_for(1)
    time.work(0.002)
    assert clock.elapsed_s() == pytest.approx(0.002)


def test_a_sleep_that_ends_early_is_continued() -> None:
    time = FakeTime()
    clock = RealClock(PERIOD_S, now=time.now, sleep=lambda seconds: time.sleep(max(seconds / 2, 1e-6)))
    clock.wait_for(0)
    assert clock.wait_for(1).late_s >= 0.0
    assert time.now_s == pytest.approx(5_000.010, abs=2e-6)


def test_start_forgives_an_intended_pause() -> None:
    time = FakeTime()
    clock = RealClock(PERIOD_S, now=time.now, sleep=time.sleep)
    clock.wait_for(0)
    time.work(60.0)
    clock.start()
    assert clock.wait_for(1) == (1, 0.0)
    assert clock.wait_for(2) == (2, pytest.approx(0.0, abs=1e-9))


def test_deadlines_go_on_from_the_one_at_which_time_began() -> None:
    time = FakeTime()
    clock = RealClock(PERIOD_S, now=time.now, sleep=time.sleep)
    assert clock.wait_for(1000) == (1000, 0.0)
    assert clock.wait_for(1001) == (1001, pytest.approx(0.0, abs=1e-9))
    assert time.now_s == pytest.approx(5_000.0 + PERIOD_S)


@pytest.mark.parametrize(("late_s", "next_deadline"), [(0.0009, 1), (0.0011, 6)])
def test_a_scan_of_a_quick_axis_may_be_late_by_1_ms(late_s: float, next_deadline: int) -> None:
    """A quarter of 0.25 ms is less than a computer keeps; 1.1 ms are five periods, of which the rest is waited for."""
    time = FakeTime()
    clock = RealClock(0.00025, now=time.now, sleep=time.sleep)
    clock.wait_for(0)
    time.work(0.00025 + late_s)
    assert clock.wait_for(1)[0] == next_deadline


@pytest.mark.parametrize("period_s", [0.0, -1.0, math.nan])
def test_a_clock_wants_a_period(period_s: float) -> None:
    with pytest.raises(UsageError, match="scan period"):
        RealClock(period_s)


def test_the_real_sleep_and_time_are_used_by_default() -> None:
    clock = RealClock(1e-4)
    assert clock.wait_for(0) == (0, 0.0)
    assert clock.wait_for(3).deadline >= 3


# --- the engine on it ------------------------------------------------------------------------------


def test_real_time_makes_the_same_trace_as_virtual_time(going_on: Bench) -> None:
    going_on.work(20, 0.5)
    going_on.engine.run_for(1.0)
    program = FakeProgram()
    recorder = MemoryRecorder(trace_columns(program))
    Engine(FakeDrive(), program, FixedOperator(), VirtualClock(), PERIOD_S, recorder).run_for(1.0)
    assert going_on.recorder.trace().hash() == recorder.trace().hash()


def test_scans_missed_on_an_axis_that_goes_on_are_left_out(strict: Bench) -> None:
    """Numbers, times and rows go on with the time: whoever counts in scans or in seconds has lost nothing."""
    strict.work(20, 0.023)
    strict.engine.run_for(0.5)
    images = strict.program.images
    assert [image.scan for image in images[19:24]] == [19, 20, 23, 24, 25]
    assert all(image.time_s == image.scan * PERIOD_S for image in images)
    assert np.array_equal(strict.recorder.trace()["time_s"], [image.time_s for image in images])
    assert strict.time.now_s == pytest.approx(5_000.0 + 0.49)  # as long as it was asked to run
    assert strict.engine.scan == 50
    assert strict.engine.system_stop is None
    assert strict.engine.statistics.skipped == 2


def test_a_stall_is_counted_and_the_program_goes_on_under_continue(going_on: Bench) -> None:
    going_on.work(20, 2.003)
    going_on.engine.run_for(1.0)
    statistics = going_on.engine.statistics
    assert going_on.engine.system_stop is None
    assert going_on.drive.outputs[-1].request is DriveRequest.ENABLE
    assert statistics.overruns == 2  # the scan that stalled and the one that woke late
    assert statistics.skipped == 200
    assert statistics.lateness.worst_s == pytest.approx(1.993)
    assert statistics.lateness.worst_scan == 21


def test_one_overrun_of_a_period_stops_nothing(strict: Bench) -> None:
    strict.work(20, 0.012)
    strict.engine.run_for(2.0)
    assert strict.engine.system_stop is None
    assert strict.engine.statistics.overruns == 1


def test_a_scan_too_late_gets_a_quick_stop_in_place_of_the_old_command(strict: Bench) -> None:
    strict.work(20, 0.045)
    strict.engine.run_for(0.21)
    assert strict.drive.outputs[20].request is DriveRequest.ENABLE
    strict.engine.step()
    assert strict.drive.outputs[21] == OutputImage(DriveRequest.QUICK_STOP, brake_open=True)
    assert strict.program.images[21].scan == 25
    image = strict.program.images[21]
    assert not image.operator.quick_stop  # it was not the operator
    stop = strict.engine.system_stop
    assert stop is not None
    assert image.system_stop is stop
    assert stop == (StopCause.SCAN_LATE, pytest.approx(0.035), 0.030, pytest.approx(0.25))


def test_a_frozen_controller_does_not_resume(strict: Bench) -> None:
    strict.work(20, 2.0)
    strict.engine.run_for(1.0)
    stop = strict.engine.system_stop
    assert stop is not None
    assert stop[:3] == (StopCause.FROZEN, pytest.approx(1.990), 0.050)
    requests = [output.request for output in strict.drive.outputs]
    assert set(requests[:21]) == {DriveRequest.ENABLE}
    assert set(requests[21:]) == {DriveRequest.QUICK_STOP}  # for as long as the program wants to move
    assert len(requests) == 22  # the second it was to run was over before it woke


@pytest.mark.parametrize(
    ("late_s", "cause"),
    [(0.031, StopCause.SCAN_LATE), (0.049, StopCause.SCAN_LATE), (0.051, StopCause.FROZEN)],
)
def test_how_late_is_late_and_frozen(strict: Bench, late_s: float, cause: StopCause) -> None:
    strict.work(20, PERIOD_S + late_s)
    strict.engine.run_for(0.5)
    assert strict.engine.system_stop is not None
    assert strict.engine.system_stop.cause is cause


def test_the_programs_own_stop_is_not_disturbed(strict: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    strict.work(20, 2.0)
    strict.engine.run_for(2.5)
    monkeypatch.setattr(strict.program, "scan", lambda image: OutputImage())
    strict.engine.step()
    assert strict.drive.outputs[-1] == OutputImage()


@pytest.mark.parametrize(("overruns", "stopped"), [(5, False), (6, True)])
def test_more_than_five_overruns_in_a_second_stop(strict: Bench, overruns: int, stopped: bool) -> None:
    for k in range(overruns):
        strict.work(10 + 10 * k, 0.012)
    strict.engine.run_for(2.0)
    assert strict.engine.statistics.overruns == overruns
    assert (strict.engine.system_stop is not None) is stopped
    if stopped:
        assert strict.engine.system_stop is not None
        assert strict.engine.system_stop[:3] == (StopCause.OVERRUNS, 6, 5)


def test_overruns_during_a_stop_do_not_stop_again_once_it_is_acknowledged(strict: Bench) -> None:
    """Twenty within two seconds, which nobody counts as long as the first six stop the axis; then a quiet second."""
    for k in range(20):
        strict.work(10 + 10 * k, 0.012)
    strict.engine.run_for(4.0)
    assert strict.engine.system_stop is not None
    strict.engine.system_stop = None
    strict.engine.run_for(0.2)
    assert strict.engine.system_stop is None


@pytest.mark.parametrize(
    ("brake_open", "vel_rad_s", "stopped"), [(True, 0.0, True), (False, -5.0, True), (False, 0.0, False)]
)
def test_a_program_that_does_not_look_at_a_stop_gives_torque_at_zero_speed_behind_its_brake_only(
    strict: Bench, brake_open: bool, vel_rad_s: float, stopped: bool
) -> None:
    strict.work(20, 0.045)
    strict.engine.run_for(0.21)
    asked = OutputImage(DriveRequest.ENABLE, vel_rad_s, 7.0, brake_open)
    strict.program.scan = lambda image: asked  # type: ignore[method-assign]
    strict.engine.step()
    given = strict.drive.outputs[-1]
    assert given == (OutputImage(DriveRequest.QUICK_STOP, brake_open=brake_open) if stopped else asked)


def test_overruns_far_apart_do_not_add_up(strict: Bench) -> None:
    for k in range(20):
        strict.work(10 + 30 * k, 0.012)
    strict.engine.run_for(7.0)
    assert strict.engine.statistics.overruns == 20
    assert strict.engine.system_stop is None


def test_the_limits_can_be_set(strict: Bench) -> None:
    strict.engine.overrun_limits = OverrunLimits(late_s=0.001)
    strict.work(20, 0.012)
    strict.engine.run_for(1.0)
    assert strict.engine.system_stop is not None


def test_a_program_that_raises_in_real_time_stops_the_drive(going_on: Bench) -> None:
    def fail() -> None:
        raise ValueError("x")

    going_on.program.hooks[5] = fail
    with pytest.raises(Exception, match="SYS-09"):
        going_on.engine.run_for(1.0)
    going_on.engine.run_for(0.1)
    assert going_on.drive.outputs[-1].request is DriveRequest.QUICK_STOP
