"""Figures of a benchmark, and medians of jobs that take turns."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from gantryctl.engineering.report.meter import Watch, nobody


class Figure(NamedTuple):
    """One figure, with its limit where there is one.

    Attributes:
        key: its name in the file of results.
        title: for people.
        unit: "" for a ratio.
    """

    key: str
    title: str
    value: float
    unit: str = ""
    least: float | None = None
    most: float | None = None

    @property
    def met(self) -> bool:
        """Within its limit, or without one; NaN is not."""
        return (self.least is None or self.value >= self.least) and (
            self.most is None or self.value <= self.most
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {**self._asdict(), "met": self.met}


def medians(jobs: Mapping[str, Callable[[], float]], repeats: int, watch: Watch = nobody) -> dict[str, float]:
    """Median of each job, all taking turns: a busy computer slows all of them."""
    values: dict[str, list[float]] = {name: [] for name in jobs}
    for turn in range(repeats):
        for number, (name, job) in enumerate(jobs.items(), 1):
            values[name].append(job())
            watch((turn + number / len(jobs)) / repeats)
    return {name: statistics.median(each) for name, each in values.items()}
