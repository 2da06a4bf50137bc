"""Standard streams of a process that perhaps nobody watches: its terminal is gone, its pipe closed, its disk full."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import TextIO


def tell(text: str) -> None:
    """Write a line to standard error at once; it is lost where nobody can read it.

    For processes that hold an axis or keep a journal: none of them may end for want of a reader.
    """
    # ValueError: it is closed.
    with suppress(OSError, ValueError):
        if sys.stderr is not None:
            sys.stderr.write(f"{text}\n")
            sys.stderr.flush()


def is_terminal(stream: TextIO | None) -> bool:
    """Whether a person sits at it; None is a standard stream that was closed before the start."""
    return stream is not None and stream.isatty()


def mute(stream: TextIO) -> None:
    """Send what still comes on a standard stream to nowhere: it has no reader any more."""
    # ValueError: it is no file. Python writes what it still buffers when it ends, and would complain.
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
