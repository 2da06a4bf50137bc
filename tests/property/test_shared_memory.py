"""Ring and sequence lock: nothing torn, nothing lost, nothing twice; also between two processes."""

from __future__ import annotations

import struct
import subprocess
import sys
from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from gantryctl.errors import UsageError
from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.memory.ring import Ring
from gantryctl.service.memory.seqlock import SequenceLock

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="anonymous memory files")
SLOTS, SLOT = 5, 64


class RingAgainstDeque(RuleBasedStateMachine):
    """The ring is a bounded queue: a deque of at most as many records says what must come out."""

    def __init__(self) -> None:
        super().__init__()
        self.ring = Ring(memoryview(bytearray(192 + SLOTS * SLOT)), SLOT)
        self.model: deque[bytes] = deque()
        self.put = self.taken = 0

    @rule(record=st.binary(max_size=SLOT - 8))
    def write(self, record: bytes) -> None:
        fits = len(self.model) < SLOTS
        assert self.ring.put(record) is fits
        if fits:
            self.model.append(record)
            self.put += 1

    @rule()
    def take(self) -> None:
        assert self.ring.take() == (self.model.popleft() if self.model else None)
        self.taken = self.put - len(self.model)

    @rule(count=st.integers(0, 7))
    def look_then_advance(self, count: int) -> None:
        found = self.ring.peek(count)
        assert found == list(self.model)[:count]
        self.ring.advance(len(found))
        for _ in found:
            self.model.popleft()
        self.taken = self.put - len(self.model)

    @rule()
    def clear(self) -> None:
        assert self.ring.clear() == len(self.model)
        self.model.clear()
        self.taken = self.put

    @invariant()
    def counts(self) -> None:
        assert (len(self.ring), self.ring.written, self.ring.done) == (len(self.model), self.put, self.taken)


TestRingAgainstDeque = RingAgainstDeque.TestCase


@given(st.binary(min_size=1, max_size=SLOT - 8), st.integers(0, 8 * (SLOT - 8) - 1))
def test_a_record_with_any_bit_turned_is_not_given_out(record: bytes, bit: int) -> None:
    memory = bytearray(192 + SLOTS * SLOT)
    ring = Ring(memoryview(memory), SLOT)
    assert ring.put(record)
    place = 192 + 8 + bit // 8 % len(record)
    memory[place] ^= 1 << bit % 8
    assert ring.take() is None
    assert ring.damaged == 1


@given(st.integers(0, 2**64 - 1), st.integers(0, 2**64 - 1))
def test_no_state_of_the_counters_makes_the_reader_fail(head: int, tail: int) -> None:
    memory = bytearray(192 + SLOTS * SLOT)
    struct.pack_into("<Q", memory, 0, head)
    struct.pack_into("<Q", memory, 64, tail)
    ring = Ring(memoryview(memory), SLOT)
    assert ring.peek(10) in ([], [None] * min(10, max(0, tail - head)))


def test_what_is_too_long_is_refused_and_changes_nothing() -> None:
    ring = Ring(memoryview(bytearray(192 + SLOTS * SLOT)), SLOT)
    with pytest.raises(UsageError, match="57 bytes"):
        ring.put(bytes(SLOT - 7))
    lock = SequenceLock(memoryview(bytearray(64)))
    lock.publish(b"old")
    with pytest.raises(UsageError, match="41 bytes"):
        lock.publish(bytes(41))
    found = lock.read()
    assert found is not None
    assert found == b"old"


def test_a_writer_killed_in_the_middle_shows_nothing_and_the_next_one_repairs_it() -> None:
    memory = bytearray(128)
    lock = SequenceLock(memoryview(memory))
    lock.publish(b"whole")
    memory[0] += 1  # odd: writing
    assert SequenceLock(memoryview(memory)).read() is None
    SequenceLock(memoryview(memory)).publish(b"again")
    found = lock.read()
    assert found is not None
    assert found == b"again"


PUBLISHER = """
import sys
from gantryctl.service.memory.memory import SharedMemory
memory = SharedMemory(int(sys.argv[1]))
for n in range(20000):
    memory.fast.publish(bytes([n % 251]) * (100 + n % 900))
"""


def test_a_reader_beside_a_writer_sees_whole_records_only() -> None:
    """Every record consists of one byte value, its length by the same number: a torn one would show."""
    memory = SharedMemory.create()
    writer = subprocess.Popen(
        [sys.executable, "-c", PUBLISHER, str(memory.handle)], pass_fds=(memory.handle,)
    )
    numbers = []
    while writer.poll() is None or not numbers:
        found = memory.fast.read()
        if found is not None:
            long, value = len(found) - 100, found[0]
            number = next(
                n for n in range(long, 20000, 900) if n % 251 == value
            )  # only one record is so long
            assert found == bytes([value]) * (100 + number % 900)
            numbers.append(number)
    assert writer.returncode == 0
    assert numbers == sorted(numbers)
    assert memory.fast.version == 20000
    memory.close()


SENDER = """
import sys
from gantryctl.service.memory.memory import SharedMemory
ring = SharedMemory(int(sys.argv[1])).commands[0]
for n in range(20000):
    while not ring.put(b"%d" % n * (1 + n % 50)):
        pass
"""


def test_a_ring_between_two_processes_keeps_everything_in_order() -> None:
    memory = SharedMemory.create()
    sender = subprocess.Popen([sys.executable, "-c", SENDER, str(memory.handle)], pass_fds=(memory.handle,))
    got = 0
    while got < 20000:
        assert sender.poll() in (None, 0)
        for record in memory.commands[0].peek(64):
            assert record == b"%d" % got * (1 + got % 50)
            got += 1
            memory.commands[0].advance(1)
    assert sender.wait(30) == 0
    assert len(memory.commands[0]) == memory.commands[0].damaged == 0
    memory.close()
