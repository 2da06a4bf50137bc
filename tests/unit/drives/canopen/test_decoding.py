"""Frames in words: every kind of frame, the objects in it, and units that the bus itself has told."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gantryctl.drives.canopen.decoding.decoder import DecodedFrame, FrameDecoder, Kind
from gantryctl.drives.canopen.decoding.objects import object_value
from gantryctl.drives.canopen.settings import LoadEncoderSettings
from gantryctl.drives.od.standard import STANDARD
from gantryctl.machine import configs_folder, load_machine
from gantryctl.trace.frames.ring import BusFrame
from gantryctl.wiring.canopen import canopen_settings

pytestmark = pytest.mark.can


def decode(decoder: FrameDecoder, can_id: int, data: str, *, sent: bool = False) -> DecodedFrame:
    return decoder.decode(BusFrame(0.0, can_id, bytes.fromhex(data), sent))


@pytest.mark.parametrize(
    ("can_id", "data", "kind", "node", "text"),
    [
        (0x000, "0102", Kind.NMT, 2, "start, node 2"),
        (0x000, "8200", Kind.NMT, None, "reset communication, all nodes"),
        (0x000, "77", Kind.NMT, None, "of a wrong length"),
        (0x080, "", Kind.SYNC, None, ""),
        (0x082, "3081110000000000", Kind.EMCY, 2, "EMCY 8130: the drive missed the controller's heartbeat"),
        (0x082, "00", Kind.EMCY, 2, "too short"),
        (0x702, "05", Kind.HEARTBEAT, 2, "operational"),
        (0x702, "", Kind.HEARTBEAT, 2, "no known state"),
        (0x77F, "7f", Kind.HEARTBEAT, 127, "pre-operational"),
        (0x602, "4041600000000000", Kind.SDO, 2, "read: 6041:00 Statusword"),
        (0x582, "6085600000000000", Kind.SDO, 2, "written: 6085:00 Quick stop deceleration"),
        (0x582, "8085600030000906", Kind.SDO, 2, "refused: object 6085:00: value out of range"),
        (0x582, "4108100017000000", Kind.SDO, 2, "answer: 1008:00 Manufacturer device name, in segments"),
        (0x602, "6000000000000000", Kind.SDO, 2, "a segment of a transfer"),
        (0x582, "c6", Kind.SDO, 2, "of a wrong length"),
        (0x185, "0102", Kind.TPDO, 5, "TPDO 1, its objects are not known"),
        (0x500, "", Kind.OTHER, None, ""),
        (0x7E5, "04", Kind.OTHER, None, ""),  # layer setting services
    ],
)
def test_what_a_frame_is(can_id: int, data: str, kind: Kind, node: int | None, text: str) -> None:
    found = decode(FrameDecoder(), can_id, data)
    assert (found.kind, found.node) == (kind, node)
    assert str(found).startswith(text)
    assert bool(text) or str(found) == ""


# Two objects in TPDO 1 of node 2 at its usual identifier, as a master writes them.
MAPPED = ("2f001a0000000000", "23001a0110004160", "23001a0220006460", "2f001a0002000000", "2300180182010040")


def mapped(*more: tuple[int, str]) -> FrameDecoder:
    decoder = FrameDecoder()
    for data in MAPPED:
        decode(decoder, 0x602, data)
    for can_id, data in more:
        decode(decoder, can_id, data)
    return decoder


def test_a_telegram_has_the_objects_that_the_bus_has_put_into_it() -> None:
    telegram = decode(mapped(), 0x182, "371200000100")
    assert [(each.place, each.name, each.value) for each in telegram.objects] == [
        ("6041:00", "Statusword", 0x1237), ("6064:00", "Position actual value", 0x10000),
    ]  # fmt: skip
    assert "1237h operation enabled, remote, follows command" in str(telegram)


def test_another_identifier_and_another_mapping_are_followed() -> None:
    decoder = mapped((0x602, "2300180185020000"))  # TPDO 1 to identifier 285h
    assert decode(decoder, 0x285, "371200000100").node == 2
    assert decode(decoder, 0x285, "371200000100").objects
    decode(decoder, 0x602, "2f001a0001000000")  # one object only
    assert [each.place for each in decode(decoder, 0x285, "3712").objects] == ["6041:00"]


def test_a_telegram_that_was_switched_off_is_none_of_the_nodes() -> None:
    decoder = mapped((0x602, "2300180185020000"), (0x602, "2300180185020080"))
    # 285h is TPDO 2 of node 5 by the pre-defined connection set.
    assert decode(decoder, 0x285, "3712").node == 5


@pytest.mark.parametrize("data", ["3712", "37120000010000"])
def test_a_telegram_of_another_length_is_told(data: str) -> None:
    assert f"{len(data) // 2} bytes of 6" in str(decode(mapped(), 0x182, data))


def test_units_are_those_that_the_drive_has_told() -> None:
    units = (
        (0x582, "438f600100000800"),  # 524288 increments
        (0x582, "438f600201000000"),  # in one turn
        (0x582, "43a960000003b500"),  # velocities in increments a second
        (0x582, "43766000e8eb0300"),  # 257 N m
    )
    decoder = mapped(*units)
    assert "6064:00 Position actual value = 262144 (0.50000 turns)" in str(
        decode(decoder, 0x182, "371200000400")
    )
    # 524288 increments a second are one turn a second.
    assert "= 524288 (60.000 r/min)" in str(decode(decoder, 0x602, "23ff600000000800"))
    # 1000 is the rated torque.
    assert "= 1000 (257.00 N m)" in str(decode(decoder, 0x582, "4b776000e8030000"))
    assert "= -500 (-128.50 N m)" in str(decode(decoder, 0x582, "4b7760000cfe0000"))


def test_without_units_a_number_is_a_number() -> None:
    assert str(decode(mapped(), 0x602, "23ff600000000800")) == "write: 60FF:00 Target velocity = 524288"
    assert "= 1000 (100.0 % of the rated torque)" in str(decode(mapped(), 0x582, "4b776000e8030000"))


def test_the_machine_file_completes_what_a_log_does_not_tell() -> None:
    settings = canopen_settings(load_machine(configs_folder() / "hust_can.toml"))
    decoder = FrameDecoder(settings)
    assert "(60.000 r/min)" in str(decode(decoder, 0x602, "23ff600000000800"))  # inc/s, 524288 a turn
    assert "mains_ready" in str(decode(decoder, 0x582, "43fd600000000400"))  # bit 18
    # 1000 is the rated torque, 257 N m by the file until the drive tells its own.
    assert "= 1000 (257.00 N m)" in str(decode(decoder, 0x582, "4b776000e8030000"))
    decode(decoder, 0x582, "43766000e0930400")  # 300 N m
    assert "= 1000 (300.00 N m)" in str(decode(decoder, 0x582, "4b776000e8030000"))


def test_the_ring_counts_in_steps_of_its_own_encoder() -> None:
    """A quarter of 2^20 steps; the motor's turn has 2^19 increments, which say nothing of the ring."""
    motor = canopen_settings(load_machine(configs_folder() / "hust_can.toml"))
    data = "43e4600100000400"
    for source, text in ((None, "= 262144 (0.2500000 turns of the axis)"), (4, "= 262144")):
        ring = LoadEncoderSettings(source, 1 << 20, 0, inverted=False)
        decoder = FrameDecoder(replace(motor, load_encoder=ring))
        assert str(decode(decoder, 0x582, data)).endswith(text)
    assert str(decode(FrameDecoder(motor), 0x582, data)).endswith("= 262144")


def test_an_eds_tells_the_telegrams_of_a_log_that_begins_later() -> None:
    described = {(0x1A00, 0): 1, (0x1A00, 1): 0x6041_0010}
    assert [each.place for each in decode(FrameDecoder(None, described), 0x182, "3712").objects] == [
        "6041:00"
    ]


@pytest.mark.parametrize("can_id", [0x182, 0x582, 0x602, 0x000, 0x082, 0x702, 0x7FF])
@pytest.mark.parametrize("length", range(9))
def test_nothing_on_a_bus_raises(can_id: int, length: int) -> None:
    decoder = mapped()
    for fill in (0x00, 0x23, 0x40, 0x80, 0xFF):
        assert str(decode(decoder, can_id, bytes((fill,) * length).hex())) is not None


def test_room_that_a_telegram_leaves_empty_is_no_object() -> None:
    """An entry 0005:00 of 8 bits is a data type of CiA 301: a byte that nobody reads."""
    decoder = FrameDecoder()
    for data in (
        "2f001a0000000000",
        "23001a0108000500",
        "23001a0210004160",
        "2f001a0002000000",
        "2300180182010040",
    ):
        decode(decoder, 0x602, data)
    (found,) = decode(decoder, 0x182, "ff3706").objects
    assert str(found).startswith("6041:00")


@pytest.mark.parametrize(
    ("index", "sub", "data", "value", "text"),
    [
        (0x6040, 0, "0F 00", 0x0F, "000Fh enable operation"), (0x6040, 0, "0B 00", 0x0B, "000Bh a combination of bits"),
        (0x603F, 0, "10 23", 0x2310, "EMCY 2310: overcurrent"), (0x6041, 0, "37 12", 0x1237, "1237h operation enabled"),
        (0x60FD, 0, "01 00 01 00", 0x0001_0001, "00010001h"), (0x1005, 0, "80 00 00 00", 0x80, "80h (128)"),
        (0x1A00, 1, "10 00 41 60", 0x6041_0010, "60410010h Statusword"), (0x1A00, 0, "03", 3, "3"),
        (0x6077, 0, "64 00", 100, "100 (10.0 % of the rated torque)"), (0x1008, 0, "61 62", "ab", "'ab'"),
        # Of another length than the standard has: with the sign that it has, or as it came.
        (0x6061, 0, "F7 FF", -9, "-9"), (0x6041, 0, "40", 0x40, "0040h switch on disabled"),
        (0x2345, 6, "07 00", 7, "7"),
    ],
)  # fmt: skip
def test_an_object_without_a_machine_file(index: int, sub: int, data: str, value: object, text: str) -> None:
    found = object_value(index, sub, bytes.fromhex(data), {}, None)
    assert found.value == value
    assert found.text.startswith(text)


@pytest.mark.parametrize("length", range(9))
def test_an_object_of_any_length_has_a_text(length: int) -> None:
    """A node may send fewer or more bytes than the standard has for an object."""
    for index, sub in STANDARD:
        assert object_value(index, sub, b"\xff" * length, {}, None).text


def test_another_telegram_of_the_same_node_stays_when_one_is_mapped_anew() -> None:
    second = ("2f011a0000000000", "23011a0120006c60", "2f011a0001000000", "2301180182020040")
    decoder = mapped(*((0x602, data) for data in second))
    decode(decoder, 0x602, "2300180182010080")  # TPDO 1 is switched off
    (speed,) = decode(decoder, 0x282, "0a000000").objects
    assert (speed.obj, speed.value) == (0x606C, 10)
