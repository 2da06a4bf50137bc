"""Runs the axis of a machine in this process: program, recording, live line, summary."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.cli.axis.display import Display, RunDetails
from gantryctl.cli.options import directory
from gantryctl.machine import Machine
from gantryctl.operation.client import MotionReport
from gantryctl.operation.opening import bus_lines
from gantryctl.operation.run import AxisRun
from gantryctl.operation.scripting import load_program
from gantryctl.operation.store import StateStore
from gantryctl.operation.summary import MotionSummary, summarise
from gantryctl.ports import Recorder
from gantryctl.runtime.recorder import ArrowRecorder, MemoryRecorder
from gantryctl.trace.files import Metadata
from gantryctl.trace.naming import next_number, numbered, oldest_first
from gantryctl.trace.reader import read_trace
from gantryctl.wiring.engine import recording_metadata

# Recordings kept in the state directory; older ones are removed. --out keeps everything.
TRACES_KEPT: Final = 50


class LocalRun(NamedTuple):
    """An open machine of this process, and the display of its run."""

    axis: AxisRun
    live: Display

    def details(self, report: MotionReport | None) -> RunDetails:
        """End the live line; summary, alarms, timing and bus of the run, and its recording."""
        self.live.end()
        axis = self.axis
        summary, file = _summary(axis, report)
        lines: list[str] = []
        if axis.engine.statistics.lateness.count and summary is not None:
            lines += axis.engine.statistics.report(summary.peak_deg_s).splitlines()
        lines += [f"bus               {line}" for line in bus_lines(axis.drive)]
        alarms = tuple(alarm.text for alarm in axis.axis.alarms.history)
        return RunDetails(summary, axis.notes, alarms, tuple(lines), file, axis.engine.recording_fault or "")


@contextmanager
def local_run(
    machine: Machine,
    name: str,
    *,
    program_name: str | None,
    no_trace: bool,
    out: Path | None,
    seed: int,
    fresh: bool,
    real_time: bool,
    as_json: bool,
) -> Iterator[LocalRun]:
    """Open a machine with its program, recording and live line; the caller runs and closes the axis."""
    program = load_program(program_name)
    live = Display(machine, enabled=not as_json)
    # Locked from before the drive is opened until the state is kept: a second run would start from an old state.
    with nullcontext() if fresh else StateStore(machine) as store:
        path = None if no_trace else trace_path(store, out, name)

        def recorder(columns: tuple[str, ...]) -> Recorder:
            metadata: Metadata = {
                **recording_metadata(machine),
                "version": version("gantryctl"),
                "seed": seed,
            }
            # Without a recording the summary still needs the rows.
            if path is None:
                return MemoryRecorder(columns, metadata)
            return ArrowRecorder(path, columns, metadata)

        axis = AxisRun(
            machine, store, program=program, recorder=recorder, real_time=real_time, observer=live.show
        )
        for note in axis.notes:
            live.say(note)
        yield LocalRun(axis, live)


def trace_path(store: StateStore | None, out: Path | None, name: str) -> Path | None:
    """Path of the recording: --out, else the state directory; None without either."""
    if out is None and store is None:
        return None
    folder = directory(out if out is not None else store.traces if store is not None else Path())
    if out is None:
        for old in oldest_first(folder.glob("*.parquet"))[: -TRACES_KEPT + 1]:
            old.unlink(missing_ok=True)
    return folder / numbered(name, next_number(folder), datetime.now(UTC))


def _summary(axis: AxisRun, report: MotionReport | None) -> tuple[MotionSummary | None, Path | None]:
    """Summary and path of the recording; a recording without a row is removed."""
    recorder, end_s = axis.engine.recorder, axis.engine.time_s
    file = recorder.path if isinstance(recorder, ArrowRecorder) else None
    if not axis.engine.scan:
        if file is not None:
            file.unlink(missing_ok=True)
        return None, None
    if file is not None:
        trace = read_trace(file)
    else:
        assert isinstance(recorder, MemoryRecorder)
        trace = recorder.trace()
    begin_s, end_s = (report.from_s, report.to_s) if report is not None else (0.0, end_s)
    # A recording that ended early (disk full) may hold nothing of the motion itself.
    if not len(trace.slice(begin_s, end_s)):
        begin_s, end_s = 0.0, axis.engine.time_s
    known = axis.axis.feedback.position_valid
    return summarise(trace, begin_s, end_s, axis.machine.axis, end_known=known), file
