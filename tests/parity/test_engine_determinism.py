"""The same run gives the same rows, whenever and at whatever pace it is made."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.machine import default_machine
from gantryctl.operation.scripting import move
from gantryctl.runtime import FixedOperator, RealClock
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.trace.table import Trace
from gantryctl.units import rad
from gantryctl.wiring.engine import build_engine


def run(clock: RealClock | None, seconds: float = 2.0) -> Trace:
    """Power up and begin a move."""
    engine = build_engine(default_machine(), recorder=MemoryRecorder)
    recorder = engine.recorder
    assert isinstance(recorder, MemoryRecorder)
    if clock is not None:
        engine.clock = clock
    assert isinstance(engine.operator, FixedOperator)
    engine.operator.command = engine.operator.command._replace(power=True)
    engine.run_for(0.8)
    engine.operator.command = engine.operator.command._replace(
        move=True, target_rad=rad(2.0), speed_rad_s=rad(3.0)
    )
    engine.run_for(seconds - 0.8)
    return recorder.trace()


class FakeTime:
    """A monotonic clock that jumps: sleeps are inexact, and now and then a scan takes long."""

    def __init__(self, jitter_s: list[float]) -> None:
        self.now_s = 100.0
        self._jitter_s = jitter_s
        self._calls = 0

    def now(self) -> float:
        self._calls += 1
        self.now_s += self._jitter_s[self._calls % len(self._jitter_s)]
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


def test_the_same_run_twice_has_the_same_hash() -> None:
    first, second = (move(default_machine(), 1.0).trace for _ in range(2))
    assert first.hash() == second.hash()
    assert first.hash() != move(default_machine(), 1.1).trace.hash()


@settings(max_examples=6)
@given(st.lists(st.floats(0.0, 4e-3), min_size=1, max_size=7))
def test_real_time_gives_the_rows_of_virtual_time(jitter_s: list[float]) -> None:
    fake = FakeTime(jitter_s)
    paced = run(RealClock(1e-3, fake.now, fake.sleep))
    virtual = run(None)
    assert paced.columns == virtual.columns
    assert virtual["vel_ref_rad_s"].max() > 0.0
    for column in virtual.columns:
        assert np.array_equal(paced[column], virtual[column]), column


def test_real_time_really_takes_its_time() -> None:
    fake = FakeTime([0.0])
    run(RealClock(1e-3, fake.now, fake.sleep))
    assert 1.99 < fake.now_s - 100.0 < 2.01
