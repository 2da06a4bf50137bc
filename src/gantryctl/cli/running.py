"""Runs an axis for a command line: signals, live line, recording, summary."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from types import FrameType
from typing import Any, Final

import click

from gantryctl.cli.options import directory, print_json
from gantryctl.errors import AlarmStop, CommandRefused, GantryctlError
from gantryctl.machine import Machine, short_hash
from gantryctl.operation import (
    AxisSession,
    Motion,
    MotionSummary,
    ProgramFactory,
    Snapshot,
    StateStore,
    Stop,
    summarise,
)
from gantryctl.ports import Recorder
from gantryctl.runtime import ArrowRecorder, MemoryRecorder
from gantryctl.trace import Metadata, read_trace
from gantryctl.units import DEG_S_PER_R_MIN
from gantryctl.wiring import ramps_deg, total_ratio

TRACES_KEPT: Final = 50
"""Recordings kept in the state directory; older ones are removed. --out keeps everything."""
_LOG_EVERY_S: Final = 5.0  # axis time between two lines of a plain log
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
    action: Callable[[AxisSession], Motion],
    program: ProgramFactory,
    path: Path | None,
    seed: int,
    *,
    real_time: bool,
    as_json: bool,
) -> int:
    """One power cycle around `action`; prints what happens; the exit code."""
    recorders: list[Recorder] = []

    def recorder(columns: tuple[str, ...]) -> Recorder:
        metadata: Metadata = {
            "machine": machine.name,
            "config_hash": short_hash(machine),
            "version": version("gantryctl"),
            "seed": seed,
            "period_s": machine.control.scan_period_ms * 1e-3,
        }
        made = MemoryRecorder(columns, metadata) if path is None else ArrowRecorder(path, columns, metadata)
        recorders.append(made)
        return made

    live = Display(enabled=not as_json)
    session = AxisSession(
        machine, store, program=program, recorder=recorder, real_time=real_time, observer=live.show
    )
    for note in session.notes:
        live.say(note)
    motion, failure = _guarded(session, action)
    live.end()
    return _report(session, motion, failure, recorders[0], as_json)


def _guarded(
    session: AxisSession, action: Callable[[AxisSession], Motion]
) -> tuple[Motion | None, GantryctlError | None]:
    """The run itself; whatever happens, the axis is left without torque and its state kept."""
    motion: Motion | None = None
    failure: GantryctlError | None = None
    result = "failed"
    with _stop_signals(session):
        try:
            session.power_up()
            motion = action(session)
            result = "done" if motion.done else "stopped by the operator"
            session.power_down()
        except AlarmStop as alarm:
            failure, result = alarm, f"stopped by an alarm: {alarm}"
        except CommandRefused as refused:
            failure, result = refused, f"refused: {refused}"
        finally:
            session.close(result)
    return motion, failure


@contextmanager
def _stop_signals(session: AxisSession) -> Iterator[None]:
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


class Display:
    """A live line on a terminal, a plain log line now and then elsewhere."""

    def __init__(self, *, enabled: bool) -> None:
        self._enabled = enabled
        self._live = enabled and sys.stdout.isatty()
        self._next_s = 0.0
        self._shown = False

    def say(self, text: str) -> None:
        """A remark before the run."""
        if self._enabled:
            click.echo(text)

    def show(self, s: Snapshot) -> None:
        """The state now."""
        if not self._enabled or (not self._live and s.time_s < self._next_s):
            return
        left = f"{s.time_left_s:6.1f} s left" if s.time_left_s is not None else ""
        line = (
            f"{s.time_s:8.1f} s  {s.angle_deg:+9.4f} deg  {s.speed_deg_s:+7.3f} deg/s  "
            f"error {s.following_error_deg * 1e3:+7.3f} mdeg  {s.state:<17} {left:<13}"
        )
        self._next_s = s.time_s + _LOG_EVERY_S
        click.echo(f"\r{line}" if self._live else line, nl=not self._live)
        self._shown = True

    def end(self) -> None:
        """Leave the live line."""
        if self._live and self._shown:
            click.echo()


def _report(
    session: AxisSession,
    motion: Motion | None,
    failure: GantryctlError | None,
    recorder: Recorder,
    as_json: bool,
) -> int:
    """Summary and exit code."""
    code = failure.exit_code if failure is not None else int(motion is None or not motion.done)
    trace = recorder.trace() if isinstance(recorder, MemoryRecorder) else read_trace(_path(recorder))
    begin, end = (motion.from_s, motion.to_s) if motion is not None else (0.0, session.engine.time_s)
    summary = summarise(trace, begin, end, total_ratio(session.machine))
    alarms = [alarm.text for alarm in session.axis.alarms.history]
    if as_json:
        print_json(
            {
                "exit_code": code,
                "machine": session.machine.name,
                "summary": summary.as_dict(),
                "settled_s": motion.settled_s if motion is not None else None,
                "alarms": alarms,
                "error": str(failure) if failure is not None else None,
                "trace": None if isinstance(recorder, MemoryRecorder) else str(_path(recorder)),
            }
        )
        return code
    if not isinstance(failure, CommandRefused):
        for line in _summary_lines(session.machine, summary, motion):
            click.echo(line)
    for text in alarms if failure is None else ():
        click.echo(f"note: {text}")
    if session.engine.statistics.lateness.count:
        for line in session.engine.statistics.report(summary.peak_deg_s).splitlines():
            click.echo(f"  {line}")
    if session.engine.recording_fault:
        click.echo(f"warning: {session.engine.recording_fault}", err=True)
    if not isinstance(recorder, MemoryRecorder) and not isinstance(failure, CommandRefused):
        click.echo(f"  trace             {_path(recorder)}")
    if failure is not None:
        click.echo(f"error: {failure}", err=True)
    return code


def _path(recorder: Any) -> Path:
    path: Path = recorder.path
    return path


def _summary_lines(machine: Machine, s: MotionSummary, motion: Motion | None) -> Iterator[str]:
    """The end of a motion in words."""
    done = motion is not None and motion.done
    hint = ""
    if motion is not None and done and s.peak_deg_s < motion.asked_deg_s * (1.0 - 1e-6):
        asked, way = motion.asked_deg_s / DEG_S_PER_R_MIN, ramps_deg(machine, motion.asked_deg_s)
        hint = f"; {asked:g} r/min needs at least {way:.1f} deg"
    yield (
        f"{'done' if done else 'stopped'}: {s.start_deg:.4f} -> {s.end_deg:.4f} deg, {s.duration_s:.2f} s, "
        f"peak {s.peak_deg_s:.2f} deg/s{hint}"
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
    if motion is not None and done:
        yield f"  in position       {motion.settled_s:.2f} s after the set-point arrived"
