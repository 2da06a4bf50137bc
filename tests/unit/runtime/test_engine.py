"""What a scan is, and what becomes of it when something fails."""

import math
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest

from gantryctl.errors import AlarmStop, CommandRefused, DeviceError, UsageError
from gantryctl.image import SAFE_OUTPUT, DriveRequest, OperatorCommand, OutputImage
from gantryctl.runtime import (
    NOTHING_READ,
    Engine,
    FixedOperator,
    ScriptedOperator,
    VirtualClock,
    trace_columns,
)
from gantryctl.runtime.recorder import MemoryRecorder
from unit.runtime.fakes import FakeDrive, FakeProgram, FakeTruth, raising

PERIOD_S = 0.001


class Bench:
    """An engine in virtual time with everything that belongs to it."""

    def __init__(self) -> None:
        self.drive, self.program, self.operator = FakeDrive(), FakeProgram(), FixedOperator()
        truth = FakeTruth(self.drive)
        self.recorder = MemoryRecorder(trace_columns(self.program, truth))
        self.engine = Engine(
            self.drive, self.program, self.operator, VirtualClock(), PERIOD_S, self.recorder, truth
        )


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_before_the_first_scan_nothing_is_read_and_the_output_is_safe(bench: Bench) -> None:
    assert bench.engine.scan == 0
    assert bench.engine.image is NOTHING_READ
    assert bench.engine.output == SAFE_OUTPUT
    assert not bench.drive.outputs


def test_row_k_holds_the_state_at_k_periods_and_the_command_computed_from_it(bench: Bench) -> None:
    bench.engine.run_for(0.5)
    trace = bench.recorder.trace()
    scans = range(500)
    assert trace.columns == ("time_s", "pos_act_counts", "vel_cmd_rad_s", "pos_load_rad")
    assert trace["time_s"].tolist() == [k * PERIOD_S for k in scans]
    assert trace["pos_act_counts"].tolist() == list(scans)
    assert trace["pos_load_rad"].tolist() == list(scans)  # sampled before the write of the same scan
    assert [output.vel_cmd_rad_s for output in bench.drive.outputs] == list(scans)


def test_time_is_scans_times_period_and_never_a_sum(bench: Bench) -> None:
    for _ in range(7):
        bench.engine.run_for(0.1)
    assert bench.engine.scan == 700
    assert bench.engine.time_s == 700 * PERIOD_S
    assert bench.engine.image.scan == 699
    assert bench.engine.image.time_s == 699 * PERIOD_S


def test_step_run_for_and_run_until_make_the_same_scans() -> None:
    stepped, ran, waited = Bench(), Bench(), Bench()
    for _ in range(50):
        stepped.engine.step()
    ran.engine.run_for(50 * PERIOD_S)
    assert waited.engine.run_until(lambda engine: engine.scan == 50, timeout_s=1.0)
    assert stepped.recorder.trace().hash() == ran.recorder.trace().hash() == waited.recorder.trace().hash()


@pytest.mark.parametrize(
    ("seconds", "scans"), [(0.0, 0), (0.001, 1), (0.0011, 2), (0.3, 300), (0.7, 700), (1e-5, 1)]
)
def test_run_for_makes_as_many_whole_scans_as_the_time_needs(
    bench: Bench, seconds: float, scans: int
) -> None:
    bench.engine.run_for(seconds)
    assert bench.engine.scan == scans


@pytest.mark.parametrize("seconds", [-1.0, math.nan, math.inf])
def test_a_time_to_run_that_makes_no_sense_is_refused(bench: Bench, seconds: float) -> None:
    with pytest.raises(UsageError, match="time to run"):
        bench.engine.run_for(seconds)
    assert bench.engine.scan == 0


@pytest.mark.parametrize("period_s", [0.0, -0.001, math.nan, math.inf])
def test_a_period_that_makes_no_sense_is_refused(period_s: float) -> None:
    with pytest.raises(UsageError, match="scan period"):
        Engine(FakeDrive(), FakeProgram(), FixedOperator(), VirtualClock(), period_s)


def test_run_until_looks_after_every_scan_and_stops_at_once(bench: Bench) -> None:
    assert bench.engine.run_until(lambda engine: engine.image.drive.pos_act_counts == 20, timeout_s=1.0)
    assert bench.engine.image.scan == 20
    assert bench.engine.scan == 21


def test_run_until_gives_up_after_the_timeout(bench: Bench) -> None:
    assert not bench.engine.run_until(lambda engine: False, timeout_s=0.02)
    assert bench.engine.scan == 20


def test_the_operators_command_reaches_the_image_of_the_next_scan(bench: Bench) -> None:
    bench.engine.step()
    bench.operator.command = OperatorCommand(power=True)
    bench.engine.step()
    assert [image.operator.power for image in bench.program.images] == [False, True]


def test_a_script_gives_each_command_from_its_scan_on() -> None:
    program = FakeProgram()
    script = [(k * 0.1, OperatorCommand(lease=k)) for k in range(1, 10)]
    Engine(FakeDrive(), program, ScriptedOperator(script), VirtualClock(), PERIOD_S).run_for(1.0)
    assert [image.operator.lease for image in program.images] == [k // 100 for k in range(1000)]


@pytest.mark.parametrize("times", [[0.2, 0.1], [math.nan], [0.0, math.inf]])
def test_a_script_out_of_order_is_refused(times: list[float]) -> None:
    with pytest.raises(UsageError, match="script"):
        ScriptedOperator([(time_s, OperatorCommand()) for time_s in times])


# --- failures --------------------------------------------------------------------------------------


def test_a_program_that_raises_gets_the_drive_a_quick_stop_in_the_same_scan(bench: Bench) -> None:
    bench.program.hooks[10] = raising(ZeroDivisionError("division by zero"))
    with pytest.raises(AlarmStop, match=r"SYS-09 .* ZeroDivisionError in scan 10 \(t = 0.010 s\)") as caught:
        bench.engine.run_for(1.0)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    assert "(fakes.py, line " in str(caught.value)
    assert caught.value.exit_code == 4
    assert len(bench.drive.outputs) == bench.engine.scan == 11
    assert bench.drive.outputs[10] == bench.engine.output
    assert bench.engine.output.request is DriveRequest.QUICK_STOP
    assert bench.engine.output.vel_cmd_rad_s == bench.engine.output.torque_ff_nm == 0.0
    assert bench.engine.output.brake_open  # a turning gantry is not stopped with the brake first
    assert isinstance(bench.engine.failure, ZeroDivisionError)


def test_the_scan_that_failed_has_a_row_without_values_of_the_program(bench: Bench) -> None:
    bench.program.hooks[10] = raising(ValueError("x"))
    with pytest.raises(AlarmStop):
        bench.engine.run_for(1.0)
    row = bench.recorder.rows()[-1]
    assert row[0] == 10 * PERIOD_S
    assert math.isnan(row[1])
    assert row[3] == 10.0


def test_a_program_that_fails_before_the_brake_was_opened_leaves_it_closed(bench: Bench) -> None:
    bench.program.hooks[0] = raising(ValueError("x"))
    with pytest.raises(AlarmStop):
        bench.engine.step()
    assert not bench.engine.output.brake_open


def test_later_scans_bring_the_axis_to_rest_close_the_brake_and_take_the_torque_off(bench: Bench) -> None:
    bench.program.hooks[10] = raising(ValueError("x"))
    with pytest.raises(AlarmStop):
        bench.engine.run_for(1.0)
    bench.drive.speed_rad_s = 100.0
    bench.engine.run_for(0.5)
    assert bench.drive.outputs[-1] == OutputImage(DriveRequest.QUICK_STOP, brake_open=True)
    bench.drive.speed_rad_s = 0.1
    bench.engine.run_for(0.1)
    assert bench.drive.outputs[-1] == OutputImage(DriveRequest.QUICK_STOP)
    bench.engine.run_for(0.4)
    assert bench.drive.outputs[-1] == SAFE_OUTPUT
    assert len(bench.program.images) == 11  # the program is not asked any more


@pytest.mark.parametrize("speed_rad_s", [100.0, math.nan])
def test_an_axis_that_does_not_come_to_rest_is_braked_after_three_seconds(
    bench: Bench, speed_rad_s: float
) -> None:
    bench.program.hooks[0] = raising(ValueError("x"))
    with pytest.raises(AlarmStop):
        bench.engine.step()
    bench.drive.speed_rad_s = speed_rad_s
    bench.engine.run_for(3.5)
    assert bench.drive.outputs[-1] == SAFE_OUTPUT


def test_a_drive_that_cannot_be_read_still_gets_a_quick_stop_every_scan(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.engine.run_for(0.01)
    monkeypatch.setattr(bench.drive, "read", raising(TimeoutError("no answer")))
    for scan in range(10, 30):
        with pytest.raises(AlarmStop, match=rf"TimeoutError in scan {scan} .*no answer"):
            bench.engine.step()
    assert {output.request for output in bench.drive.outputs[10:]} == {DriveRequest.QUICK_STOP}
    monkeypatch.undo()
    bench.drive.speed_rad_s = 100.0
    bench.engine.run_for(3.5)
    assert bench.drive.outputs[-1] == SAFE_OUTPUT


def test_an_error_of_our_own_keeps_its_kind_and_still_stops_the_drive(bench: Bench) -> None:
    refused = CommandRefused("not like this")
    bench.program.hooks[3] = raising(refused)
    with pytest.raises(CommandRefused) as caught:
        bench.engine.run_for(1.0)
    assert caught.value is refused
    assert bench.engine.output.request is DriveRequest.QUICK_STOP


def test_a_condition_that_raises_stops_the_drive_too(bench: Bench) -> None:
    with pytest.raises(AlarmStop, match="KeyError"):
        bench.engine.run_until(lambda engine: bool({}["missing"]), timeout_s=1.0)
    assert bench.engine.output.request is DriveRequest.QUICK_STOP
    assert bench.engine.scan == len(bench.drive.outputs) == 2


def test_a_program_that_returns_no_output_stops_the_drive(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench.drive, "write", lambda output: bench.drive.outputs.append(output._replace()))
    monkeypatch.setattr(bench.program, "scan", lambda image: None)
    with pytest.raises(AlarmStop, match="AttributeError"):
        bench.engine.step()
    assert bench.drive.outputs == [OutputImage(DriveRequest.QUICK_STOP)]


def test_a_drive_that_is_gone_is_reported_as_such(bench: Bench) -> None:
    bench.drive.silent_from = 5
    with pytest.raises(DeviceError, match="bus is gone · the drive did not take the quick stop: bus is gone"):
        bench.engine.run_for(1.0)
    assert bench.engine.scan == 5


def test_a_recorder_that_fails_ends_the_recording_and_not_the_motion(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = bench.recorder.record

    def full(row: tuple[float, ...]) -> None:
        if row[0] >= 0.02:
            raise DeviceError("no space left on device")
        record(row)

    monkeypatch.setattr(bench.recorder, "record", full)
    engine = Engine(bench.drive, bench.program, bench.operator, VirtualClock(), PERIOD_S, bench.recorder)
    monkeypatch.setattr(bench.program, "trace_row", lambda: (0.0, 0.0, 0.0))
    engine.run_for(0.05)
    assert engine.scan == 50
    assert engine.recording_fault is not None
    assert "no space left" in engine.recording_fault
    assert len(bench.recorder.trace()) == 20


def test_a_row_of_the_wrong_length_is_a_fault_of_the_program(bench: Bench) -> None:
    bench.program.trace_row = lambda: (1.0,)
    with pytest.raises(AlarmStop, match="expected 4 items"):
        bench.engine.step()


def test_close_reaches_the_drive_and_may_be_called_twice(bench: Bench) -> None:
    bench.engine.close()
    bench.engine.close()
    assert bench.drive.closed == 2


class Ending(MemoryRecorder):
    """A recorder whose file takes one row no more, and which cannot be finished."""

    def record(self, row: tuple[float, ...]) -> None:
        if row[0] == pytest.approx(0.02):
            raise DeviceError("no space left on device")
        super().record(row)

    def close(self) -> None:
        raise DeviceError("no space left on device")


def test_behind_a_row_that_could_not_be_written_nothing_more_is_recorded(bench: Bench) -> None:
    """Whoever reads the file would take a gap for time in which nothing happened."""
    recorder = Ending(trace_columns(bench.program))
    Engine(bench.drive, bench.program, bench.operator, VirtualClock(), PERIOD_S, recorder).run_for(0.05)
    assert len(recorder.trace()) == 20


def test_the_drive_is_left_before_the_recording_is_finished(bench: Bench) -> None:
    recorder = Ending(trace_columns(bench.program))
    engine = Engine(bench.drive, bench.program, bench.operator, VirtualClock(), PERIOD_S, recorder)
    with pytest.raises(DeviceError):
        engine.close()
    assert bench.drive.closed == 1


def test_the_first_failure_is_the_one_that_is_told(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.program.hooks[3] = raising(ValueError("the first"))
    with pytest.raises(AlarmStop):
        bench.engine.run_for(1.0)
    monkeypatch.setattr(bench.drive, "read", raising(OSError("the second")))
    with pytest.raises(AlarmStop):
        bench.engine.run_for(1.0)
    assert str(bench.engine.failure) == "the first"


def test_after_a_failure_a_closed_brake_stays_closed(bench: Bench) -> None:
    bench.program.hooks[0] = raising(ValueError("x"))
    with pytest.raises(AlarmStop):
        bench.engine.step()
    bench.engine.run_for(0.5)
    assert not any(output.brake_open for output in bench.drive.outputs)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_no_brake_closes_on_a_load_that_turns_either_way(bench: Bench, way: float) -> None:
    bench.program.hooks[10] = raising(ValueError("x"))
    with pytest.raises(AlarmStop):
        bench.engine.run_for(1.0)
    bench.drive.speed_rad_s = way * 100.0
    bench.engine.run_for(0.5)
    assert bench.drive.outputs[-1] == OutputImage(DriveRequest.QUICK_STOP, brake_open=True)


# --- Ctrl-C ----------------------------------------------------------------------------------------


@pytest.fixture
def default_interrupt() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.usefixtures("default_interrupt")
def test_ctrl_c_takes_effect_after_the_scan_and_the_engine_goes_on_where_it_was(bench: Bench) -> None:
    bench.program.hooks[10] = lambda: signal.raise_signal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        bench.engine.run_for(1.0)
    assert bench.engine.scan == 11 == len(bench.drive.outputs) == len(bench.recorder.rows())
    assert bench.engine.failure is None
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    bench.engine.step()
    bench.engine.run_for(0.009)
    assert bench.recorder.trace()["vel_cmd_rad_s"].tolist() == list(range(21))


@pytest.mark.usefixtures("default_interrupt")
def test_a_second_ctrl_c_ends_a_hanging_program_with_a_quick_stop(bench: Bench) -> None:
    def hang() -> None:
        while True:
            signal.raise_signal(signal.SIGINT)

    bench.program.hooks[10] = hang
    with pytest.raises(KeyboardInterrupt):
        bench.engine.run_for(1.0)
    assert bench.engine.output.request is DriveRequest.QUICK_STOP
    assert bench.engine.scan == len(bench.drive.outputs) == 11
    assert isinstance(bench.engine.failure, KeyboardInterrupt)


@pytest.mark.usefixtures("default_interrupt")
def test_ctrl_c_in_the_scan_that_fails_does_not_hide_the_failure(bench: Bench) -> None:
    def fail() -> None:
        signal.raise_signal(signal.SIGINT)
        raise RuntimeError("what happened")

    bench.program.hooks[10] = fail
    # A KeyboardInterrupt would end the tests.
    with pytest.raises(BaseException, match="what happened") as raised:
        bench.engine.run_for(1.0)
    assert isinstance(raised.value, AlarmStop)
    bench.engine.run_for(0.1)  # the stop goes on: the request has ended with the run that it ended
    assert bench.engine.scan == 111


def test_a_handler_of_the_caller_keeps_its_meaning(bench: Bench) -> None:
    seen = []
    before = signal.signal(signal.SIGINT, lambda number, frame: seen.append(number))
    try:
        bench.program.hooks[10] = lambda: signal.raise_signal(signal.SIGINT)
        bench.engine.run_for(0.05)
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [signal.SIGINT]
    assert bench.engine.scan == 50


def test_importing_the_runtime_does_not_import_pyarrow() -> None:
    code = "import sys, gantryctl.runtime, gantryctl.trace; sys.exit('pyarrow' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, env=os.environ).returncode == 0


def test_time_goes_on_behind_work_between_scans_that_fails_too(bench: Bench) -> None:
    started: list[int] = []
    bench.engine.clock = SimpleNamespace(start=lambda: started.append(1))
    with pytest.raises(DeviceError, match="did not answer"):
        bench.engine.between_scans(raising(DeviceError("the drive did not answer")))
    assert started == [1]


def test_a_load_that_swings_through_no_speed_has_not_come_to_rest(bench: Bench) -> None:
    """After half a second of its stop it swings back: slow for 30 ms, fast for 100, then still."""
    bench.program.hooks[2] = raising(ValueError("planted"))
    with pytest.raises(AlarmStop):
        bench.engine.run_for(0.1)
    for speed_rad_s, time_s in ((9.0, 0.5), (0.1, 0.03), (-4.0, 0.1), (0.0, 0.04)):
        bench.drive.speed_rad_s = speed_rad_s
        bench.engine.run_for(time_s)
        assert bench.engine.output.brake_open
    bench.engine.run_for(0.02)
    assert not bench.engine.output.brake_open
