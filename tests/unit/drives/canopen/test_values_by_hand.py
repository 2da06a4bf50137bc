"""Gains and parameters of a drive that refuses, says nothing, or keeps what it has: a few objects by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.drives.canopen.setup.gains import planned_changes, read_gains, write_gains
from gantryctl.drives.canopen.setup.parameters import backup, check_backup, read_objects, restore
from gantryctl.drives.od.model import Access, DeviceDescription, Entry, ObjectKind, ObjectSpec
from gantryctl.drives.od.standard import STANDARD
from gantryctl.drives.od.types import DataType
from gantryctl.drives.profiles import Gain, SpeedLoop
from gantryctl.errors import CommandRefused, DeviceError

pytestmark = pytest.mark.can

KP, KI, RAMP = (0x2500, 1), (0x2500, 2), (0x6085, 0)
NO_OBJECT, NO_ANSWER, TOO_HIGH = 0x0602_0000, 0x0504_0000, 0x0609_0031
LOOP = SpeedLoop(kp=Gain(object="2500:01"), ki=Gain(object="2500:02"))
OFF = 0x40  # Switch on disabled


class Node:
    """Objects by index and sub-index; `refuses` has abort codes of their reads or writes.

    Attributes:
        keeps: objects that keep their value when they are written. wrote: in order.
    """

    def __init__(self, values: dict[tuple[int, int], bytes]) -> None:
        self.values = {(0x6041, 0): OFF.to_bytes(2, "little"), (0x6064, 0): bytes(4), **values}
        self.reads, self.writes, self.keeps = dict[Any, int](), dict[Any, int](), set[Any]()
        self.wrote: list[tuple[int, int]] = []
        self.sdo: Any = self
        self.link = SimpleNamespace(pause=lambda seconds: None)
        self.key = "0000000A-0000000B-00000001"

    def identity(self) -> Any:
        return SimpleNamespace(key=self.key, name="drive", software="1")

    def enter_pre_operational(self) -> None:
        pass

    def read(self, index: int, sub: int) -> bytes:
        code = self.reads.get((index, sub), 0 if (index, sub) in self.values else NO_OBJECT)
        if code:
            raise SdoError(index, sub, code)
        return self.values[index, sub]

    def number(self, index: int, sub: int = 0) -> int:
        return int.from_bytes(self.read(index, sub), "little")

    def write(self, index: int, sub: int, data: bytes) -> None:
        if code := self.writes.get((index, sub), 0):
            raise SdoError(index, sub, code)
        self.wrote.append((index, sub))
        if (index, sub) not in self.keeps:
            self.values[index, sub] = data


def gains(kp: int = 10, ki: int = 20) -> Node:
    return Node({KP: kp.to_bytes(2, "little"), KI: ki.to_bytes(2, "little")})


# --- gains ------------------------------------------------------------------------------------------------------------


def test_a_gain_that_the_drive_does_not_have_is_not_known_and_silence_is_an_error() -> None:
    node = gains()
    node.reads[KI] = NO_OBJECT
    kp, ki = read_gains(node.sdo, LOOP)
    assert (kp.value, ki.value) == (10.0, None)
    assert math.isnan(ki.si)
    with pytest.raises(CommandRefused, match="the drive has no 2500:02"):
        planned_changes((kp, ki), {}, {"ki": 2.0})
    node.reads[KI] = NO_ANSWER
    with pytest.raises(SdoError, match="no answer"):
        read_gains(node.sdo, LOOP)


def test_only_the_gain_that_is_asked_for_changes() -> None:
    node = gains()
    (change,) = planned_changes(read_gains(node.sdo, LOOP), {}, {"ki": 2.0})
    assert (change.name, change.before, change.after) == ("ki", 20.0, 40.0)
    write_gains(node, (change,), 524_288)  # type: ignore[arg-type]
    assert node.wrote == [KI]
    assert (node.number(*KP), node.number(*KI)) == (10, 40)


def test_a_gain_that_is_a_real_number_is_written_as_one() -> None:
    """REAL32: 0.75 is 3F40 0000h, twice as much 3FC0 0000h."""
    node = Node({KP: bytes.fromhex("0000403F")})
    loop = SpeedLoop(kp=Gain(object="2500:01", real=True), ki=Gain(object="2500:02"))
    changes = planned_changes(read_gains(node.sdo, loop), {}, {"kp": 2.0})
    write_gains(node, changes, 524_288)  # type: ignore[arg-type]
    assert node.values[KP] == bytes.fromhex("0000C03F")


def test_a_gain_that_is_too_large_for_its_object_is_not_written() -> None:
    """Two bytes with a sign hold 32 767; the gain before it gets its old value again."""
    node = gains()
    changes = planned_changes(read_gains(node.sdo, LOOP), {}, {"kp": 2.0, "ki": 2000.0})
    with pytest.raises(DeviceError, match="40000 does not fit into 2500:02, 2 bytes"):
        write_gains(node, changes, 524_288)  # type: ignore[arg-type]
    assert (node.number(*KP), node.number(*KI)) == (10, 20)


def test_a_gain_that_the_drive_keeps_is_told_with_both_values() -> None:
    node = gains()
    node.keeps.add(KP)
    changes = planned_changes(read_gains(node.sdo, LOOP), {}, {"kp": 2.0})
    with pytest.raises(DeviceError, match="was written 20 and holds 10"):
        write_gains(node, changes, 524_288)  # type: ignore[arg-type]


# --- parameters -------------------------------------------------------------------------------------------------------


def test_a_refused_object_stands_in_the_list_and_silence_ends_it() -> None:
    node = Node({RAMP: bytes(4)})
    found = {(row.obj, row.sub): row for row in read_objects(node.sdo, None)}
    assert set(found) == set(STANDARD)
    assert found[RAMP].raw == "00000000"
    assert (found[0x1008, 0].raw, found[0x1008, 0].shown) == ("", "- (no such object (abort code 06020000))")
    node.reads[RAMP] = NO_ANSWER
    with pytest.raises(SdoError, match="no answer"):
        read_objects(node.sdo, None)


def test_the_entries_of_an_eds_are_read_in_place_of_those_of_the_standards() -> None:
    entry = Entry(0x2000, 1, "gain", DataType.UNSIGNED16, Access.RW)
    device = DeviceDescription({0x2000: ObjectSpec(0x2000, "gains", ObjectKind.RECORD, {1: entry})})
    (row,) = read_objects(Node({(0x2000, 1): b"\x10\x01"}).sdo, device)
    assert (row.obj, row.sub, row.name, row.shown) == (0x2000, 1, "gain", "272 (110h)")


def test_a_value_of_another_length_is_shown_as_it_is() -> None:
    node = Node({RAMP: b"\1\2\3"})
    found = {(row.obj, row.sub): row for row in read_objects(node.sdo, None)}
    assert (found[RAMP].raw, found[RAMP].shown) == ("010203", str(b"\1\2\3"))


def test_a_backup_holds_what_can_be_written_back_and_nothing_that_acts() -> None:
    """Neither the controlword nor a target, whatever the drive answers for them."""
    node = Node({RAMP: bytes(4), (0x6040, 0): b"\x0f\0", (0x60FF, 0): bytes(4), (0x1017, 0): b"\0\0"})
    kept = backup(node, None)  # type: ignore[arg-type]
    assert kept["values"] == {"6085:00": "00000000"}
    assert check_backup(kept) is kept


@pytest.mark.parametrize(
    "wrong",
    [
        [], {}, {"values": {}}, {"drive": "A", "values": []},
        {"drive": "A", "values": {"6085:00": 5}}, {"drive": "A", "values": {"6085:00": ""}},
        {"drive": "A", "values": {"6085:00": "00" * 4097}}, {"drive": "A", "values": {"6085:00": "xy"}},
        {"drive": "A", "values": {"0085:00": "00"}}, {"drive": "A", "values": {"6085:100": "00"}},
        {"drive": "A", "values": {"6085": "00"}},
    ],
)  # fmt: skip
def test_what_is_no_backup_is_refused(wrong: object) -> None:
    with pytest.raises(ValueError, match=r"."):
        check_backup(wrong)


def test_a_backup_is_written_where_it_differs_and_what_is_not_taken_is_told() -> None:
    node = Node({(0x6084, 0): b"\1", RAMP: b"\1", (0x6086, 0): b"\1", (0x2000, 0): b"\1", (0x1400, 1): b"\1"})
    node.writes[0x6086, 0] = TOO_HIGH
    node.keeps.add((0x2000, 0))
    values = {
        "6084:00": "01",
        "6085:00": "02",
        "6086:00": "02",
        "2000:00": "02",
        "1400:01": "02",
        "6040:00": "0f00",
    }
    wrong = restore(node, {"drive": "0000000A-0000000B-00000007", "values": values})  # type: ignore[arg-type]
    # Telegrams and commands are never written back.
    assert node.wrote == [RAMP, (0x2000, 0)]
    assert node.values[RAMP] == b"\2"
    assert [line.partition(": ")[0] for line in wrong] == ["object 6086:00", "2000:00"]


def test_a_drive_that_falls_silent_ends_a_restore() -> None:
    node = Node({RAMP: b"\1"})
    node.writes[RAMP] = NO_ANSWER
    with pytest.raises(SdoError, match="no answer"):
        restore(node, {"drive": node.key, "values": {"6085:00": "02"}})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("status", "drive", "words"),
    [
        (0x27, "0000000A-0000000B-00000001", "parameters wait"),
        (OFF, "0000000A-0000000C-00000001", "another kind"),
    ],
)
def test_a_backup_is_for_the_same_kind_of_drive_without_torque(status: int, drive: str, words: str) -> None:
    node = Node({RAMP: b"\1", (0x6041, 0): status.to_bytes(2, "little")})
    with pytest.raises(CommandRefused, match=words):
        restore(node, {"drive": drive, "values": {"6085:00": "02"}})  # type: ignore[arg-type]
    assert not node.wrote
