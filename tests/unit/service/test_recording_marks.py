"""What the controller hands to the recorder: nothing without power, numbers that count on, a mark for what happens."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gantryctl.machine import default_machine
from gantryctl.operation.store import StateStore
from gantryctl.runtime import VirtualClock
from gantryctl.service.controller.process import Controller
from gantryctl.service.controller.publisher import Publisher
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.protocol.messages import Identity, to_record
from gantryctl.service.protocol.roles import Role
from support.marks import newest_mark

MACHINE = default_machine()
ALICE = Identity("c1", "alice", Role.OPERATOR, "console")


class Desk:
    """A controller in virtual time that publishes as the service does."""

    def __init__(self, store: StateStore) -> None:
        self.memory = SharedMemory.create()
        self.memory.words[Word.RECORDER_NS] = 2**62  # a recorder that is always alive
        self.made = made = Controller(MACHINE, store, self.memory)
        self.axis, self.engine = made.axis, made.engine
        made.engine.clock = VirtualClock()
        made.operator.now, made.operator.frames.start_s = lambda: made.engine.time_s, 0.0
        self.publisher = Publisher(
            made.machine, made.engine, made.operator, made.alarms, made.brake, made._recorder, self.memory,
            real_time=False, version="test",
        )  # fmt: skip
        self.seq = 0

    def scans(self, count: int) -> None:
        self.engine.run_until(lambda _: self.made._after_scan(self.publisher), count * self.engine.period_s)

    def send(self, kind: str, **values: object) -> None:
        self.seq += 1
        raw = {
            "type": kind,
            "seq": self.seq,
            "frame": newest_mark(self.made.operator, ALICE.client),
            **values,
        }
        raw["epoch"] = self.made.operator.authority.epoch
        assert self.memory.commands[Source.WEB].put(to_record(ALICE, raw))
        self.scans(20)

    def power(self, on: bool) -> None:
        self.send("power", on=on)
        self.scans(4000)
        self.send("alive")

    def records(self) -> list[bytes]:
        rows = self.memory.rows
        found = [record for record in rows.peek(rows.slots) if record is not None]
        rows.clear()
        return found

    def marks(self) -> list[float]:
        return [struct.unpack_from("<dd", record)[1] for record in self.records() if len(record) > 8]


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    with StateStore(MACHINE) as store:
        made = Desk(store)
        made.send("take", over=False)
        yield made
        made.memory.close()


def test_without_power_no_row_is_handed_on(desk: Desk) -> None:
    desk.scans(5000)
    assert desk.records() == []


def test_recordings_are_numbered_one_after_the_other_also_by_the_next_controller(desk: Desk) -> None:
    folder = desk.made._store.traces
    folder.mkdir()
    (folder / "move-000007-20991231T000000000.parquet").touch()
    desk.made._close(None)
    with_files = Controller(MACHINE, desk.made._store, desk.memory)
    with_files._record_on()
    assert with_files._recorder.number == 8
    # The next one ends what a killed one has left, and goes on where it was, though no file of it is there yet.
    desk.records()
    again = Controller(MACHINE, desk.made._store, desk.memory)
    assert desk.records() == [struct.pack("<d", 8)]
    again._record_on()
    assert again._recorder.number == 9


def test_a_long_recording_goes_on_under_the_next_number_without_a_row_lost(desk: Desk) -> None:
    desk.power(True)
    number = desk.memory.words[Word.RECORDING]
    desk.records()
    desk.memory.words[Word.RECORDING_LONG] = number
    desk.scans(10)
    records = desk.records()
    ends = [record for record in records if len(record) == 8]
    rows = [struct.unpack_from("<ddd", record) for record in records if len(record) > 8]
    assert ends == [struct.pack("<d", number)]
    assert {row[0] for row in rows} == {number, number + 1}
    scans = [round(row[2] / desk.engine.period_s) for row in rows]
    assert scans == list(range(scans[0], scans[0] + 10))


HAPPENS: dict[str, Callable[[Desk], None]] = {
    "a command": lambda desk: desk.send("set", tag="speed_setting_deg_s", value=2.0),
    "a refused command": lambda desk: desk.send("move", target_deg=1e3),
    "a flag": lambda desk: setattr(desk.engine.drive.faults, "enabling_switch", False),
}


@pytest.mark.parametrize("what", HAPPENS.values(), ids=HAPPENS)
def test_whatever_happens_at_rest_changes_the_mark_and_rest_does_not(
    desk: Desk, what: Callable[[Desk], None]
) -> None:
    desk.power(True)
    desk.scans(3000)
    desk.send("alive")
    desk.records()
    desk.scans(400)
    assert len(set(desk.marks())) == 1
    what(desk)
    desk.scans(100)
    assert len(set(desk.marks())) > 1
