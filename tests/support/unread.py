"""Standard streams whose reader has gone: a lost terminal, a pipe into a program that has ended."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO


@contextmanager
def unread_pipe() -> Iterator[int]:
    """The writing end of a pipe that nobody reads."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        yield writing
    finally:
        os.close(writing)


@contextmanager
def unread_stream() -> Iterator[TextIO]:
    """The same as Python has its standard streams: by lines."""
    with unread_pipe() as pipe:
        stream = os.fdopen(os.dup(pipe), "w", 1, "utf-8")
        try:
            yield stream
        finally:
            # What is still buffered is written once more. Not around the block: that would hide its failures.
            with suppress(BrokenPipeError):
                stream.close()
