"""Virtual drives with the dictionary of a real model: the bus sees what the table has, and nothing else."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from gantryctl.drives.od.object_table import ObjectTable, read_object_tables, read_objects_of
from gantryctl.drives.od.types import DataType, encode
from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.personality import Personality
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.wiring.virtual import as_in_table, drive_kind, shipped_objects
from unit.drives.virtual.bench import hardware

MACHINE = load_machine(configs_folder() / "hust_can.toml")
TABLES = read_object_tables(shipped_objects())
NODE_ID = 2


@cache
def drive(name: str) -> DriveNode:
    table = next(t for n, t in TABLES.items() if n.startswith(name))
    return booted(as_in_table(Personality(), table, MACHINE))


def booted(kind: Personality) -> DriveNode:
    node = DriveNode(hardware(), NODE_ID, lambda can_id, data: None, kind=kind, stepped=True)
    node.boot()
    return node


def refusal(node: DriveNode, index: int, sub: int, value: int) -> Abort | None:
    entry = node.od.entry(index, sub)
    try:
        node.od.download(index, sub, encode(entry.data_type, value))
    except SdoAbort as refused:
        return refused.code
    return None


@pytest.mark.parametrize("table", TABLES.values(), ids=lambda t: t.drive)
def test_every_row_of_the_table_is_what_the_bus_sees(table: ObjectTable) -> None:
    node = drive(table.drive)
    for index, sub in table.absent:
        with pytest.raises(SdoAbort) as refused:
            node.od.upload(index, sub)
        assert refused.value.code in (Abort.NO_OBJECT, Abort.NO_SUB)
    for (index, sub), row in table.entries.items():
        entry = node.od.entry(index, sub)
        assert (entry.data_type, entry.access) == (row.data_type, row.access)
        if row.access.readable:
            node.od.upload(index, sub)
        if not row.access.writable:
            with pytest.raises(SdoAbort) as refused:
                node.od.download(index, sub, b"\0")
            assert refused.value.code is Abort.READ_ONLY
    # Manufacturer objects of the virtual drive itself are in no real one.
    assert not [i for i in node.od.visible.objects if 0x2000 <= i < 0x6000]
    assert {i for i in node.od.visible.objects if i >= 0x6000} == {i for i, _ in table.entries if i >= 0x6000}


def test_limits_of_the_table_are_kept() -> None:
    assert refusal(drive("Yiyou"), 0x6072, 0, 1001) is Abort.VALUE_HIGH
    assert refusal(drive("Yiyou"), 0x6072, 0, 99) is Abort.VALUE_LOW
    assert refusal(drive("Yiyou"), 0x6072, 0, 1000) is None
    assert refusal(drive("Elmo"), 0x605D, 0, 3) is Abort.VALUE_HIGH
    # Mode 9: refused by the limits of one, taken by the next.
    assert refusal(drive("Faulhaber"), 0x6060, 0, 9) is Abort.VALUE_HIGH
    assert refusal(drive("Trinamic TMCM-1617"), 0x6060, 0, 9) is None


def test_a_limit_of_1016_that_leaves_no_room_for_a_node_is_that_of_the_time() -> None:
    assert TABLES["Elmo Gold (DCF)"].entries[0x1016, 1].high == 65535
    assert refusal(drive("Elmo"), 0x1016, 1, 127 << 16 | 150) is None


def test_what_the_table_says_of_the_first_pdo_holds_for_all() -> None:
    node = drive("Trinamic TMCM-6212")
    for number in range(4):
        with pytest.raises(SdoAbort) as refused:
            node.od.download(0x1400 + number, 2, b"\x01")
        assert refused.value.code is Abort.READ_ONLY
    with pytest.raises(SdoAbort):
        drive("maxon EPOS4").od.upload(0x1401, 5)


def test_an_object_that_the_bus_does_not_see_acts_by_what_the_tool_has_set() -> None:
    """Ingenia has no 6085 and no 6072: its quick stop and its torque limit are those of the machine."""
    node, plain = drive("Ingenia"), booted(Personality())
    assert node.od.number(0x6072) == plain.od.number(0x6072) > 0
    assert node.scaling.rad_s2(node.od.number(0x6085)) == pytest.approx(
        plain.scaling.rad_s2(plain.od.number(0x6085)),
        rel=1e-4,  # whole mrev/s2
    )


def test_motor_data_are_entered_whatever_the_default_is() -> None:
    assert drive("Ingenia").od.number(0x6076) == 257_000
    # 0 in the file, and no tool: a torque limit of 0 until the controller writes one.
    assert drive("Trinamic TMCM-1617").od.number(0x6072) == 0


def test_the_unit_of_speed_follows_60a9() -> None:
    """EPOS4 comes with r/min; written to 0.001 r/min, the same speed is a thousand times the number."""
    node = booted(drive_kind(with_values(MACHINE, {"can.virtual_drive": "maxon EPOS4@"})))
    coarse = node.scaling.velocity(100.0)
    assert refusal(node, 0x60A9, 0, 0xFDB44700) is None
    assert node.scaling.velocity(100.0) == pytest.approx(1000 * coarse, rel=1e-3)  # 955 r/min, rounded
    assert refusal(node, 0x60A9, 0, 0x12345678) is Abort.VALUE
    node.reset(communication_only=False)
    assert node.scaling.velocity(100.0) == coarse


def test_an_eds_becomes_a_drive_with_nothing_beside_it() -> None:
    table = read_objects_of(Path("tests/data/eds/minimal.eds"))
    node = booted(as_in_table(Personality(), table, MACHINE))
    assert set(node.od.visible.objects) == {index for index, _ in table.entries}


def test_an_object_with_less_room_than_the_behaviour_fills_gives_its_low_bits() -> None:
    table = TABLES["Elmo Gold (DCF)"]
    inputs = table.entries[0x60FD, 0]
    narrow = replace(
        table, entries={**table.entries, (0x60FD, 0): replace(inputs, data_type=DataType.UNSIGNED8)}
    )
    node = booted(as_in_table(Personality(), narrow, MACHINE))
    assert node.od.upload(0x60FD, 0) == bytes((node.od.readers[0x60FD, 0]() & 0xFF,))


def test_a_drive_of_the_field_has_the_units_and_modes_of_its_profile() -> None:
    ingenia, epos4, epos2 = drive("Ingenia"), drive("maxon EPOS4"), drive("maxon EPOS2")
    # mrev/s, and no 60A9 to say it: 2 pi rad/s is one turn a second.
    assert ingenia.scaling.velocity(6.283185307179586) == 1000
    # 6076 of the EPOS4 is in uN m, and its ramps stay in r/min/s whatever 60A9 says.
    assert epos4.od.number(0x6076) == 257_000_000
    before = epos4.scaling.rad_s2(600)
    epos4.scaling.count_speed_in("0.001 r/min")
    assert epos4.scaling.rad_s2(600) == before == pytest.approx(62.83185307179586)
    assert (epos4.od.number(0x1018, 1), epos2.od.number(0x1018, 1)) == (0xFB, 0xFB)
    # No CSV: mode 9 is refused, and 6502 does not name it.
    assert refusal(epos2, 0x6060, 0, 9) is Abort.VALUE
    assert not epos2.od.number(0x6502) & 0x100
    assert epos4.od.number(0x6502) & 0x100
