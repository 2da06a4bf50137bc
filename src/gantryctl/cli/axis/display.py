"""What a person sees while the axis moves."""

from __future__ import annotations

import os
import shutil
import sys
from contextlib import suppress
from typing import Final

import click

from gantryctl.operation.run import Snapshot

_LOG_EVERY_S: Final = 5.0  # axis time between two lines of a plain log


class Display:
    """A live line on a terminal, a plain log line now and then elsewhere, nothing where JSON is asked for.

    When nobody reads any more (terminal lost, pipe closed), `show` raises: the session then stops the axis. Whatever is
    printed afterwards goes nowhere.
    """

    def __init__(self, *, enabled: bool) -> None:
        self._enabled = enabled
        self._live = enabled and sys.stdout.isatty()
        self._next_s = 0.0
        self._shown = False

    def say(self, text: str) -> None:
        """A remark before the run."""
        if self._enabled:
            click.echo(text)

    def show(self, snapshot: Snapshot) -> None:
        """The state now."""
        if not self._enabled or (not self._live and snapshot.time_s < self._next_s):
            return
        self._next_s = snapshot.time_s + _LOG_EVERY_S
        try:
            if self._live:
                width = shutil.get_terminal_size().columns - 1
                click.echo(f"\r{live_line(snapshot)[:width]:{width}}", nl=False)
            else:
                click.echo(log_line(snapshot))
        except OSError:
            mute()
            raise
        self._shown = True

    def end(self) -> None:
        """Leave the live line."""
        if self._live and self._shown:
            click.echo()


def mute() -> None:
    """Standard output has no reader: what still comes goes nowhere, and nothing complains at the end."""
    with suppress(OSError, ValueError):  # ValueError: standard output is no file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def live_line(s: Snapshot) -> str:
    """Angle, speed, following error, state, time left; fits into 80 columns."""
    left = f"{s.time_left_s:.1f} s left" if s.time_left_s is not None else f"{s.time_s:.1f} s"
    return (
        f"{s.angle_deg:+9.3f} deg  {s.speed_deg_s:+6.2f} deg/s  error {s.following_error_deg:+.5f} deg  "
        f"{s.state:<17}  {left}"
    )


def log_line(s: Snapshot) -> str:
    """The same behind the time, for a file."""
    left = f"{s.time_left_s:5.1f} s left" if s.time_left_s is not None else ""
    return (
        f"{s.time_s:7.1f} s  {s.angle_deg:+10.4f} deg  {s.speed_deg_s:+7.3f} deg/s  "
        f"error {s.following_error_deg:+.5f} deg  {s.state:<17}  {left}"
    ).rstrip()
