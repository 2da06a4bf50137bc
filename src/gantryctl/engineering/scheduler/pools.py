"""Workers of this computer: threads, which share the compiled core, or processes, for work that Python itself does."""

from __future__ import annotations

import atexit
import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from typing import Final, NamedTuple, Protocol

from gantryctl.engineering.scheduler.job import Chunk, ChunkResult, Job, compute
from gantryctl.engineering.scheduler.one_thread import one_blas_thread


class Outcome(NamedTuple):
    """End of a chunk; `result` is None for one that was lost with its worker."""

    chunk: Chunk
    result: ChunkResult | None


class Pool(Protocol):
    """Workers that compute chunks of one job."""

    @property
    def slots(self) -> int:
        """Chunks that are computed side by side."""
        ...

    def submit(self, chunk: Chunk) -> None:
        """Have a chunk computed."""
        ...

    def finished(self, timeout_s: float) -> Sequence[Outcome]:
        """Chunks that have ended since the last call, at least one unless the time runs out.

        Raises:
            Exception: what the job raised. DeviceError: there is no worker any more.
        """
        ...

    def withdraw(self) -> Sequence[Chunk]:
        """Take back chunks: all that nobody has begun, and what would have to be waited for over a network."""
        ...

    def close(self) -> None:
        """Let the workers go."""
        ...


class ThreadPool:
    """Threads of this process.

    Args:
        count: number of threads; None for one per processor.
    """

    def __init__(self, job: Job, count: int | None = None) -> None:
        self.slots: Final = count or os.cpu_count() or 1
        self._job = job
        self._pending: dict[Future[ChunkResult], Chunk] = {}
        self._threads = ThreadPoolExecutor(self.slots)
        # Here too, not only around each chunk: OpenBLAS does not take it from another thread once this one has set it.
        self._one_blas_thread = ExitStack()
        self._one_blas_thread.enter_context(one_blas_thread())

    def submit(self, chunk: Chunk) -> None:
        self._pending[self._threads.submit(compute, self._job, chunk)] = chunk

    def finished(self, timeout_s: float) -> list[Outcome]:
        done, _ = wait(self._pending, timeout_s, FIRST_COMPLETED)
        return [Outcome(self._pending.pop(future), future.result()) for future in done]

    def withdraw(self) -> list[Chunk]:
        return _withdrawn(self._pending)

    def close(self) -> None:
        self._threads.shutdown(wait=True, cancel_futures=True)
        self._one_blas_thread.close()


class ProcessPool:
    """Processes of this computer; one that is killed costs its chunks, which are given out anew.

    Args:
        count: number of processes; None for one per processor.
    """

    def __init__(self, job: Job, count: int | None = None) -> None:
        self.slots: Final = count or os.cpu_count() or 1
        self._job = job
        self._pending: dict[Future[ChunkResult], Chunk] = {}
        self._lost: list[Chunk] = []
        self._processes = self._start()

    def submit(self, chunk: Chunk) -> None:
        try:
            self._pending[self._processes.submit(_compute_here, chunk)] = chunk
        except BrokenProcessPool:
            self._lost.append(chunk)

    def finished(self, timeout_s: float) -> list[Outcome]:
        done, _ = wait(self._pending, 0.0 if self._lost else timeout_s, FIRST_COMPLETED)
        found = []
        for future in done:
            chunk = self._pending.pop(future)
            try:
                found.append(Outcome(chunk, future.result()))
            except BrokenProcessPool:
                self._lost.append(chunk)
        if self._lost:
            # A pool whose worker was killed takes nothing any more: all that it has not ended is lost with it.
            self._lost += self._pending.values()
            self._pending.clear()
            self._processes.shutdown(wait=False, cancel_futures=True)
            self._processes = self._start()
            found += [Outcome(chunk, None) for chunk in self._lost]
            self._lost.clear()
        return found

    def withdraw(self) -> list[Chunk]:
        return _withdrawn(self._pending)

    def close(self) -> None:
        self._processes.shutdown(wait=True, cancel_futures=True)

    def _start(self) -> Executor:
        # A fork would copy locks that other threads hold: matplotlib, pyarrow and numpy have some.
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.slots, context, _begin, (self._job,))


def _withdrawn(pending: dict[Future[ChunkResult], Chunk]) -> list[Chunk]:
    taken = [future for future in pending if future.cancel()]
    return [pending.pop(future) for future in taken]


_JOB: list[Job] = []


def _begin(job: Job) -> None:
    # Ctrl-C of a terminal reaches every process of its group; the parent decides what it means.
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # What that thread still holds at the end would be told as leaks of compiled modules.
    atexit.register(os._exit, 0)
    _JOB[:] = [job]


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        # A parent that was killed tells nobody; without this its workers would wait for work without end.
        os._exit(1)


def _compute_here(chunk: Chunk) -> ChunkResult:
    return compute(_JOB[0], chunk)
