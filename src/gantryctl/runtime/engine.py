"""The scan engine: read, program, write, record. The caller drives it; there is no hidden thread."""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from gantryctl._core import new_image
from gantryctl.errors import AlarmStop, DeviceError, GantryctlError, UsageError
from gantryctl.image import (
    SAFE_OUTPUT,
    DriveFeedback,
    DriveRequest,
    DriveState,
    EncoderFlag,
    InputImage,
    OperatorCommand,
    OutputImage,
    SystemStop,
)
from gantryctl.ports import Clock, Drive, Operator, Program, Recorder, Truth
from gantryctl.runtime.clocks import VirtualClock
from gantryctl.runtime.interrupts import DeferredInterrupt
from gantryctl.runtime.overrun import OverrunLimits, OverrunPolicy, RecentOverruns
from gantryctl.runtime.statistics import ScanStatistics
from gantryctl.runtime.stopping import (
    REFERENCE_STOP,
    StopProgram,
    StopTimes,
    quick_stop_output,
    stop_output,
)
from gantryctl.trace.columns import TIME_COLUMN, degree_factor, in_degrees, unit_of

if TYPE_CHECKING:
    from gantryctl.trace.table import Trace

NOTHING_READ: Final = InputImage(
    scan=-1,
    time_s=math.nan,
    drive=DriveFeedback(
        DriveState.UNKNOWN, 0, math.nan, math.nan, False, False, math.nan, EncoderFlag.ALARM, age_scans=-1
    ),
    operator=OperatorCommand(),
)
"""`Engine.image` before the first scan."""
# Columns of which a notebook shows the present value.
_SHOWN: Final = {"pos_act_rad": "angle", "vel_act_rad_s": "speed", "torque_act_nm": "torque"}


def trace_columns(program: Program, truth: Truth | None = None) -> tuple[str, ...]:
    """Columns of the rows that an engine with this program and truth records."""
    return (TIME_COLUMN, *program.trace_columns, *(truth.truth_columns if truth is not None else ()))


class Engine:
    """Runs a program on a drive, scan by scan.

    One scan: wait for its time, `drive.read()`, `operator.poll()`, `program.scan()`, `drive.write()`, one
    trace row. The row of scan k is the state at `k x period`: the truth is sampled before the write. Where the
    axis goes on while scans are missed (`OverrunPolicy.QUICK_STOP`), their numbers are left out.

    When anything in a scan raises, the drive gets a quick stop in place of the program's output and the
    error goes on as a `GantryctlError`. Scans that the caller still makes bring the axis to rest, close the
    brake and take the torque off, without the program; torque that alone holds the load goes on
    (`holds_load`). A recorder that fails loses the rest of its recording, and the axis goes on.

    Args:
        stop_times: of the stop behind a failure.

    Attributes:
        scan: number of the next scan: scans done so far and deadlines missed.
        image: input of the last scan, `NOTHING_READ` before the first.
        output: what the drive was told last.
        statistics: how well real time was kept; nothing is measured in virtual time.
        failure: what ended the program, or None.
        overrun_limits: when the policy acts; the caller may set others.
        system_stop: why the overrun policy stops the axis, or None; whoever has acknowledged it clears it.
        recording_fault: why the recording ended early, or None.
    """

    def __init__(
        self,
        drive: Drive,
        program: Program,
        operator: Operator,
        clock: Clock,
        period_s: float,
        recorder: Recorder | None = None,
        truth: Truth | None = None,
        overrun_policy: OverrunPolicy = OverrunPolicy.CONTINUE,
        stop_times: StopTimes = REFERENCE_STOP,
    ) -> None:
        if not (math.isfinite(period_s) and period_s > 0.0):
            raise UsageError(f"scan period must be above 0 s, got {period_s} s")
        self.drive, self.program, self.operator, self.clock = drive, program, operator, clock
        self.period_s = period_s
        self.recorder, self.truth = recorder, truth
        self.overrun_policy, self.overrun_limits = overrun_policy, OverrunLimits()
        self._stop_times = stop_times
        self.scan = 0
        self.image: InputImage = NOTHING_READ
        self.output: OutputImage = SAFE_OUTPUT
        self.statistics = ScanStatistics(period_s)
        self.failure: BaseException | None = None
        self.system_stop: SystemStop | None = None
        self.recording_fault: str | None = None
        self._active: Program = program
        self._record = recorder.record if recorder is not None else None
        self._truth = truth.truth if truth is not None and recorder is not None else tuple
        self._overruns = RecentOverruns()
        self._waited = 0
        self._interrupt = DeferredInterrupt()

    @property
    def time_s(self) -> float:
        """Nominal time of the next scan: `scan x period`, never a sum."""
        return self.scan * self.period_s

    def step(self) -> None:
        """Make one scan. Ctrl-C inside it is a failure (quick stop); `run_for` and `run_until` defer it."""
        self._guarded(self.scan + 1, None)

    def run_for(self, seconds: float) -> None:
        """Make as many whole scans as `seconds` needs."""
        self._run(self.scan + self._scans(seconds), None)

    def run_until(self, condition: Callable[[Engine], bool], timeout_s: float) -> bool:
        """Scan until `condition(engine)` holds after a scan; False when `timeout_s` is over before."""
        return self._run(self.scan + self._scans(timeout_s), condition)

    def between_scans(self, work: Callable[[], None]) -> None:
        """Do work that takes longer than a scan, with power off: the scan after it is on time whenever it comes."""
        try:
            work()
        finally:
            self.clock.start()

    @property
    def holds_load(self) -> bool:
        """The program has failed while torque alone held the load, and the torque goes on with every scan."""
        return isinstance(self._active, StopProgram) and self._active.holding

    def trace(self) -> Trace:
        """Copy the recording so far.

        Raises:
            UsageError: nothing is recorded in memory.
        """
        # Here, because a controller of the service, which records elsewhere, has no use for it.
        from gantryctl.runtime.recorder import MemoryRecorder

        if not isinstance(self.recorder, MemoryRecorder):
            raise UsageError(
                "this engine keeps no recording in memory: build_engine(..., recorder=MemoryRecorder)"
            )
        return self.recorder.trace()

    def _repr_html_(self) -> str:
        from gantryctl.notebook import facts_html

        facts: dict[str, object] = {
            "time": f"{self.time_s:.3f} s, {self.scan} scans of {1e3 * self.period_s:g} ms",
            "program": type(self.program).__name__,
            "drive": f"{type(self.drive).__name__}, {self.image.drive.state.name.lower()}",
        }
        row = dict(zip(self.program.trace_columns, self.program.trace_row(), strict=True))
        for name, words in _SHOWN.items():
            if self.scan and name in row:
                facts[words] = f"{row[name] * degree_factor(name):.4f} {unit_of(in_degrees(name)).symbol}"
        stopped = self.failure or self.system_stop
        return facts_html("Engine", facts | ({"stopped by": stopped} if stopped else {}))

    def close(self) -> None:
        """Leave the drive without torque, then finish the recording; may be called twice."""
        # The torque first: a recording that cannot be finished must not keep the drive on.
        try:
            self.drive.close()
        finally:
            if self.recorder is not None:
                self.recorder.close()

    def _scans(self, seconds: float) -> int:
        if not (math.isfinite(seconds) and seconds >= 0.0):
            raise UsageError(f"time to run must be a number of seconds from 0 up, got {seconds}")
        # A whole quotient may come out an ulp too large, 0.30000000000000004 / 0.1: that is not one scan more.
        return math.ceil(seconds / self.period_s - 1e-6)

    def _run(self, end: int, condition: Callable[[Engine], bool] | None) -> bool:
        """Scan up to `end` or until the condition holds; Ctrl-C takes effect between scans."""
        with self._interrupt:
            return self._guarded(end, condition)

    def _guarded(self, end: int, condition: Callable[[Engine], bool] | None) -> bool:
        """Run scans; when one raises, stop the drive before the error goes on."""
        try:
            return self._scan_until(end, condition)
        except BaseException as failure:
            scan, time_s = self.scan, self.time_s
            silent = self._stop_drive(failure)
            # Ctrl-C goes on as it is; a program that calls sys.exit has a fault like any other.
            if not isinstance(failure, (Exception, SystemExit)):
                raise
            if silent is not None:
                text = f"{failure} · the drive did not take the quick stop: {silent}"
                raise DeviceError(text) from failure
            if isinstance(failure, GantryctlError):
                raise
            raise ScanFailure(failure, scan, time_s, held=self.holds_load) from failure

    def _scan_until(self, end: int, condition: Callable[[Engine], bool] | None) -> bool:
        clock, interrupt, scan = self.clock, self._interrupt, self._scan
        # In virtual time no deadline is waited for, and no time measured.
        paced = not isinstance(clock, VirtualClock)
        if paced and self.scan == 0:
            clock.start()
        while self.scan < end and not interrupt.pending:
            if paced:
                late_s, skipped = self._wait()
            scan()
            if paced and self.statistics.add(self.image.scan, late_s, clock.elapsed_s(), skipped):
                self._overruns.add(self.image.time_s)
            if condition is not None and condition(self):
                return True
        return False

    def _wait(self) -> tuple[float, int]:
        """Wait for the next scan; give its lateness, s, and the number of deadlines skipped."""
        wanted = self.scan + self._waited
        deadline, late_s = self.clock.wait_for(wanted)
        skipped = deadline - wanted
        # Missed deadlines are never caught up (decision 0005). A real axis went on meanwhile: the scan has the number
        # of its deadline, and set-point, timers and leases follow. A simulated plant has waited: one number a scan.
        if self.overrun_policy is OverrunPolicy.QUICK_STOP:
            self.scan += skipped
            if self.system_stop is None:
                self.system_stop = self._overruns.reason_to_stop(self.time_s, late_s, self.overrun_limits)
        else:
            self._waited += skipped
        return late_s, skipped

    def _scan(self) -> None:
        """Read, program, write, record: the order of a scan, in one place."""
        drive, scan, stop = self.drive, self.scan, self.system_stop
        time_s = scan * self.period_s
        feedback, command = drive.read(), self.operator.poll(time_s)
        self.image = image = new_image(InputImage, scan, time_s, feedback, command, stop)
        output = self._active.scan(image)
        # A custom program may not look: where it would move, the drive stops all the same. Torque at zero speed against
        # a closed brake moves nothing, and may be all that holds a load whose brake slips behind the stop.
        if (
            stop is not None
            and output.request is DriveRequest.ENABLE
            and (output.brake_open or output.vel_cmd_rad_s)
        ):
            output = quick_stop_output(output.brake_open)
        record = self._record
        # Row k is the state at k x period, and a simulated plant advances inside the write (decision 0005).
        true_row = self._truth() if record is not None else ()
        drive.write(output)
        self.output = output
        self.scan = scan + 1
        if record is not None:
            try:
                record((time_s, *self._active.trace_row(), *true_row))
            except DeviceError as fault:
                # A write error ends the recording, never the motion (decision 0006).
                self.recording_fault = f"recording ended at t = {self.time_s:.3f} s: {fault}"
                self._record = None

    def _stop_drive(self, failure: BaseException) -> Exception | None:
        """Quick stop in place of the scan that failed, `StopProgram` from now on.

        Returns:
            Why the drive did not take it, or None.
        """
        self.failure = self.failure or failure
        # The brake stays as it was: closing on a turning gantry loads the reducer more than the ramp (decision 0006).
        output = stop_output(self.output)
        if not isinstance(self._active, StopProgram):
            self._active = StopProgram(output, self.program.trace_columns, self._stop_times)
        try:
            with suppress(Exception):
                if self._record is not None:
                    self._record((self.time_s, *self._active.trace_row(), *self._truth()))
            self.drive.write(output)
            self.output = output
            self.scan += 1
        except Exception as silent:
            return silent
        return None


class ScanFailure(AlarmStop):
    """SYS-09: something in a scan that should never raise.

    Attributes:
        values: fields of the message of SYS-09: type, scan, time, text, and the line it came from.
    """

    def __init__(
        self, failure: Exception | SystemExit, scan: int, time_s: float, *, held: bool = False
    ) -> None:
        frames = traceback.extract_tb(failure.__traceback__)
        place = f"{Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else "unknown place"
        self.values: dict[str, object] = {
            "failure": type(failure).__name__, "scan": scan, "time_s": time_s, "text": str(failure), "place": place,
        }  # fmt: skip
        super().__init__(
            f"SYS-09 STOP · {type(failure).__name__} in scan {scan} (t = {time_s:.3f} s): {failure} ({place}) · "
            f"{'torque goes on holding the load' if held else 'quick stop'} · correct the program or report this",
            "SYS-09",
        )
