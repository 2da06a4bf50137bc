"""A job: many rows of figures, each a pure function of its number."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.scheduler.one_thread import one_blas_thread

Rows: TypeAlias = "dict[str, NDArray[Any]]"
"""Columns by name, each of shape (rows,), in the order of the row numbers."""


class Job(Protocol):
    """What is computed; it travels to other processes and computers by pickle.

    `rows` may use nothing but the job itself and the numbers of the rows: the same number gives the same row bit for
    bit, in whatever range it is asked for, on whatever thread, process or computer.
    """

    @property
    def pack(self) -> int:
        """Rows that cost little more together than one alone; 1 where there is no such number."""
        ...

    def rows(self, first: int, count: int) -> Rows:
        """Rows `first` to `first + count - 1`."""
        ...


class Chunk(NamedTuple):
    """Rows that are computed at once, `first` to `first + size - 1`."""

    first: int
    size: int

    @property
    def last(self) -> int:
        """Number of the last row."""
        return self.first + self.size - 1


class ChunkResult(NamedTuple):
    """Rows of a chunk, and how long the worker took, s."""

    rows: Rows
    elapsed_s: float


def compute(job: Job, chunk: Chunk) -> ChunkResult:
    """Compute a chunk where this is called."""
    begun = time.perf_counter()
    with one_blas_thread():
        rows = job.rows(*chunk)
    return ChunkResult(rows, time.perf_counter() - begun)


def collected(parts: Iterable[tuple[Chunk, Rows]]) -> Rows:
    """Chunks in any order as one table in the order of the rows."""
    ordered = [rows for _, rows in sorted(parts, key=lambda part: part[0])]
    return {name: np.concatenate([rows[name] for rows in ordered]) for name in ordered[0]}
