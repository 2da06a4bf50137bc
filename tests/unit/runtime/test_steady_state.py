"""The scan in its steady state: nothing is left behind from scan to scan, and little is made inside one."""

from __future__ import annotations

import gc
import sys
import tracemalloc
from collections.abc import Iterator

import pytest

from gantryctl import AxisProgram, build_engine, default_machine
from gantryctl.image import InputImage, OperatorCommand
from gantryctl.machine import with_values
from gantryctl.program import Axis, GantryProgram
from gantryctl.runtime import Engine, FixedOperator
from gantryctl.units import rad

_SCANS = 1000
# Five figures of the torque model are made anew every 50 ms, and free lists fill: some blocks, however many scans.
_BLOCKS = 40
# Three images, their numbers and the largest frames: 1.5 kB measured. A column of this run, kept, is 24 kB.
_PEAK_BYTES = 6000


class Hoarder(GantryProgram):
    """Keeps every image: what the test has to see."""

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.kept: list[InputImage] = []

    def logic(self, image: InputImage) -> None:
        super().logic(image)
        self.kept.append(image)


class Wasteful(GantryProgram):
    """Makes a list of a thousand numbers in every scan, and keeps nothing."""

    def logic(self, image: InputImage) -> None:
        super().logic(image)
        assert [0.5 * n for n in range(1000)]


def cruising(program: type[AxisProgram]) -> Engine:
    """The reference gantry at 6 deg/s, all parts warm."""
    operator = FixedOperator()
    machine = with_values(default_machine(), {"virtual_axis.acc_deg_s2": 2.0})
    engine = build_engine(machine, program=program, operator=operator)
    operator.command = OperatorCommand(power=True, speed_rad_s=rad(6.0), target_rad=rad(170.0))
    engine.run_for(2.0)
    operator.command = operator.command._replace(move=True)
    engine.run_for(5.0)
    return engine


@pytest.fixture(autouse=True)
def no_collector() -> Iterator[None]:
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def blocks_left(engine: Engine) -> int:
    """Blocks of memory that so many scans leave behind."""
    before = sys.getallocatedblocks()
    engine.run_for(_SCANS * engine.period_s)
    return sys.getallocatedblocks() - before


def peak_bytes(engine: Engine) -> int:
    """Most memory in use at once beyond that of before, within a tenth of a second."""
    tracemalloc.start()
    try:
        engine.run_for(0.1)
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        engine.run_for(0.1)
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()


def test_a_cruising_axis_leaves_nothing_behind() -> None:
    engine = cruising(GantryProgram)
    assert abs(engine.program.trace_row()[1] - rad(6.0)) < 1e-9  # it does cruise
    assert blocks_left(engine) < _BLOCKS
    assert peak_bytes(engine) < _PEAK_BYTES


def test_a_standing_axis_leaves_nothing_behind() -> None:
    operator = FixedOperator(OperatorCommand(power=True))
    engine = build_engine(default_machine(), program=GantryProgram, operator=operator)
    engine.run_for(10.0)
    assert engine.output.at_rest
    assert blocks_left(engine) < _BLOCKS
    assert peak_bytes(engine) < _PEAK_BYTES


def test_the_measure_sees_what_is_kept() -> None:
    # An image is made of at least three tuples.
    assert blocks_left(cruising(Hoarder)) > 3 * _SCANS


def test_the_measure_sees_what_is_made_and_dropped() -> None:
    assert peak_bytes(cruising(Wasteful)) > _PEAK_BYTES
