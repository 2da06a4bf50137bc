"""Each row once, whatever happens to the workers."""

from __future__ import annotations

import random
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.engineering.scheduler.job import Chunk, ChunkResult, Job, collected, compute
from gantryctl.engineering.scheduler.pools import Outcome, Pool, ProcessPool, ThreadPool
from gantryctl.engineering.scheduler.schedule import CHUNK_MAX_S, CHUNK_MIN_S, all_rows, run_job
from gantryctl.errors import DeviceError
from support.jobs import Fails, KillsItsWorker, Squares


class Unsteady:
    """A pool that ends chunks in any order, loses some, and says how long a row takes."""

    def __init__(self, job: Job, slots: int, seed: int, row_s: float, lose: float) -> None:
        self.slots = slots
        self.sizes: list[int] = []
        self.most = 0
        self._job, self._row_s, self._lose, self._rng = job, row_s, lose, random.Random(seed)
        self._pending: list[Chunk] = []

    def submit(self, chunk: Chunk) -> None:
        self.sizes.append(chunk.size)
        self._pending.append(chunk)
        self.most = max(self.most, len(self._pending))

    def finished(self, timeout_s: float) -> list[Outcome]:
        chunk = self._pending.pop(self._rng.randrange(len(self._pending)))
        if self._rng.random() < self._lose:
            return [Outcome(chunk, None)]
        return [
            Outcome(chunk, ChunkResult(self._job.rows(*chunk), self._row_s * chunk.size)),
        ]

    def withdraw(self) -> list[Chunk]:
        taken, self._pending = self._pending, []
        return taken

    def close(self) -> None:
        pass


def ranges(ends: Sequence[int]) -> list[Chunk]:
    """Ranges between every second pair of ends."""
    points = sorted(set(ends))
    return [Chunk(a, b - a) for a, b in zip(points[::2], points[1::2], strict=False)]


@given(
    st.lists(st.integers(0, 3000), min_size=2, max_size=12, unique=True),
    st.integers(1, 9),
    st.integers(0, 999),
    st.sampled_from([1e-6, 0.01, 0.3, 40.0]),
)
def test_every_missing_row_comes_once_and_no_other(
    ends: list[int], slots: int, seed: int, row_s: float
) -> None:
    missing = ranges(ends)
    wanted = np.concatenate([np.arange(c.first, c.last + 1) for c in missing])
    # Eight losses of the same rows end a run: 1e-8 a chunk.
    pool = Unsteady(Squares(), slots, seed, row_s, 0.1)
    found = collected(run_job(missing, pool))
    assert np.array_equal(found["index"], wanted)
    assert np.array_equal(found["square"], wanted.astype(float) ** 2)
    assert pool.most <= 2 * slots


def test_chunks_are_a_second_to_five_minutes_of_work() -> None:
    for row_s, rows in ((0.001, 50_000), (0.1, 2000), (0.1, 10_000_000)):
        pool = Unsteady(Squares(), 2, 1, row_s, 0.0)
        for number, _ in enumerate(run_job([Chunk(0, rows)], pool, 16)):
            if number == 200:
                break
        assert all(size % 16 == 0 for size in pool.sizes[:-2])
        # Packs of 16 are whole.
        longest = max(pool.sizes) * row_s
        assert CHUNK_MIN_S - 16 * row_s <= longest <= CHUNK_MAX_S
        assert (longest > 0.9 * CHUNK_MAX_S) == (rows == 10_000_000)


def test_a_run_begins_with_one_pack_for_each_slot() -> None:
    """Nobody knows how long a row takes: chunks of less than a second are no more than there are slots."""
    pool = Unsteady(Squares(), 3, 1, 0.01, 0.0)
    list(run_job([Chunk(0, 5000)], pool, 16))
    assert pool.sizes[:3] == [16, 16, 16]
    assert min(pool.sizes[3:-1]) * 0.01 >= CHUNK_MIN_S - 16 * 0.01


def test_a_short_run_of_long_packs_has_work_for_everybody() -> None:
    pool = Unsteady(Squares(), 2, 1, 5.0, 0.0)
    list(run_job([Chunk(0, 10)], pool, 8))
    assert pool.sizes == [5, 5]


@pytest.mark.parametrize("pool_of", [ThreadPool, ProcessPool])
def test_threads_and_processes_give_the_same_rows(pool_of: type[ThreadPool] | type[ProcessPool]) -> None:
    pool: Pool = pool_of(Squares(0.001), 2)
    try:
        found = collected(run_job([Chunk(7, 300)], pool))
    finally:
        pool.close()
    alone = Squares().rows(7, 300)
    assert all(np.array_equal(found[name], alone[name]) for name in alone)


def test_a_killed_process_costs_its_chunk_once(tmp_path: Path) -> None:
    pool = ProcessPool(KillsItsWorker(40, tmp_path / "killed"), 2)
    try:
        found = collected(run_job([Chunk(0, 100)], pool))
    finally:
        pool.close()
    assert (tmp_path / "killed").exists()
    assert np.array_equal(found["index"], np.arange(100))


def test_a_row_that_always_kills_its_worker_is_named() -> None:
    class Cursed(Unsteady):
        def finished(self, timeout_s: float) -> list[Outcome]:
            chunk = self._pending.pop(0)
            return [Outcome(chunk, None if chunk.first == 0 else compute(self._job, chunk) and None)]

    with pytest.raises(DeviceError, match="rows 0 to 1 were lost"):
        list(run_job([Chunk(0, 10)], Cursed(Squares(), 2, 1, 0.1, 0.0), 2))


def test_what_a_job_raises_ends_the_run() -> None:
    for pool_of in (ThreadPool, ProcessPool):
        pool: Pool = pool_of(Fails(5), 2)
        with pytest.raises(ValueError, match="row 5"):
            list(run_job([Chunk(0, 20)], pool))
        pool.close()


def test_a_stop_ends_what_is_under_way_and_begins_nothing() -> None:
    pool = ThreadPool(Squares(0.01), 2)
    found: list[Chunk] = []
    for chunk, _ in run_job([Chunk(0, 1000)], pool, stopped=lambda: len(found) >= 3):
        found.append(chunk)
    pool.close()
    assert 3 <= len(found) <= 3 + 2 * pool.slots
    rows = [row for chunk in found for row in range(chunk.first, chunk.last + 1)]
    assert len(rows) == len(set(rows)) < 1000


def test_all_rows_are_in_order_and_progress_is_told() -> None:
    told: list[int] = []
    found = all_rows(Squares(), 50, 2, told.append)
    assert np.array_equal(found["index"], np.arange(50))
    assert told == sorted(told)
    assert told[-1] == 50


def test_workers_work_side_by_side() -> None:
    """Twenty rows of 0.1 s on four threads: well below the two seconds of one."""
    begun = time.monotonic()
    all_rows(Squares(0.1), 20, 4)
    assert time.monotonic() - begun < 1.6
