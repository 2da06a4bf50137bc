"""Order statistics against sorting, for distributions that a selection by leading bits may stumble over."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from gantryctl.engineering.campaign import order_statistics as module
from gantryctl.engineering.campaign.order_statistics import order_statistics

RNG = np.random.default_rng(5)
TINY = np.nextafter(1.0, 2.0)

SAMPLES = {
    "normal": RNG.normal(size=20_000),
    "narrow": 1.0 + 1e-14 * RNG.normal(size=20_000),
    "two values": RNG.choice([0.0, 1.0], 20_000),
    "one value": np.full(20_000, -3.5),
    "neighbours": RNG.choice([1.0, TINY, -1.0, -TINY], 20_000),
    "all scales": RNG.choice([-1.0, 1.0], 20_000) * 10.0 ** RNG.uniform(-300, 300, 20_000),
    "ends": np.array([np.finfo(float).max, -np.finfo(float).max, 5e-324, -5e-324, 0.0] * 4000),
}


def in_batches(values: np.ndarray) -> Callable[[], Iterator[np.ndarray]]:
    return lambda: iter(np.array_split(values, 7))


@pytest.mark.parametrize("kept", [20_000, 100])
@pytest.mark.parametrize("name", SAMPLES)
def test_they_are_what_sorting_gives(name: str, kept: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_KEPT", kept)
    values = SAMPLES[name]
    ranks = [19_999, 0, 1, 500, 10_000, 10_000, 7, 13_333]
    found = order_statistics(in_batches(values), len(values), ranks)
    assert found.tolist() == np.sort(values)[ranks].tolist()


def test_memory_does_not_grow_with_the_values() -> None:
    """Ten times the values, the same memory; both are far more than are kept."""

    def peak(count: int) -> int:
        def values() -> Iterator[np.ndarray]:
            for first in range(0, count, 2**16):
                yield np.random.default_rng(first).normal(size=min(2**16, count - first))

        tracemalloc.start()
        order_statistics(values, count, [0, count // 4, count // 2, count - 1])
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    small, large = peak(400_000), peak(4_000_000)
    assert large < 1.2 * small, (small, large)
