"""Set-up of a drive by hand: mapping, mode, marker, backup and nodes as CiA 301 and CiA 402 have them."""

from __future__ import annotations

import pytest

from gantryctl.drives.canopen import mapping as m
from gantryctl.drives.canopen.bus.node import NodeIdentity
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.drives.canopen.nodes.bus_node import BusNode, NodeObject, communication_objects
from gantryctl.drives.canopen.nodes.io_node import IoNode
from gantryctl.drives.canopen.settings import (
    InputBits,
    IoNodeSettings,
    OutputBits,
)
from gantryctl.drives.canopen.setup.fault_reset import reset_fault
from gantryctl.drives.canopen.setup.live_facts import read_facts
from gantryctl.drives.canopen.setup.opening import (
    RESTART_MARKERS,
    _outputs_off,
    _select_csv,
    read_restart_marker,
    write_restart_marker,
)
from gantryctl.drives.canopen.setup.parameters import refuse_energised, restore
from gantryctl.errors import CommandRefused, DeviceError
from gantryctl.image import DriveState
from unit.drives.canopen.dictionary import READ_ONLY, CountedSync, Dictionary, Place, settings
from unit.drives.canopen.wire import Wire, remote_node

pytestmark = pytest.mark.can


# --- mapping ------------------------------------------------------------------------------------------------------

PLAN = m.plan_mapping(frozenset((m.TORQUE_OFFSET, m.VELOCITY, m.TORQUE, m.INPUTS)), outputs=True)
# Identifiers of CiA 301 for node 2; bit 30: no remote request. Entries: index, sub-index, bits.
MAPPED = {
    (0x1400, 1): 0x202, (0x1400, 2): 1, (0x1600, 0): 3, (0x1600, 1): 0x6040_0010, (0x1600, 2): 0x60FF_0020,
    (0x1600, 3): 0x60B2_0010,
    (0x1401, 1): 0x302, (0x1401, 2): 1, (0x1601, 0): 1, (0x1601, 1): 0x60FE_0120,
    (0x1800, 1): 0x4000_0182, (0x1800, 2): 1, (0x1A00, 0): 3, (0x1A00, 1): 0x6041_0010, (0x1A00, 2): 0x6064_0020,
    (0x1A00, 3): 0x6077_0010,
    (0x1801, 1): 0x4000_0282, (0x1801, 2): 1, (0x1A01, 0): 2, (0x1A01, 1): 0x606C_0020, (0x1A01, 2): 0x60FD_0020,
}  # fmt: skip
UNUSED = {
    (0x1402, 1): 0x402, (0x1403, 1): 0x8000_0502, (0x1802, 1): 0x4000_0382, (0x1803, 1): 0xC000_0482,
}  # fmt: skip


def test_the_mapping_is_written_the_cia_way() -> None:
    """Telegram invalid, count 0, entries, count, type, telegram valid; what is not used is switched off."""
    sdo = Dictionary(UNUSED)
    assert m.write_mapping(sdo, 2, PLAN) is None  # type: ignore[arg-type]
    assert sdo.values == MAPPED | {place: value | 0x8000_0000 for place, value in UNUSED.items()}
    for first in (0x1400, 0x1800):
        steps = [(i, s, v) for i, s, v in sdo.written if i in (first, first + 0x200)]
        assert steps[0] == (first, 1, MAPPED[first, 1] | 0x8000_0000)
        assert steps[1] == (first + 0x200, 0, 0)
        assert steps[-3:] == [(first + 0x200, 0, 3), (first, 2, 1), (first, 1, MAPPED[first, 1])]


@pytest.mark.parametrize("place", MAPPED)
def test_a_mapping_that_reads_back_otherwise_is_refused(place: Place) -> None:
    m.check_mapping(Dictionary(MAPPED), 2, PLAN)  # type: ignore[arg-type]
    for bad in (
        MAPPED[place] ^ 0x10,
        MAPPED[place] | 0x8000_0000 if place[1] == 1 and place[0] % 0x200 < 4 else 0,
    ):
        if bad != MAPPED[place]:
            with pytest.raises(DeviceError, match=f"{place[0]:04X}:{place[1]:02X}"):
                m.check_mapping(Dictionary(MAPPED | {place: bad}), 2, PLAN)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [254, 255])
def test_a_fixed_type_is_good_for_commands_and_not_for_feedback(kind: int) -> None:
    sdo = Dictionary({**UNUSED, (0x1400, 2): kind})
    sdo.refused[0x1400, 2] = READ_ONLY
    assert m.write_mapping(sdo, 2, PLAN) is None  # type: ignore[arg-type]
    m.check_mapping(sdo, 2, PLAN)  # type: ignore[arg-type]
    sdo = Dictionary({**UNUSED, (0x1800, 2): kind})
    sdo.refused[0x1800, 2] = READ_ONLY
    with pytest.raises(SdoError):
        m.write_mapping(sdo, 2, PLAN)  # type: ignore[arg-type]
    with pytest.raises(DeviceError, match="1800:02"):
        m.check_mapping(Dictionary(MAPPED | {(0x1800, 2): kind}), 2, PLAN)  # type: ignore[arg-type]
    sdo = Dictionary({**UNUSED, (0x1400, 2): 10})  # every tenth SYNC
    sdo.refused[0x1400, 2] = READ_ONLY
    with pytest.raises(SdoError):
        m.write_mapping(sdo, 2, PLAN)  # type: ignore[arg-type]


def test_a_drive_that_falls_silent_in_an_entry_has_not_refused_it() -> None:
    sdo = Dictionary(UNUSED)
    sdo.refused[0x1600, 2] = 0x0504_0000
    with pytest.raises(SdoError, match="no answer"):
        m.write_mapping(sdo, 2, PLAN)  # type: ignore[arg-type]


@pytest.mark.parametrize(("masks", "written"), [({}, []), ({(0x60FE, 2): 0}, [(0x60FE, 2, 0x0001_0001)])])
def test_all_outputs_are_off_and_the_brake_is_set_before_the_telegrams_fly(
    masks: dict[Place, int], written: list[tuple[int, int, int]]
) -> None:
    """Bit 0 of 60FE sets the brake; not every drive has a mask (60FE:02)."""
    node = remote_node(Wire())
    node.sdo = Dictionary(masks)  # type: ignore[assignment]
    _outputs_off(node, 0x0001_0001)
    assert node.sdo.written == [*written, (0x60FE, 1, 1)]  # type: ignore[attr-defined]


def test_an_object_of_another_type_is_there_and_its_value_means_nothing() -> None:
    """6041 with four bytes, where the standard has two; silence is no answer."""
    sdo = Dictionary({(0x6041, 0): 0x40, (0x6061, 0): 9}, {0x6061: 1})
    who = NodeIdentity(1, 2, 3, 4, 402, "", "", "")
    facts = read_facts(sdo, who, ((0x6041, 0), (0x6061, 0), (0x606C, 0)))  # type: ignore[arg-type]
    assert (facts.has(0x6041), facts.value(0x6041), facts.value(0x6061), facts.has(0x606C)) == (
        True,
        None,
        9,
        False,
    )


def test_an_object_of_another_size_is_not_mapped() -> None:
    """60B2 has 32 bits in one real drive: it would push what stands behind it out of the telegram."""
    sizes = {0x60B2: 4, 0x606C: 4, 0x6077: 2, 0x60FD: 4, 0x603F: 2}
    sdo = Dictionary({**UNUSED, **{(obj, 0): 0 for obj in sizes}}, sizes)
    found = m.configure(sdo, 2, False)  # type: ignore[arg-type]
    assert m.TORQUE_OFFSET not in found.signals
    assert found.refused == {m.TORQUE_OFFSET}
    assert [signal.obj for signal in found.rpdos[0].signals] == [0x6040, 0x60FF]


# --- mode, marker, fault, backup ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("shown", "lines"), [(9, 0), (8, 1), (0, 1), (-1, 1)])
def test_only_a_drive_that_shows_csv_is_let_go(shown: int, lines: int) -> None:
    node = remote_node(Wire())
    node.sdo = Dictionary({(0x6060, 0): 8, (0x6061, 0): shown})  # type: ignore[assignment]
    assert len(_select_csv(node) or ()) == lines
    assert node.sdo.written[-1] == (0x6060, 0, 9)


class LateMode(Dictionary):
    """A drive that shows what it is to do only as it is asked for the fifth time."""

    asked = 0

    def number(self, index: int, sub: int = 0) -> int:
        self.asked += index == 0x6061
        return 9 if index == 0x6061 and self.asked >= 5 else super().number(index, sub)


def test_a_drive_may_show_csv_a_few_readings_later() -> None:
    node = remote_node(Wire())
    node.sdo = LateMode({(0x6060, 0): 8, (0x6061, 0): 8})  # type: ignore[assignment]
    assert _select_csv(node) == ()


@pytest.mark.parametrize(
    ("held", "marker"),
    [
        (0x8000_0200, 0x200),
        (0x0000_0200, None),
        (0x8000_0502, None),
        (0x8000_0180, None),
        (0x8000_03FF, 0x3FF),
    ],
)
def test_the_marker_is_the_identifier_of_a_telegram_that_is_off(held: int, marker: int | None) -> None:
    assert (RESTART_MARKERS.start, RESTART_MARKERS.stop) == (0x181, 0x400)
    assert read_restart_marker(Dictionary({(0x1403, 1): held})) == marker  # type: ignore[arg-type]


def test_a_marker_counts_when_the_drive_has_kept_it() -> None:
    keeps = Dictionary({(0x1403, 1): 0x8000_0502})
    assert write_restart_marker(keeps, 2, 0x200)  # type: ignore[arg-type]
    assert keeps.values[0x1403, 1] == 0x8000_0200
    assert write_restart_marker(keeps, 2, None)  # type: ignore[arg-type]
    assert keeps.values[0x1403, 1] == 0x8000_0502
    forgets = Dictionary({(0x1403, 1): 0x8000_0502})
    forgets.fixed.add((0x1403, 1))
    assert not write_restart_marker(forgets, 2, 0x200)  # type: ignore[arg-type]
    in_use = Dictionary({(0x1403, 1): 0x0000_0502})
    assert not write_restart_marker(in_use, 2, 0x200)  # type: ignore[arg-type]
    assert not in_use.written


@pytest.mark.parametrize(
    ("word", "on"),
    [(0x27, True), (0x07, True), (0x0F, True), (0x40, False), (0x21, False), (0x23, False), (0x08, False)],
)
def test_parameters_wait_while_there_is_torque(word: int, on: bool) -> None:
    node = remote_node(Wire())
    node.sdo = Dictionary({(0x6041, 0): word})  # type: ignore[assignment]
    if on:
        with pytest.raises(CommandRefused, match="parameters wait"):
            refuse_energised(node)
    else:
        refuse_energised(node)


def drive_of(values: dict[Place, int]) -> tuple[object, Dictionary]:
    node = remote_node(Wire())
    plate = {(0x1000, 0): 402, (0x1018, 1): 0x11, (0x1018, 2): 0x22, (0x1018, 3): 0, (0x1018, 4): 7}
    sdo = Dictionary({(0x6041, 0): 0x40, **plate, **values})
    node.sdo = sdo  # type: ignore[assignment]
    return node, sdo


def test_a_backup_is_written_to_the_same_model_and_compared() -> None:
    node, sdo = drive_of({(0x6085, 0): 1, (0x6086, 0): 0})
    sdo.fixed.add((0x6086, 0))
    kept = {"drive": "00000011-00000022-8", "values": {"6085:00": "0a000000", "6086:00": "01000000"}}
    wrong = restore(node, kept)  # type: ignore[arg-type]
    assert [line[:7] for line in wrong] == ["6086:00"]
    assert sdo.values[0x6085, 0] == 10
    for other in ("00000011-00000023-7", "00000012-00000022-7"):
        node, sdo = drive_of({(0x6085, 0): 1})
        with pytest.raises(CommandRefused, match="another kind of drive"):
            restore(node, {**kept, "drive": other})  # type: ignore[arg-type]
        assert not sdo.written


def test_a_fault_is_reset_by_an_edge_that_enables_nothing() -> None:
    node, sdo = drive_of({(0x6041, 0): 0x08})
    assert reset_fault(node) is DriveState.FAULT  # type: ignore[arg-type]
    assert sdo.written == [(0x6040, 0, 0x00), (0x6040, 0, 0x80), (0x6040, 0, 0x00)]


# --- nodes beside the drive ---------------------------------------------------------------------------------------

# 16 outputs and 10 inputs; by CiA 401 and decision 0012: FFh in 6206 takes the error value, which is 0 in 6207.
IO_OBJECTS = {
    (0x1005, 0): 0x80, (0x1019, 0): 0, (0x1006, 0): 4000, (0x1007, 0): 0, (0x1016, 1): 0x007F_0096, (0x1017, 0): 50,
    (0x1029, 1): 0, (0x1400, 5): 50,
    (0x6002, 1): 0, (0x6002, 2): 0,
    (0x6202, 1): 0, (0x6206, 1): 0xFF, (0x6207, 1): 0, (0x6202, 2): 0, (0x6206, 2): 0xFF, (0x6207, 2): 0,
}  # fmt: skip
NEEDED = {(0x1016, 1), (0x6206, 1), (0x6206, 2), (0x6207, 1), (0x6207, 2)}
NOTHING = InputBits(*[None] * len(InputBits._fields))


@pytest.mark.parametrize(
    ("outputs", "holds"),
    [
        (OutputBits(brake_release=8), True), (OutputBits(watchdog=8), True), (OutputBits(drive_enable=8), True),
        (OutputBits(horn=8, lamp=0, in_position=1, at_rest=2), False),
    ],
)  # fmt: skip
def test_what_an_io_node_must_have(outputs: OutputBits, holds: bool) -> None:
    io = IoNode(
        remote_node(Wire()),
        settings(),
        IoNodeSettings(3, NOTHING._replace(brake_open=9), outputs),
        lambda: True,
    )
    found = {(row.obj, row.sub): row for row in io.node._objects}
    wanted = IO_OBJECTS if holds else {place: v for place, v in IO_OBJECTS.items() if place != (0x1400, 5)}
    assert {place: row.value for place, row in found.items()} == wanted
    assert {place for place, row in found.items() if row.needed} == (NEEDED if holds else set())


def test_a_node_that_keeps_another_value_is_refused() -> None:
    remote = remote_node(Wire())
    row = NodeObject(0x6206, 1, 1, 0xFF, "outputs take their error values", needed=True)
    node = BusNode(
        remote, settings(), "I/O", m.Mapping((), (m.Pdo(0, (m.STATUSWORD,)),)), (row,), lambda: True
    )
    for fixed, refused in ((False, False), (True, True)):
        remote.sdo = sdo = Dictionary({(0x6206, 1): 0}, {0x6206: 1})  # type: ignore[assignment]
        sdo.fixed = {(0x6206, 1)} if fixed else set()
        if refused:
            with pytest.raises(DeviceError, match="6206:01 is 0h, written FFh"):
                node._holds(row)
        else:
            assert node._holds(row)
    remote.sdo = Dictionary({})  # type: ignore[assignment]
    with pytest.raises(DeviceError, match="6206:01"):
        node._holds(row)
    assert not node._holds(row._replace(needed=False))


@pytest.mark.parametrize(
    ("place", "held", "refused"),
    [
        ((0x1005, 0), 0x81, True), ((0x1007, 0), 2000, True), ((0x1019, 0), 10, True),
        # What keeps none of its telegrams from counting; what is right, or is not there.
        ((0x1006, 0), 0, False), ((0x1029, 1), 1, False), ((0x1007, 0), 0, False), ((0x1007, 0), None, False),
    ],
)  # fmt: skip
def test_a_node_whose_telegrams_would_not_count_is_refused(
    place: Place, held: int | None, refused: bool
) -> None:
    """Read-only, with another value than it must have."""
    rows = {(row.obj, row.sub): row for row in communication_objects(settings(), False)}
    remote = remote_node(Wire())
    mapping = m.Mapping((), (m.Pdo(0, (m.STATUSWORD,)),))
    node = BusNode(remote, settings(), "I/O", mapping, rows.values(), lambda: True)
    remote.sdo = sdo = Dictionary({} if held is None else {place: held})  # type: ignore[assignment]
    sdo.refused = {place: READ_ONLY}
    if refused:
        with pytest.raises(DeviceError, match=rows[place].meaning):
            node._holds(rows[place])
    else:
        assert node._holds(rows[place]) is (held == rows[place].value)


def test_a_node_takes_sync_without_a_counter_before_it_gets_the_period() -> None:
    remote, rows = remote_node(Wire()), communication_objects(settings(), False)
    mapping = m.Mapping((), (m.Pdo(0, (m.STATUSWORD,)),))
    node = BusNode(remote, settings(), "I/O", mapping, rows, lambda: True)
    remote.sdo = sdo = CountedSync({(0x1019, 0): 10, (0x1006, 0): 4000}, {0x1019: 1})  # type: ignore[assignment]
    assert [row.obj for row in rows if node._holds(row)] == [0x1019, 0x1006]
    assert sdo.written == [(0x1006, 0, 0), (0x1019, 0, 0), (0x1006, 0, 4000)]
