"""Runs an axis for a command line: signals, live line, recording, summary."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from types import FrameType
from typing import Final

import click

from gantryctl.cli.axis.display import Display
from gantryctl.cli.options import directory, print_json
from gantryctl.cli.text import shown
from gantryctl.errors import AlarmStop, CommandRefused, GantryctlError
from gantryctl.machine import Machine, short_hash
from gantryctl.operation.opening import bus_lines
from gantryctl.operation.run import AxisRun, Motion, Stop
from gantryctl.operation.store import StateStore
from gantryctl.operation.summary import MotionSummary, summarise
from gantryctl.ports import Recorder
from gantryctl.runtime.recorder import ArrowRecorder, MemoryRecorder
from gantryctl.trace.files import Metadata
from gantryctl.trace.reader import read_trace
from gantryctl.units import DEG_S_PER_R_MIN
from gantryctl.wiring.engine import ProgramFactory
from gantryctl.wiring.program import ramps_deg

TRACES_KEPT: Final = 50
"""Recordings kept in the state directory; older ones are removed. --out keeps everything."""
_STOOD_DEG_S: Final = 0.01  # slower than this it only settled where it already was
Action = Callable[[AxisRun, Callable[[str], None]], Motion]
"""What a command does with an axis that is ready, and where its remarks go."""
_SIGNALS: Final = ("SIGINT", "SIGTERM", "SIGHUP")


def trace_path(store: StateStore | None, out: Path | None, name: str) -> Path | None:
    """Where the recording goes: --out, else the state directory; None without either."""
    if out is None and store is None:
        return None
    folder = directory(out if out is not None else store.traces if store is not None else Path())
    if out is None:
        for old in sorted(folder.glob("*.parquet"), key=lambda p: p.name.split("-")[-1])[: -TRACES_KEPT + 1]:
            old.unlink(missing_ok=True)
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f")[:-3]
    return folder / f"{name}-{stamp}"


def run_axis(
    machine: Machine,
    store: StateStore | None,
    action: Action,
    program: ProgramFactory,
    path: Path | None,
    seed: int,
    *,
    real_time: bool,
    as_json: bool,
) -> int:
    """One power cycle around `action`; prints what happens; the exit code."""

    def recorder(columns: tuple[str, ...]) -> Recorder:
        metadata: Metadata = {
            "machine": machine.name,
            "config_hash": short_hash(machine),
            "version": version("gantryctl"),
            "seed": seed,
            "period_s": machine.control.scan_period_ms * 1e-3,
        }
        return MemoryRecorder(columns, metadata) if path is None else ArrowRecorder(path, columns, metadata)

    live = Display(enabled=not as_json)
    session = AxisRun(
        machine, store, program=program, recorder=recorder, real_time=real_time, observer=live.show
    )
    for note in session.notes:
        live.say(note)
    motion, failure = _guarded(session, action, live)
    live.end()
    return _report(session, motion, failure, as_json)


def _guarded(session: AxisRun, action: Action, live: Display) -> tuple[Motion | None, GantryctlError | None]:
    """The run itself; whatever happens, the axis is left without torque and its state kept."""
    motion: Motion | None = None
    failure: GantryctlError | None = None
    alarm: AlarmStop | None = None
    result = "failed"
    with stop_signals(session):
        try:
            motion = action(session, live.say)
            result = _result(session, motion)
            session.power_down()
        except AlarmStop as stopped:
            failure = alarm = stopped
            result = f"stopped by an alarm: {alarm}"
        except CommandRefused as refused:
            failure, result = refused, f"refused: {refused}"
        finally:
            session.close(result, alarm)
    return motion, failure


def _result(session: AxisRun, motion: Motion) -> str:
    """How a motion without an alarm ended, in words."""
    if motion.done:
        return "done"
    return "stopped by the operator" if session.stop is not Stop.NO else "not in position"


@contextmanager
def stop_signals(session: AxisRun) -> Iterator[None]:
    """Ctrl-C, SIGTERM and a lost terminal stop the axis; a second one is a quick stop."""

    def stop(_: int, __: FrameType | None) -> None:
        session.stop = Stop.RAMP if session.stop is Stop.NO else Stop.QUICK

    known = [getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)]
    before = {number: signal.signal(number, stop) for number in known}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _report(session: AxisRun, motion: Motion | None, failure: GantryctlError | None, as_json: bool) -> int:
    """Summary and exit code."""
    code = failure.exit_code if failure is not None else int(motion is None or not motion.done)
    summary, file = _evaluate(session, motion)
    alarms = [alarm.text for alarm in session.axis.alarms.history]
    if as_json:
        print_json(
            {
                "exit_code": code,
                "machine": session.machine.name,
                "result": _result(session, motion) if failure is None and motion is not None else None,
                "summary": summary.as_dict() if summary is not None else None,
                "settled_s": motion.settled_s if motion is not None else None,
                "notes": list(session.notes),
                "alarms": alarms,
                "error": str(failure) if failure is not None else None,
                "trace": str(file) if file is not None else None,
            }
        )
    else:
        _print(session, motion, failure, summary, alarms, file)
    if session.engine.recording_fault:
        click.echo(f"warning: {session.engine.recording_fault}", err=True)
    if failure is not None:
        click.echo(f"error: {failure}", err=True)
    return code


def _print(
    session: AxisRun,
    motion: Motion | None,
    failure: GantryctlError | None,
    summary: MotionSummary | None,
    alarms: list[str],
    file: Path | None,
) -> None:
    """The summary in words, on standard output."""
    if summary is not None and not isinstance(failure, CommandRefused):
        word = "stopped by an alarm" if motion is None else _result(session, motion)
        for line in _summary_lines(session.machine, summary, motion, word):
            click.echo(line)
    for text in alarms if failure is None else ():
        click.echo(f"note: {text}")
    if session.engine.statistics.lateness.count and summary is not None:
        for line in session.engine.statistics.report(summary.peak_deg_s).splitlines():
            click.echo(f"  {line}")
    for line in bus_lines(session.drive):
        click.echo(f"  bus               {line}")
    if file is not None:
        click.echo(f"  trace             {file}")


def _evaluate(session: AxisRun, motion: Motion | None) -> tuple[MotionSummary | None, Path | None]:
    """The summary, and where the recording is; a recording without a row is thrown away."""
    recorder = session.engine.recorder
    assert isinstance(recorder, MemoryRecorder | ArrowRecorder)
    file = recorder.path if isinstance(recorder, ArrowRecorder) else None
    if not session.engine.scan:
        if file is not None:
            file.unlink(missing_ok=True)
        return None, None
    trace = recorder.trace() if isinstance(recorder, MemoryRecorder) else read_trace(recorder.path)
    begin, end = (motion.from_s, motion.to_s) if motion is not None else (0.0, session.engine.time_s)
    if not len(trace.slice(begin, end)):
        begin, end = 0.0, session.engine.time_s
    return summarise(trace, begin, end, session.machine.axis.ratio), file


def _summary_lines(machine: Machine, s: MotionSummary, motion: Motion | None, word: str) -> Iterator[str]:
    """The end of a motion in words."""
    yield (
        f"{word}: {shown(s.start_deg, 4):.4f} -> {shown(s.end_deg, 4):.4f} deg, {s.duration_s:.2f} s, "
        f"peak {s.peak_deg_s:.2f} deg/s{_speed_hint(machine, s, motion)}"
    )
    load = s.following_error_load_deg
    yield (
        f"  following error   motor side {s.following_error_motor_deg:.5f} deg"
        + (f", load side {load:.5f} deg" if load is not None else "")
    )
    load = s.speed_error_load_deg_s
    yield (
        f"  speed error       motor side {s.speed_error_motor_deg_s:.5f} deg/s"
        + (f", load side {load:.5f} deg/s" if load is not None else "")
    )
    yield f"  largest torque    {s.torque_max_nm:.1f} N m of {machine.motor.torque_max_nm:g} N m"
    if motion is not None and motion.done and motion.settled_s is not None:
        yield f"  in position       {motion.settled_s:.2f} s after the set-point arrived"


def _speed_hint(machine: Machine, s: MotionSummary, motion: Motion | None) -> str:
    """Why a move did not reach the speed that was asked for."""
    if motion is None or not motion.done or motion.asked_deg_s is None:
        return ""
    if s.peak_deg_s >= motion.asked_deg_s * (1.0 - 1e-6) or s.peak_deg_s < _STOOD_DEG_S:
        return ""
    way = ramps_deg(machine, motion.asked_deg_s)
    return f"; {motion.asked_deg_s / DEG_S_PER_R_MIN:g} r/min needs at least {way:.1f} deg"
