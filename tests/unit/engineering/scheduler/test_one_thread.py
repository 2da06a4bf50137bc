"""Linear algebra on one thread while a chunk is computed, and as it was afterwards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from gantryctl.engineering.scheduler.job import Chunk, Rows, compute
from gantryctl.engineering.scheduler.one_thread import one_blas_thread
from gantryctl.engineering.scheduler.schedule import all_rows


def blas_threads() -> set[int]:
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


@dataclass(frozen=True)
class Fits:
    """Row k solves a least-squares problem that two threads would solve with other last bits."""

    pack: ClassVar[int] = 1

    def rows(self, first: int, count: int) -> Rows:
        found = []
        for row in range(first, first + count):
            rng = np.random.default_rng(row)
            matrix, wanted = rng.normal(size=(20_000, 33)), rng.normal(size=20_000)
            found.append(float(np.linalg.lstsq(matrix, wanted, rcond=None)[0][0]))
        return {"fit": np.array(found), "threads": np.full(count, max(blas_threads()))}


def test_a_row_is_the_same_with_however_many_threads_the_process_had() -> None:
    with threadpool_limits(2, "blas"):
        two = compute(Fits(), Chunk(0, 1)).rows
        assert blas_threads() == {2}
    with threadpool_limits(1, "blas"):
        one = Fits().rows(0, 1)
    assert two["fit"].tobytes() == one["fit"].tobytes()
    assert set(two["threads"]) == {1}


def test_chunks_side_by_side_keep_it_until_the_last_is_done() -> None:
    with threadpool_limits(2, "blas"):
        assert set(all_rows(Fits(), 2, 2)["threads"]) == {1}
        assert blas_threads() == {2}
        with one_blas_thread():
            with one_blas_thread():
                assert blas_threads() == {1}
            assert blas_threads() == {1}
        assert blas_threads() == {2}
