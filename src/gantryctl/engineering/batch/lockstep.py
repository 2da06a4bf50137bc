"""Experiments on several plants at once: each is written for one plant, and their runs go through the core together."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Final, TypeAlias, TypeVar

from gantryctl.engineering.batch.loop import ClosedLoop, Leg, Log, log_legs

T = TypeVar("T")
Runner: TypeAlias = Callable[[ClosedLoop, Sequence[Leg], Sequence[str]], Log]
"""Takes one plant through legs and gives these columns of its log."""

# Experiments side by side: two packs of the widest instruction set. A log of six minutes takes 17 MB a plant.
_TOGETHER: Final = 16
# Runs that differ more in length do not go together: the lanes of the shorter ones would stand idle.
_LONGER: Final = 2.0


def alone(loop: ClosedLoop, legs: Sequence[Leg], columns: Sequence[str]) -> Log:
    """Run one plant by itself."""
    return log_legs([loop], legs, columns)[0]


def in_lockstep(experiments: Sequence[Callable[[Runner], T]]) -> list[T | Exception]:
    """Results of experiments, each as it would be alone, bit for bit; an exception in place of the result it prevented.

    Args:
        experiments: each takes the runner by which it moves its plant. Their code runs one at a time.
    """
    found: list[T | Exception] = []
    for first in range(0, len(experiments), _TOGETHER):
        some = experiments[first : first + _TOGETHER]
        found += _outcomes(some) if len(some) > 1 else [outcome(partial(some[0], alone))]
    return found


def expected(outcomes: Sequence[T | Exception]) -> list[T]:
    """The results, where every experiment must have one.

    Raises:
        Exception: what prevented the first that is missing.
    """
    found = []
    for each in outcomes:
        if isinstance(each, Exception):
            raise each
        found.append(each)
    return found


def grouped(outcomes: Sequence[T | Exception], sizes: Sequence[int]) -> list[list[T] | Exception]:
    """Results in groups of these sizes; the first exception of a group in its place."""
    found: list[list[T] | Exception] = []
    left = list(outcomes)
    for size in sizes:
        group, left = left[:size], left[size:]
        found.append(outcome(partial(expected, group)))
    return found


def outcome(experiment: Callable[[], T]) -> T | Exception:
    """What it returns, or the exception that it raises."""
    try:
        return experiment()
    except Exception as fault:
        return fault


def _outcomes(experiments: Sequence[Callable[[Runner], T]]) -> list[T | Exception]:
    meeting = _Meeting(len(experiments))
    found: dict[int, T | Exception] = {}

    def take_part(number: int, experiment: Callable[[Runner], T]) -> None:
        with meeting.present():
            found[number] = outcome(partial(experiment, meeting.run))

    threads = [
        threading.Thread(target=take_part, args=each, name="experiment", daemon=True)
        for each in enumerate(experiments)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [found[number] for number in range(len(experiments))]


class _Order:
    """A run that an experiment waits for, and what came of it."""

    def __init__(self, loop: ClosedLoop, legs: Sequence[Leg], columns: Sequence[str]) -> None:
        self.loop, self.legs, self.columns = loop, legs, tuple(columns)
        self.kind = (self.columns, len(legs), loop.compensation is not None)
        self.duration_s = sum(leg.duration_s for leg in legs)
        self.outcome: Log | Exception | None = None


class _Meeting:
    """Where experiments wait for each other. Everything happens under one lock, so only one of them works at a time."""

    def __init__(self, experiments: int) -> None:
        self._changed = threading.Condition()
        self._at_work = experiments
        self._orders: list[_Order] = []

    @contextmanager
    def present(self) -> Iterator[None]:
        """Take part, until the end of the block."""
        with self._changed:
            try:
                yield
            finally:
                self._at_work -= 1
                self._changed.notify_all()

    def run(self, loop: ClosedLoop, legs: Sequence[Leg], columns: Sequence[str]) -> Log:
        """Wait until everybody waits; then whoever notices does the shortest runs."""
        order = _Order(loop, legs, columns)
        self._orders.append(order)
        while order.outcome is None:
            if len(self._orders) == self._at_work:
                self._run_some()
            else:
                self._changed.wait()
        if isinstance(order.outcome, Exception):
            raise order.outcome
        return order.outcome

    def _run_some(self) -> None:
        """The shortest run, and with it all that are of its kind: who is behind catches up."""
        first = min(self._orders, key=lambda order: order.duration_s)
        chosen = [
            order
            for order in self._orders
            if order.kind == first.kind and order.duration_s <= _LONGER * first.duration_s
        ]
        self._orders = [order for order in self._orders if order not in chosen]
        loops, legs = [order.loop for order in chosen], [order.legs for order in chosen]
        logs = outcome(partial(log_legs, loops, legs, first.columns))
        for k, order in enumerate(chosen):
            order.outcome = logs if isinstance(logs, Exception) else logs[k]
        self._changed.notify_all()
