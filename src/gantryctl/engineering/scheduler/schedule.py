"""Chunks of a job handed to a pool until every row is there."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from gantryctl.engineering.scheduler.job import Chunk, Job, Rows, collected
from gantryctl.engineering.scheduler.pools import Pool, ThreadPool
from gantryctl.errors import DeviceError

# Handing out a chunk costs some milliseconds on a cluster (1.6 ms a task).
CHUNK_MIN_S: Final = 1.0
# What a killed worker loses at most, and only in runs of many hours: shorter ones are cut finer.
CHUNK_MAX_S: Final = 300.0
# A long run is cut into so many chunks for each worker: few enough for their files, enough to end together.
_PARTS: Final = 100
# A row that takes its worker with it each time would be tried without end.
_LOST_MAX: Final = 8
_POLL_S: Final = 0.5


class _Backlog:
    """Rows that nobody has been given yet, and how many of them make a chunk."""

    def __init__(self, missing: Iterable[Chunk], slots: int, pack: int) -> None:
        self._ranges = deque(missing)
        self.rows = sum(each.size for each in self._ranges)
        # A short run still has work for everybody.
        self._pack = max(1, min(pack, math.ceil(self.rows / slots)))
        self._row_s: float | None = None

    def measured(self, count: int, elapsed_s: float) -> None:
        """So many rows took a worker so long."""
        row_s = elapsed_s / count
        # The first chunks pay for imports and caches: what is faster counts at once, what is slower by half.
        known_s = row_s if self._row_s is None else self._row_s
        self._row_s = 0.5 * (known_s + row_s) if row_s > known_s else row_s

    @property
    def chunks_per_slot(self) -> int:
        """One chunk waits for each slot, so that no worker waits for the client; before a row is measured none does."""
        return 1 if self._row_s is None else 2

    def put_back(self, chunk: Chunk) -> None:
        """These rows are still missing."""
        self._ranges.appendleft(chunk)
        self.rows += chunk.size

    def take(self, slots: int) -> Chunk:
        """The next chunk."""
        whole = self._ranges.popleft()
        count = min(whole.size, self._size(slots))
        if count < whole.size:
            self._ranges.appendleft(Chunk(whole.first + count, whole.size - count))
        self.rows -= count
        return Chunk(whole.first, count)

    def _size(self, slots: int) -> int:
        if self._row_s is None:
            return self._pack
        ahead_s = self._row_s * self.rows / slots
        target_s = min(max(ahead_s / _PARTS, CHUNK_MIN_S), CHUNK_MAX_S)
        size = round(target_s / max(self._row_s, 1e-9))
        return max(1, size // self._pack) * self._pack


def run_job(
    missing: Iterable[Chunk], pool: Pool, pack: int = 1, stopped: Callable[[], bool] = lambda: False
) -> Iterator[tuple[Chunk, Rows]]:
    """Every missing row once, in any order; a pack for each slot, then chunks of a second to five minutes.

    Args:
        missing: ranges of rows, apart from each other.
        pack: rows that are best computed together; chunks are whole multiples.
        stopped: asked between chunks; when true, chunks that are being computed are still ended and given.

    Raises:
        DeviceError: rows that were lost with their worker again and again, or no worker is left.
    """
    backlog = _Backlog(missing, pool.slots, pack)
    lost: Counter[int] = Counter()
    under_way = 0
    while under_way or (backlog.rows and not stopped()):
        while backlog.rows and under_way < backlog.chunks_per_slot * pool.slots and not stopped():
            pool.submit(backlog.take(pool.slots))
            under_way += 1
        if stopped():
            under_way -= len(pool.withdraw())
        for chunk, result in pool.finished(_POLL_S) if under_way else ():
            under_way -= 1
            if result is None:
                lost[chunk.first] += 1
                if lost[chunk.first] == _LOST_MAX:
                    raise DeviceError(
                        f"rows {chunk.first} to {chunk.last} were lost with their worker {_LOST_MAX} times: they may "
                        "need more memory than it has; what is done is kept, with fewer workers the run goes on"
                    )
                backlog.put_back(chunk)
            else:
                backlog.measured(chunk.size, result.elapsed_s)
                yield chunk, result.rows


def all_rows(
    job: Job, count: int, threads: int | None = None, progress: Callable[[int], None] | None = None
) -> Rows:
    """Rows 0 to `count - 1` of a job, by threads of this process.

    Args:
        threads: None for one per processor; no effect on the result.
        progress: called with the number of rows that are done.
    """
    pool = ThreadPool(job, threads)
    parts: list[tuple[Chunk, Rows]] = []
    done = 0
    try:
        for part in run_job([Chunk(0, count)], pool, job.pack):
            parts.append(part)
            done += part[0].size
            if progress is not None:
                progress(done)
    finally:
        pool.close()
    return collected(parts)
