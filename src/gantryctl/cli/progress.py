"""Progress of a command that takes its time: percent and time left, on a terminal alone."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from gantryctl.terminal import is_terminal

if TYPE_CHECKING:
    from gantryctl.engineering.report.meter import Meter


@contextmanager
def metered(expected: float, *, quiet: bool = False) -> Iterator[Meter]:
    """A meter that writes over one line of standard error, where that is a terminal, and leaves no line behind.

    Args:
        expected: how much work it is, about. quiet: say nothing, for --json.
    """
    from gantryctl.engineering.report.meter import Meter

    # Nobody reads a line that is written over in a log, and what a script reads is the result alone.
    live = not quiet and is_terminal(sys.stderr)
    said = False

    def say(text: str) -> None:
        nonlocal said
        if live:
            # One column less than there are: the last one makes some terminals begin a new line.
            width = shutil.get_terminal_size().columns - 1
            click.echo(f"\r{text[:width]:{width}}", nl=False, err=True)
            said = True

    try:
        yield Meter(say, expected, time.monotonic)
    finally:
        if said:
            width = shutil.get_terminal_size().columns - 1
            click.echo(f"\r{'':{width}}\r", nl=False, err=True)
