"""Motion on a terminal: live line, summary at the end, or JSON."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import click

from gantryctl.cli.options import print_json
from gantryctl.errors import CommandRefused, GantryctlError
from gantryctl.machine import Machine
from gantryctl.operation.client import MotionReport, Snapshot
from gantryctl.terminal import is_terminal, mute, tell
from gantryctl.units import DEG_S_PER_R_MIN, Dial
from gantryctl.wiring.program import ramps_deg

if TYPE_CHECKING:
    from gantryctl.operation.summary import MotionSummary

# Axis time between two lines of a plain log.
_LOG_EVERY_S: Final = 5.0
# Slower than this it only settled where it already was.
_STOOD_DEG_S: Final = 0.01


class RunDetails(NamedTuple):
    """Part of the report that only a run in this process has; the service keeps journal and recordings itself.

    Attributes:
        alarms: texts of alarms and notes, oldest first.
        lines: timing and bus, for a terminal.
        trace: the recording. recording_fault: why it ended early, or "".
    """

    summary: MotionSummary | None = None
    notes: tuple[str, ...] = ()
    alarms: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()
    trace: Path | None = None
    recording_fault: str = ""


_NO_DETAILS: Final = RunDetails()


def print_motion(
    machine: Machine,
    report: MotionReport | None,
    failure: GantryctlError | None,
    details: RunDetails = _NO_DETAILS,
    *,
    as_json: bool,
) -> int:
    """Print how a motion ended; the exit code."""
    # Exit code 1 for a motion that did not reach its end, though nothing was wrong: a script must notice.
    code = failure.exit_code if failure is not None else int(report is None or not report.done)
    if as_json:
        print_json(
            {
                "exit_code": code,
                "machine": machine.name,
                "result": report.text if failure is None and report is not None else None,
                "start_deg": report.start_deg if report is not None else None,
                "end_deg": report.end_deg if report is not None else None,
                "summary": details.summary.as_dict() if details.summary is not None else None,
                "settled_s": report.settled_s if report is not None else None,
                "notes": list(details.notes),
                "alarms": list(details.alarms),
                "error": str(failure) if failure is not None else None,
                "trace": str(details.trace) if details.trace is not None else None,
            }
        )
    else:
        if not isinstance(failure, CommandRefused):
            for line in _motion_lines(machine, report, details.summary):
                click.echo(line)
        for text in details.alarms if failure is None else ():
            click.echo(f"note: {text}")
        for line in details.lines:
            click.echo(f"  {line}")
        if details.trace is not None:
            click.echo(f"  trace             {details.trace}")
    if details.recording_fault:
        tell(f"warning: {details.recording_fault}")
    if failure is not None:
        tell(f"error: {failure}")
    return code


def _motion_lines(machine: Machine, report: MotionReport | None, s: MotionSummary | None) -> Iterator[str]:
    """Describe the end of a motion."""
    word = "stopped by an alarm" if report is None else report.text
    if s is None:
        if report is not None:
            begin, end = (
                machine.axis.dial.text(angle, ".4f") for angle in (report.start_deg, report.end_deg)
            )
            yield f"{word}: {begin} -> {end} deg"
        return
    read = machine.axis.dial.text
    end = "an angle that is not known" if s.end_deg is None else f"{read(s.end_deg, '.4f')} deg"
    yield (
        f"{word}: {read(s.start_deg, '.4f')} -> {end}, {s.duration_s:.2f} s, "
        f"peak {s.peak_deg_s:.2f} deg/s{_speed_hint(machine, s, report)}"
    )
    # The load side is what the paper judges; only a simulator knows it without an instrument.
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
    if report is not None and report.done and report.settled_s is not None:
        yield f"  in position       {report.settled_s:.2f} s after the set-point arrived"


def _speed_hint(machine: Machine, s: MotionSummary, report: MotionReport | None) -> str:
    """Why a move did not reach the speed that was asked for; "" where it did."""
    if report is None or not report.done or report.asked_deg_s is None:
        return ""
    if s.peak_deg_s >= report.asked_deg_s * (1.0 - 1e-6) or s.peak_deg_s < _STOOD_DEG_S:
        return ""
    way = ramps_deg(machine, report.asked_deg_s)
    return f"; {report.asked_deg_s / DEG_S_PER_R_MIN:g} r/min needs at least {way:.1f} deg"


class Display:
    """A live line on a terminal, a plain log line now and then elsewhere, nothing where JSON is asked for.

    Args:
        log_every_s: time of the axis between two lines of a log.

    Without a reader (terminal lost, pipe closed) `show` raises, and the run stops the axis.
    """

    def __init__(self, machine: Machine, *, enabled: bool, log_every_s: float = _LOG_EVERY_S) -> None:
        self._machine, self._enabled, self._log_every_s = machine, enabled, log_every_s
        self._live = enabled and is_terminal(sys.stdout)
        self._next_s = 0.0
        self._shown = False

    def say(self, text: str) -> None:
        """Print a remark before the run."""
        if self._enabled:
            click.echo(text)

    def show(self, snapshot: Snapshot) -> None:
        """Show the present state."""
        # A plain log (a file, a pipe) gets a line now and then, a terminal one that is written over. The time of a
        # service begins anew with its controller.
        waits = self._next_s - self._log_every_s <= snapshot.time_s < self._next_s
        if not self._enabled or (not self._live and waits):
            return
        self._next_s = snapshot.time_s + self._log_every_s
        dial = self._machine.axis.dial
        try:
            if self._live:
                # One column less than there are: the last one makes some terminals begin a new line.
                width = shutil.get_terminal_size().columns - 1
                click.echo(f"\r{live_line(snapshot, dial)[:width]:{width}}", nl=False)
            else:
                click.echo(log_line(snapshot, dial))
        except OSError:
            mute(sys.stdout)
            raise
        self._shown = True

    def end(self) -> None:
        """Leave the live line."""
        if self._live and self._shown:
            click.echo()


def live_line(s: Snapshot, dial: Dial) -> str:
    """Angle, speed, following error, state, time left; fits into 80 columns."""
    left = f"{s.time_left_s:.1f} s left" if s.time_left_s is not None else f"{s.time_s:.1f} s"
    return (
        f"{_angle(s.angle_deg, dial, 9, 3)} deg  {_known(s.speed_deg_s, 6, 2)} deg/s  "
        f"error {s.following_error_deg:+.5f} deg  {s.state:<17}  {left}"
    )


def _known(value: float | None, width: int, digits: int) -> str:
    """A number of the line, or a question mark where its reading is not believed."""
    return f"{'?':>{width}}" if value is None else f"{value:+{width}.{digits}f}"


def _angle(value: float | None, dial: Dial, width: int, digits: int) -> str:
    """The angle as people read it, with a sign where angles have one."""
    if value is None:
        return _known(None, width, digits)
    sign = "+" if dial.begin_deg is None or dial.begin_deg < 0.0 else ""
    return f"{dial.text(value, f'{sign}.{digits}f'):>{width}}"


def log_line(s: Snapshot, dial: Dial) -> str:
    """The same behind the time, for a file."""
    left = f"{s.time_left_s:5.1f} s left" if s.time_left_s is not None else ""
    return (
        f"{s.time_s:7.1f} s  {_angle(s.angle_deg, dial, 10, 4)} deg  {_known(s.speed_deg_s, 7, 3)} deg/s  "
        f"error {s.following_error_deg:+.5f} deg  {s.state:<17}  {left}"
    ).rstrip()
