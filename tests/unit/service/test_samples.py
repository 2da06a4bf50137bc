"""Rows of every scan for a scope: the same bits, in order, whoever else reads; what is gone is said to be."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from gantryctl.program.axis.axis import TRACE_COLUMNS
from gantryctl.service.clients.samples import ROWS_MAX, Samples
from gantryctl.service.memory.memory import ROW_BYTES, SharedMemory
from gantryctl.service.memory.ring import Ring
from gantryctl.service.memory.snapshot import publish_json
from gantryctl.service.memory.trace_ring import RingRecorder
from gantryctl.units import rad

COLUMNS = ("time_s", *TRACE_COLUMNS)
PERIOD_S = 0.001


class Bench:
    """A controller that records, and somebody who looks on."""

    def __init__(self, memory: SharedMemory) -> None:
        self.memory, self.samples = memory, Samples(memory)
        publish_json(memory.columns, {"columns": COLUMNS, "metadata": {"period_s": PERIOD_S}})
        self.controller = RingRecorder(memory.rows, COLUMNS)
        self.controller.number = 7
        self.made = 0

    def rows(self, count: int) -> None:
        for _ in range(count):
            values = dict.fromkeys(COLUMNS, 0.0)
            values |= {
                "time_s": self.made * PERIOD_S,
                "pos_act_rad": rad(0.01 * self.made),
                "axis_state": 2.0,
            }
            values["torque_act_nm"] = float("nan")
            self.controller.record(tuple(values.values()))
            self.made += 1


@pytest.fixture
def bench() -> Iterator[Bench]:
    memory = SharedMemory.create()
    yield Bench(memory)
    memory.close()


def test_every_row_comes_once_in_degrees_and_the_recorder_takes_them_as_before(bench: Bench) -> None:
    bench.rows(700)
    first = bench.samples.read(0, ROWS_MAX)
    # The recorder takes what it wants meanwhile: rows that were taken are seen all the same.
    bench.memory.rows.advance(650)
    second = bench.samples.read(first["next"], ROWS_MAX)
    assert [first["from"], first["next"], second["from"], second["next"]] == [0, 500, 500, 700]
    assert (first["newest"], first["newest_s"]) == (700, pytest.approx(0.699))
    assert first["period_s"] == PERIOD_S
    times = first["tags"]["time_s"] + second["tags"]["time_s"]
    assert times == pytest.approx([n * PERIOD_S for n in range(700)])
    # Six decimals are told.
    assert first["tags"]["pos_act_deg"] == pytest.approx([0.01 * n for n in range(500)], abs=1e-6)
    assert first["tags"]["axis_state"] == [2.0] * 500
    assert second["tags"]["torque_act_nm"] == [None] * 200
    assert len(bench.memory.rows) == 50


def test_without_a_number_the_next_rows_come(bench: Bench) -> None:
    bench.rows(10)
    here = bench.samples.read(10**12, ROWS_MAX)
    assert (here["from"], here["next"], here["tags"]["time_s"]) == (10, 10, [])
    bench.rows(3)
    assert bench.samples.read(here["next"], ROWS_MAX)["tags"]["time_s"] == pytest.approx([0.01, 0.011, 0.012])


def test_rows_that_were_overwritten_are_said_to_be_gone(bench: Bench) -> None:
    slots = bench.memory.rows.slots
    for _ in range(2):
        bench.rows(slots // 2 + 5)
        bench.memory.rows.clear()
    found = bench.samples.read(0, 2)
    # Ten are overwritten, and the next one may be under way at any moment.
    assert found["from"] == 11
    assert found["tags"]["time_s"] == pytest.approx([0.011])


def test_an_end_of_a_recording_is_no_row_and_before_a_controller_there_is_none(bench: Bench) -> None:
    bench.rows(2)
    bench.controller.stop()
    bench.controller.number = 8
    bench.rows(1)
    found = bench.samples.read(0, ROWS_MAX)
    assert (found["next"], found["tags"]["time_s"]) == (4, pytest.approx([0.0, 0.001, 0.002]))
    memory = SharedMemory.create()
    nothing = Samples(memory).read(0, ROWS_MAX)
    assert nothing.pop("utc_s") > 0.0
    assert nothing == {"period_s": None, "from": 0, "next": 0, "newest": 0, "newest_s": None, "tags": {}}
    memory.close()


def test_no_request_is_answered_with_more_rows_than_the_most(bench: Bench) -> None:
    bench.rows(600)
    assert len(bench.samples.read(0, 10**12)["tags"]["time_s"]) == ROWS_MAX


class Overwriting(Ring):
    """A ring whose writer goes on before each of the first three records is read."""

    def _read(self, number: int) -> bytes | None:
        if self.written < 11:
            self.advance(1)
            self.put(bytes([self.written]))
        return super()._read(number)


def test_a_record_that_is_overwritten_while_it_is_read_is_not_taken_for_an_older_one() -> None:
    ring = Overwriting(memoryview(bytearray(192 + 8 * ROW_BYTES)), ROW_BYTES)
    for n in range(8):
        ring.put(bytes([n]))
    # 0, 1 and 2 read as 8, 9 and 10; 3 is the next to be overwritten.
    assert ring.look(0, 8) == (4, [bytes([n]) for n in range(4, 8)])


def test_a_row_that_was_damaged_is_left_out(bench: Bench) -> None:
    bench.rows(3)
    ring = bench.memory.rows
    ring._memory[192 + ring._slot + 8] ^= 1
    found = bench.samples.read(0, ROWS_MAX)
    assert (found["next"], found["tags"]["time_s"]) == (3, pytest.approx([0.0, 0.002]))
