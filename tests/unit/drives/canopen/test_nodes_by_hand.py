"""Nodes beside the drive by hand: contacts by SDO, telegrams against SDO, what is lost, the range of the ring."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.drives.canopen import mapping as m
from gantryctl.drives.canopen.nodes.bus_node import BusNode
from gantryctl.drives.canopen.nodes.io_node import IoNode
from gantryctl.drives.canopen.nodes.neighbours import Neighbours
from gantryctl.drives.canopen.nodes.ring_encoder import RingEncoder
from gantryctl.drives.canopen.settings import InputBits, IoNodeSettings, LoadEncoderSettings, OutputBits
from gantryctl.errors import DeviceError
from gantryctl.image import LinkFlag
from unit.drives.canopen.dictionary import Dictionary, settings
from unit.drives.canopen.test_set_up_by_hand import NOTHING
from unit.drives.canopen.wire import Wire, remote_node

pytestmark = pytest.mark.can

CONTACTS = NOTHING._replace(brake_open=9, watchdog_closed=10)
RING = LoadEncoderSettings(4, 1 << 20, 0, inverted=False)


def neighbours(**changes: object) -> Neighbours:
    return Neighbours(remote_node(Wire()), settings(**changes), lambda: True)


@pytest.mark.parametrize(
    ("second", "brake", "watchdog"), [(0x00, False, False), (0x02, True, False), (0x04, False, True)]
)
def test_each_contact_at_the_node_is_asked_for_at_its_own_bit(
    second: int, brake: bool, watchdog: bool
) -> None:
    """Inputs 9 and 10 are bits 1 and 2 of 6000:02."""
    beside = neighbours(io=IoNodeSettings(3, CONTACTS, OutputBits()))
    assert beside.io is not None
    beside.io.node.remote.sdo = Dictionary({(0x6000, 1): 0xFF, (0x6000, 2): second}, {0x6000: 1})  # type: ignore[assignment]
    assert (beside.ask_brake_contact(), beside.ask_watchdog_contact()) == (brake, watchdog)


@pytest.mark.parametrize(
    ("word", "brake", "watchdog"), [(1 << 16, True, False), (1 << 17, False, True), (None, None, None)]
)
def test_each_contact_at_the_drive_is_asked_for_at_its_own_bit(
    word: int | None, brake: bool | None, watchdog: bool | None
) -> None:
    beside = neighbours(inputs=NOTHING._replace(brake_open=16, watchdog_closed=17))
    beside._drive.sdo = Dictionary({} if word is None else {(0x60FD, 0): word})  # type: ignore[assignment]
    assert (beside.ask_brake_contact(), beside.ask_watchdog_contact()) == (brake, watchdog)
    nowhere = neighbours(inputs=InputBits())
    nowhere._drive.sdo = beside._drive.sdo
    assert (nowhere.ask_brake_contact(), nowhere.ask_watchdog_contact()) == (None, None)


def test_an_angle_of_the_ring_is_carried_on_for_30_ms_and_not_believed_any_longer() -> None:
    """A quarter of a turn, 10 mrad on 10 ms later; then nothing comes. At 10 ms three scans are too old."""
    beside = neighbours(load_encoder=RING._replace(node=None), period_s=0.010)
    beside.open()
    turn = 1 << 20
    angles = []
    for raw, age in (
        (turn // 4, 0),
        (turn // 4 + round(0.010 / math.tau * turn), 0),
        (0, 1),
        (0, 2),
        (0, 3),
        (0, 4),
    ):
        beside.begin(1)
        process: Any = SimpleNamespace(ring=(raw, age))
        angles.append(beside.ring_rad(process))
    assert angles[:4] == pytest.approx(np.pi / 2.0 + np.array([0.0, 0.010, 0.020, 0.030]), abs=1e-5)
    assert all(math.isnan(angle) for angle in angles[4:])


@pytest.mark.parametrize(
    ("heard", "flags"),
    [
        ((0, 1), LinkFlag.NONE), ((1,), LinkFlag.IO_LOST), ((0,), LinkFlag.LOAD_ENCODER_LOST),
        ((), LinkFlag.IO_LOST | LinkFlag.LOAD_ENCODER_LOST),
    ],
)  # fmt: skip
def test_each_node_that_is_not_heard_has_a_flag_of_its_own(heard: tuple[int, ...], flags: LinkFlag) -> None:
    beside = neighbours(io=IoNodeSettings(3, CONTACTS, OutputBits()), load_encoder=RING)
    for number in heard:
        beside.nodes[number].watch.data = b"\0"
    assert beside.flags(commanded=True) == flags


@pytest.mark.parametrize(
    ("trouble", "lost"),
    [
        (LinkFlag.NONE, False),
        (LinkFlag.ERROR_PASSIVE, False),
        (LinkFlag.BUS_OFF | LinkFlag.ERROR_PASSIVE, True),
    ],
)
def test_a_node_that_is_heard_is_not_lost_by_a_warning_of_the_bus(trouble: LinkFlag, lost: bool) -> None:
    """Error passive is a warning; a bus controller that is bus-off hears nobody."""
    beside = neighbours(io=IoNodeSettings(3, CONTACTS, OutputBits()))
    beside.nodes[0].watch.data = b"\0"
    link = beside.nodes[0].remote.link
    link.trouble, link.down = trouble, bool(trouble & LinkFlag.BUS_OFF)  # type: ignore[misc]
    assert beside.flags(commanded=True) == (LinkFlag.IO_LOST if lost else LinkFlag.NONE)


@pytest.mark.parametrize(("deadline_ms", "limit_s"), [(50, 0.05), (0, 0.15), (100, 0.15), (None, 0.15)])
def test_outputs_fall_after_the_deadline_that_the_node_has_or_the_heartbeat(
    deadline_ms: int | None, limit_s: float
) -> None:
    """1400:05 = 50 ms was written; a node that has another value, or none, misses the heartbeat after 150 ms."""
    io = IoNode(
        remote_node(Wire()),
        settings(),
        IoNodeSettings(3, CONTACTS, OutputBits(brake_release=0)),
        lambda: True,
    )
    io.node.remote.sdo = Dictionary({} if deadline_ms is None else {(0x1400, 5): deadline_ms})  # type: ignore[assignment]
    assert io.ask_silence_limit_s() == limit_s


def two_bytes(noise: int = 0) -> BusNode:
    """A node with a telegram of 6000:01 and 6000:02, which says 10h and 20h."""
    telegram = m.Pdo(0, (m.Signal(0x6000, 1, 8, False), m.Signal(0x6000, 2, 8, False)))
    node = BusNode(
        remote_node(Wire()), settings(), "I/O", m.Mapping((), (telegram,)), (), lambda: True, noise
    )
    node.watch.data = b"\x10\x20"
    return node


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        (0x10, 0x20, []), (0x10, 0x22, []), (0x10, 0x1E, []), (0x10, 0x23, ["6000:02 is 23h by SDO and 20h"]),
        (0x10, 0x1D, ["6000:02 is 1Dh by SDO and 20h"]), (0x13, 0x20, ["6000:01 is 13h by SDO and 10h"]),
        (0x20, 0x10, ["6000:01 is 20h by SDO and 10h", "6000:02 is 10h by SDO and 20h"]),
    ],
)  # fmt: skip
def test_a_telegram_says_what_sdo_says_object_by_object(first: int, second: int, said: list[str]) -> None:
    """Two steps of noise are no difference, up or down."""
    node = two_bytes(noise=2)
    node.remote.sdo = Dictionary({(0x6000, 1): first, (0x6000, 2): second}, {0x6000: 1})  # type: ignore[assignment]
    assert [line.partition(" in its telegram")[0] for line in node.compare()] == said


def test_a_node_that_says_nothing_is_compared_with_nothing() -> None:
    node = two_bytes()
    node.watch.data = None
    with pytest.raises(DeviceError, match="does not answer SYNC"):
        node.compare()


def test_a_node_goes_on_after_a_silence_unless_it_has_restarted() -> None:
    node = two_bytes()
    node.remote.state, node.remote.heartbeat_age, node._flags, node.lost = (
        0x7F,
        99,
        LinkFlag.NOT_OPERATIONAL,
        True,
    )
    node.resume()
    assert (node.remote.state, node.remote.heartbeat_age, node.lost, node.watch.data) == (
        None,
        0,
        False,
        None,
    )
    assert node.remote.link.sent == [(0x000, "01 02")]  # type: ignore[attr-defined]
    node.watch.data = b"\x10\x20"
    assert not node.judge(commanded=True)
    node.remote.boots = 1
    with pytest.raises(DeviceError, match="has restarted"):
        node.resume()


def of_cia_401(outputs: OutputBits) -> tuple[IoNode, Dictionary]:
    """A node with an identity and every object that it needs."""
    io = IoNode(
        remote_node(Wire()),
        settings(),
        IoNodeSettings(3, NOTHING._replace(brake_open=0), outputs),
        lambda: True,
    )
    plate = {(0x1000, 0): 401, (0x1018, 1): 0x11, (0x1018, 2): 0x22, (0x1018, 3): 0, (0x1018, 4): 7}
    sdo = Dictionary(plate | {(row.obj, row.sub): row.value for row in io.node._objects})
    sdo.values |= {(0x1800, 2): 1, (0x1400, 2): 1}
    io.node.remote.sdo = sdo  # type: ignore[assignment]
    return io, sdo


@pytest.mark.parametrize(("outputs", "sent"), [(OutputBits(), []), (OutputBits(horn=9), [(0x202, "01 02")])])
def test_a_node_is_opened_and_gets_the_outputs_that_it_has(
    outputs: OutputBits, sent: list[tuple[int, str]]
) -> None:
    io, _ = of_cia_401(outputs)
    io.node.open()
    wire = io.node.remote.link
    assert wire.sent == [(0x000, "80 02"), (0x000, "01 02")]  # type: ignore[attr-defined]
    io.send(0x0201)
    assert wire.sent[2:] == sent  # type: ignore[attr-defined]


def test_a_node_that_refuses_its_telegrams_or_is_another_one_is_not_used() -> None:
    io, sdo = of_cia_401(OutputBits())
    sdo.refused[0x1A00, 1] = 0x0604_0041
    with pytest.raises(DeviceError, match=r"I/O: object 6000:01 cannot be mapped"):
        io.node.open()
    sdo.refused = {(0x1800, 1): 0x0601_0002}
    with pytest.raises(DeviceError, match="its telegrams cannot be mapped"):
        io.node.open()
    sdo.refused.clear()
    io.node.open()
    sdo.values[0x1018, 4] = 8
    with pytest.raises(DeviceError, match="another node"):
        io.node.open()


@pytest.mark.parametrize(("watch", "written"), [(0x007F_0096, [(0x1016, 1, 0)]), (0, []), (None, [])])
def test_a_node_that_is_released_watches_nobody_any_more(
    watch: int | None, written: list[tuple[int, int, int]]
) -> None:
    io, sdo = of_cia_401(OutputBits())
    del sdo.values[0x1016, 1]
    if watch is not None:
        sdo.values[0x1016, 1] = watch
    io.node.release()
    assert (io.node.remote.link.sent, sdo.written) == ([(0x000, "80 02")], written)  # type: ignore[attr-defined]


def test_a_drive_alone_has_no_second_reading_and_nothing_to_resume() -> None:
    beside = neighbours()
    beside.open()
    beside.resume()
    assert beside.ring_rad(None) == 0.0  # type: ignore[arg-type]
    assert (beside.changed, beside.health()) == (False, ())


def test_all_nodes_beside_the_drive_are_resumed() -> None:
    beside = neighbours(io=IoNodeSettings(3, CONTACTS, OutputBits()), load_encoder=RING)
    beside.resume()
    assert beside._drive.link.sent == [(0x000, "01 03"), (0x000, "01 04")]  # type: ignore[attr-defined]


def ring(steps: int, turns: int) -> RingEncoder:
    """An encoder of 2^20 steps in a turn of the axis that says it has so many steps and turns."""
    encoder = RingEncoder(remote_node(Wire()), settings(load_encoder=RING), RING, lambda: True)
    encoder.node.open = lambda: None  # type: ignore[method-assign]
    encoder.node.remote.sdo = Dictionary({(0x6501, 0): steps, (0x6502, 0): turns})  # type: ignore[assignment]
    encoder.open()
    return encoder


@pytest.mark.parametrize(
    ("steps", "turns"), [(1 << 20, 0), (1 << 20, 1), (1 << 20, 16), (1 << 24, 1), (1 << 20, 1 << 12)]
)
def test_the_ring_goes_on_where_its_reading_begins_anew(steps: int, turns: int) -> None:
    """Its last step, and then its first: one step of 360 / 2^20 deg further."""
    angle, last = ring(steps, turns).angle, steps * max(turns, 1) - 1
    angle.take(last, 1)
    before = angle.after(0)
    angle.take(0, 1)
    assert math.degrees(angle.after(0) - before) == pytest.approx(360.0 / (1 << 20), rel=1e-6)


def test_the_telegram_of_the_ring_is_position_and_alarms() -> None:
    """6004 with 32 bits and 6503 with 16, as a mapping object has them."""
    (telegram,) = ring(1 << 20, 1).node._mapping.tpdos
    assert [signal.entry for signal in telegram.signals] == [0x6004_0020, 0x6503_0010]
    assert (telegram.number, telegram.size) == (0, 6)


def test_an_encoder_on_the_bus_is_the_ring() -> None:
    """A quarter of 2^20 steps is 90 deg; what its telegram has not told yet, or tells with an alarm, is no angle."""
    beside = neighbours(load_encoder=RING)
    assert beside.encoder is not None
    opened: list[bool] = []
    beside.encoder.node.open = lambda: opened.append(True)  # type: ignore[method-assign]
    beside.encoder.node.remote.sdo = Dictionary({(0x6501, 0): 1 << 20, (0x6502, 0): 1})  # type: ignore[assignment]
    beside.open()
    assert opened == [True]
    assert math.isnan(beside.ring_rad(None))  # type: ignore[arg-type]
    quarter = (1 << 18).to_bytes(4, "little")
    # An alarm is no part of the position: a telegram that is missing behind it is bridged at rest.
    for alarms, angle_deg in (
        (b"\0\0", 90.0), (b"\0\1", math.nan), (b"\2\0", math.nan), (b"\0\0", 90.0), (None, 90.0),
    ):  # fmt: skip
        beside.begin(1)
        if alarms is not None:
            beside.encoder.node.watch.take(quarter + alarms, True)
        beside.encoder.node.watch.settle()
        angle = beside.ring_rad(None)  # type: ignore[arg-type]
        assert math.degrees(angle) == pytest.approx(angle_deg, nan_ok=True)


def test_an_encoder_need_not_watch_the_controller() -> None:
    """1016: it does nothing that would have to stop with it."""
    assert not any(row.needed for row in ring(1 << 20, 1).node._objects)


def test_an_encoder_with_less_than_a_turn_is_refused() -> None:
    with pytest.raises(DeviceError, match="the encoder has 1048575 steps"):
        ring((1 << 20) - 1, 1)
