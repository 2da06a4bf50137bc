"""A drive or a bus that refuses or stays silent: silence is an error everywhere, a refusal where it matters."""

from __future__ import annotations

from typing import Any

import can
import pytest

from gantryctl.drives.canopen import mapping as m
from gantryctl.drives.canopen.bus import link as bus_link
from gantryctl.drives.canopen.bus import lock
from gantryctl.drives.canopen.bus.block_transfer import download, upload
from gantryctl.drives.canopen.bus.link import UDP_GROUP, BusLink, Frame, open_bus
from gantryctl.drives.canopen.bus.node import NodeIdentity
from gantryctl.drives.canopen.bus.requests import SdoRequests
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError, _Exchange
from gantryctl.drives.canopen.setup import parameter_check as check
from gantryctl.drives.canopen.setup.gains import read_gains
from gantryctl.drives.canopen.setup.live_facts import read_facts, read_only_of, with_mapped
from gantryctl.drives.canopen.setup.opening import (
    _takes_csv,
    read_restart_marker,
    wanted_of,
    write_restart_marker,
)
from gantryctl.drives.canopen.setup.parameters import check_backup, restore
from gantryctl.drives.canopen.setup.survey import survey
from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.profiles import load_profile
from gantryctl.errors import DeviceError
from gantryctl.image import OutputImage
from unit.drives.canopen.canopen_bench import Bench
from unit.drives.canopen.dictionary import READ_ONLY, Dictionary, settings
from unit.drives.canopen.test_set_up_by_hand import UNUSED, drive_of
from unit.drives.canopen.wire import NODE, Wire, remote_node

pytestmark = pytest.mark.can

SILENT = 0x0504_0000


class Silent(Dictionary):
    """From the object on that is named, it answers nothing."""

    def __init__(self, values: dict[tuple[int, int], int], *silent: int) -> None:
        super().__init__(values)
        self.silent = silent

    def _hear(self, index: int, sub: int) -> None:
        if index in self.silent:
            raise SdoError(index, sub, SILENT)

    def number(self, index: int, sub: int = 0) -> int:
        self._hear(index, sub)
        return super().number(index, sub)

    def set(self, index: int, sub: int, value: int, size: int | None = None) -> None:
        self._hear(index, sub)
        super().set(index, sub, value, size)


# --- set-up -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("index", [0x60B2, 0x1600, 0x1A00])
def test_a_drive_that_falls_silent_in_its_mapping_is_no_sparse_drive(index: int) -> None:
    sdo = Silent({**UNUSED, **{(signal.obj, 0): 0 for signal in m.OPTIONAL}}, index)
    with pytest.raises(SdoError) as raised:
        m.configure(sdo, 2, False)  # type: ignore[arg-type]
    assert raised.value.silent


def test_a_drive_that_falls_silent_in_its_parameters_is_no_sparse_drive() -> None:
    parameters = wanted_of(settings(), None)
    sdo = Silent({(p.obj, p.sub): 0 for p in parameters}, 0x6007)
    with pytest.raises(SdoError):
        check.write_parameters(sdo, parameters)  # type: ignore[arg-type]
    node = remote_node(Wire())
    node.sdo = Silent({(0x6060, 0): 0}, 0x6060)  # type: ignore[assignment]
    with pytest.raises(SdoError):
        _takes_csv(node)
    with pytest.raises(SdoError):
        read_only_of(Silent({(0x1400, 2): 1}, 0x1400), [(0x1400, 2)])  # type: ignore[arg-type]
    with pytest.raises(SdoError):
        read_facts(Silent({}, 0x6502), NodeIdentity(1, 2, 3, 4, 402, "", "", ""), [(0x6502, 0)])  # type: ignore[arg-type]
    with pytest.raises(SdoError):
        read_gains(Silent({}, *range(0x2000, 0x6000)), load_profile("maxon_epos4").speed_loop)  # type: ignore[arg-type]


def test_what_cannot_be_written_is_told_from_what_cannot_now() -> None:
    sdo = Dictionary({(0x1400, 2): 255, (0x1800, 2): 1})
    sdo.refused = {(0x1400, 2): READ_ONLY, (0x1800, 2): 0x0800_0022}
    assert read_only_of(sdo, [(0x1400, 2), (0x1800, 2)]) == {(0x1400, 2)}  # type: ignore[arg-type]


def test_an_object_that_is_not_there_is_not_unmapped() -> None:
    facts = DriveFacts(1, 2, 3, 4, "", {(0x6077, 0): ObjectFact(False, True)})
    found = with_mapped(facts, [(0x6077, 0), (0x606C, 0)])
    assert {place: fact.mappable for place, fact in found.objects.items()} == {(0x6077, 0): False}


def test_a_mode_that_is_refused_and_a_drive_without_spare_telegrams() -> None:
    node = remote_node(Wire())
    node.sdo = sdo = Dictionary({(0x6060, 0): 0})  # type: ignore[assignment]
    sdo.refused[0x6060, 0] = 0x0609_0030
    assert not _takes_csv(node)
    none = Dictionary({})
    assert read_restart_marker(none) is None  # type: ignore[arg-type]
    assert not write_restart_marker(none, 2, 0x200)  # type: ignore[arg-type]
    third = Dictionary({(0x1402, 1): 0x8000_0402})
    assert write_restart_marker(third, 2, 0x200)  # type: ignore[arg-type]
    assert read_restart_marker(third) == 0x200  # type: ignore[arg-type]


def test_a_unit_without_a_word_and_a_period_without_a_pair() -> None:
    assert 0x60A9 not in {p.obj for p in wanted_of(settings(velocity_unit="16.16 inc/ms"), None)}
    with pytest.raises(DeviceError, match="60C2"):
        check.interpolation(1_234_567)


def test_a_value_that_the_type_cannot_hold_is_refused_by_the_drive_so_to_speak() -> None:
    """6007 is INTEGER16: the write fails here, and the drive counts as one that takes no value for it."""
    parameter = check.WantedParameter(0x6007, 0, 70_000, "")
    wire = Wire()
    wire.answers["40 07 60 00 00 00 00 00"] = ["4B 07 60 00 00 00 00 00"]
    refused, codes = check.write_parameters(client(wire), [parameter])
    assert (refused, codes) == ({(0x6007, 0)}, {})


@pytest.mark.parametrize("bad", ["0FFF:00", "1000:100"])
def test_a_backup_names_objects(bad: str) -> None:
    with pytest.raises(ValueError, match="an object is written"):
        check_backup({"drive": "a-b-1", "values": {bad: "00"}})


def test_a_value_of_a_backup_that_is_refused_is_a_line_and_silence_an_error() -> None:
    kept = {"drive": "00000011-00000022-7", "values": {"6085:00": "0a000000"}}
    node, sdo = drive_of({(0x6085, 0): 1})
    sdo.refused[0x6085, 0] = 0x0609_0030
    assert "value out of range" in restore(node, kept)[0]  # type: ignore[arg-type]
    sdo.refused[0x6085, 0] = SILENT
    with pytest.raises(SdoError):
        restore(node, kept)  # type: ignore[arg-type]


# --- SDO ----------------------------------------------------------------------------------------------------------


def client(wire: Wire) -> SdoClient:
    return SdoClient(wire, NODE, lambda frame: None, 0.05)  # type: ignore[arg-type]


def test_an_object_of_another_type_is_no_number() -> None:
    wire = Wire()
    # 6041 with one byte; 1008 is a text.
    wire.answers["40 41 60 00 00 00 00 00"] = ["4F 41 60 00 37 00 00 00"]
    wire.answers["40 08 10 00 00 00 00 00"] = ["43 08 10 00 61 62 63 64"]
    with pytest.raises(DeviceError, match="6041:00"):
        client(wire).number(0x6041)
    with pytest.raises(DeviceError, match="a whole number was expected, got 'abcd'"):
        client(wire).number(0x1008)
    assert client(wire).text(0x1008) == "abcd"
    with pytest.raises(DeviceError, match="6040:00"):
        client(wire).set(0x6040, 0, 70_000)


# An object of 14 bytes in two segments, without a checksum: announced, sent, ended.
TEXT_TO_COME, SEGMENTS = "C2 00 20 00 {:02X} 00 00 00", ["01 61 62 63 64 65 66 67", "82 68 69 6A 6B 6C 6D 6E"]


@pytest.mark.parametrize(
    ("told", "most", "abort"),
    [(14, 14, ""), (14, 13, "80 00 20 00 05 00 04 05"), (15, 14, "80 00 20 00 10 00 07 06")],
)
def test_an_upload_by_blocks_that_is_too_long_or_not_as_long_as_told_is_ended(
    told: int, most: int, abort: str
) -> None:
    """CiA 301: 0504 0005h is out of memory, 0607 0010h a length that does not match."""
    wire = Wire()
    wire.answers = {
        "A4 00 20 00 7F 00 00 00": [TEXT_TO_COME.format(told)],
        "A3 00 00 00 00 00 00 00": SEGMENTS,
        "A2 02 7F 00 00 00 00 00": ["C1 00 00 00 00 00 00 00"],
    }
    exchange = _Exchange(client(wire), 0x2000, 0)
    if abort:
        with pytest.raises(SdoError):
            upload(exchange, most)
        assert wire.sent[-1] == (0x602, abort)
    else:
        assert upload(exchange, most) == b"abcdefghijklmn"


@pytest.mark.parametrize("segments", [0, 128])
def test_a_block_has_1_to_127_segments(segments: int) -> None:
    """CiA 301: 0504 0002h is an invalid block size; nothing is sent before."""
    wire = Wire()
    wire.answers = {"C6 00 20 00 0E 00 00 00": [f"A4 00 20 00 {segments:02X} 00 00 00"]}
    with pytest.raises(SdoError):
        download(_Exchange(client(wire), 0x2000, 0), bytes(14))
    assert wire.sent[1:] == [(0x602, "80 00 20 00 02 00 04 05")]


def test_a_text_that_is_refused_is_none_and_one_that_is_not_answered_an_error() -> None:
    wire = Wire()
    wire.answers["40 08 10 00 00 00 00 00"] = ["80 08 10 00 00 00 02 06"]
    assert client(wire).text(0x1008) == ""
    with pytest.raises(SdoError):
        client(Wire()).text(0x1008)


@pytest.mark.parametrize("full", [3, 1000])
def test_a_full_queue_is_waited_for_and_not_for_ever(full: int) -> None:
    wire, send, left = Wire(), Wire.send, [full]
    wire.answers["40 41 60 00 00 00 00 00"] = ["4B 41 60 00 37 12 00 00"]

    def queue(can_id: int, data: bytes) -> bool:
        left[0] -= 1
        return left[0] < 0 and send(wire, can_id, data)

    wire.send = queue  # type: ignore[method-assign]
    if full == 3:
        assert client(wire).number(0x6041) == 0x1237
    else:
        with pytest.raises(SdoError):
            client(wire).number(0x6041)
    # Two milliseconds for each try.
    assert wire.time_s >= 0.002 * min(full, 50)


def test_an_identity_without_a_device_type_and_a_drain_that_ends() -> None:
    wire = Wire()
    wire.answers["40 00 10 00 00 00 00 00"] = ["80 00 10 00 00 00 02 06"]
    for index, sub in (
        (0x1018, 1),
        (0x1018, 2),
        (0x1018, 3),
        (0x1018, 4),
        (0x1008, 0),
        (0x1009, 0),
        (0x100A, 0),
    ):
        place = f"{index & 0xFF:02X} {index >> 8:02X} {sub:02X}"
        wire.answers[f"40 {place} 00 00 00 00"] = [f"80 {place} 00 00 02 06"]
    node = remote_node(wire)
    assert node.identity()[:5] == (0, 0, 0, 0, 0)
    assert node.identity().text == "drive without a name, software ?, serial 0"
    wire.comes(0x123, *["00"] * 10)
    assert not node.drain(most=4)
    assert node.unknown == 4
    receive = wire.receive

    def slow(timeout_s: float) -> Frame | None:
        wire.time_s += 0.001
        return receive(timeout_s)

    wire.receive = slow  # type: ignore[method-assign]
    assert not node.drain(0.0015)
    assert node.unknown == 6
    assert node.drain()


def test_a_request_that_is_answered_in_segments_is_not_answered() -> None:
    wire, seen = Wire(), list[bytes | None]()
    node = remote_node(wire)
    requests = SdoRequests(node)
    requests.read(0x6064, 0, seen.append)
    node.dispatch(Frame(0x582, bytes.fromhex("41 64 60 00 08 00 00 00")))
    assert requests.waiting
    assert not seen


# --- the bus ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("interface", "channel", "bitrate", "options"),
    [
        ("udp_multicast", None, None, {"channel": UDP_GROUP}),
        ("udp_multicast", "239.0.0.7", None, {"channel": "239.0.0.7"}),
        ("socketcan", "can0", 500_000, {"channel": "can0", "bitrate": 500_000, "receive_own_messages": True}),
        ("virtual", None, None, {}),
    ],
)
def test_a_bus_is_opened_with_what_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
    interface: str,
    channel: str | None,
    bitrate: int | None,
    options: dict[str, Any],
) -> None:
    asked: list[dict[str, Any]] = []
    monkeypatch.setattr(bus_link.can, "Bus", lambda **given: asked.append(given))
    open_bus(interface, channel, bitrate)
    assert asked == [{"interface": interface, "ignore_config": True, **options}]


@pytest.mark.parametrize(
    ("channel", "place"), [(None, "(slcan)"), ("/dev/ttyX", "(slcan, channel /dev/ttyX)")]
)
def test_a_bus_that_cannot_be_opened_is_told_by_its_place(
    monkeypatch: pytest.MonkeyPatch, channel: str | None, place: str
) -> None:
    def broken(**given: object) -> None:
        raise OSError("no such device")

    monkeypatch.setattr(bus_link.can, "Bus", broken)
    with pytest.raises(DeviceError) as refused:
        open_bus("slcan", channel)
    assert str(refused.value) == f"the CAN interface cannot be opened {place}: no such device"


class Scripted(can.BusABC):
    """Gives what it is told to give."""

    def __init__(self, *given: can.Message | Exception) -> None:
        super().__init__("scripted")
        self.given, self.sent = list(given), 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent += 1

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        each = self.given.pop(0) if self.given else None
        if isinstance(each, Exception):
            raise each
        return each, False


def message(can_id: int, data: bytes = b"", **changes: Any) -> can.Message:
    return can.Message(arbitration_id=can_id, data=data, **{"is_extended_id": False, **changes})


def test_what_is_no_classic_data_frame_is_passed_over_and_counted() -> None:
    odd = (
        message(0x12345, is_extended_id=True), message(0x182, is_remote_frame=True), message(0x182, b"\1", is_fd=True),
        ValueError("no frame"), TypeError("no frame"),
    )  # fmt: skip
    link = BusLink(Scripted(*odd, message(0x182, b"\1")))
    found = [link.receive(0.0) for _ in range(6)]
    assert [frame for frame in found if frame is not None] == [Frame(0x182, b"\1")]
    assert link.ignored == 5
    link.close()
    assert not link.send(0x202, b"")
    assert link.receive(0.0) is None


def test_echoes_are_forgotten_before_they_fill_the_memory_and_by_a_take_over() -> None:
    bus = Scripted()
    link = BusLink(bus, echoes=True)
    for k in range(300):
        link.send(0x202, k.to_bytes(2, "little"))
    link.send(0x080, b"")
    assert link.unseen == 1
    # Twice the same frame: two echoes, and the third is somebody else's.
    for _ in range(2):
        link.send(0x202, b"\xff\xff")
    bus.given = [message(0x202, b"\xff\xff") for _ in range(3)] + [message(0x080)]
    assert [link.receive(0.0) for _ in range(2)] == [Frame(0x202, b"\xff\xff"), None]
    assert link.unseen == 0
    link.send(0x202, b"\1")
    bus.given = [message(0x202, b"\1"), message(0x182), message(0x701)]
    link.take_over()
    assert not bus.given
    bus.given = [message(0x202, b"\1")]
    assert link.receive(0.0) == Frame(0x202, b"\1")
    link.close()
    plain = BusLink(Scripted(message(0x182)))
    plain.take_over()
    assert plain.receive(0.0) is None
    plain.pause(0.0)
    plain.pace(0.0)
    plain.close()


def test_a_lock_elsewhere_than_on_linux_holds_nothing_and_a_holder_may_have_gone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert lock._holder("\0gantryctl drive nobody") == "unknown"
    monkeypatch.setattr(lock.sys, "platform", "win32")
    held = lock.DriveLock("can0, node 2")
    lock.DriveLock("can0, node 2").release()
    held.release()


def test_a_drive_that_was_closed_is_told_nothing_more() -> None:
    bench = Bench().open()
    before = bench.drive.read()
    bench.drive.close()
    bench.drive.write(OutputImage())
    assert bench.drive.read() is before
    bench.drive.close()
    with pytest.raises(DeviceError):
        bench.drive.open()


# --- survey -------------------------------------------------------------------------------------------------------

PLATE = {(0x1000, 0): 402, (0x1018, 1): 0x7FF, (0x1018, 2): 1, (0x1018, 3): 1, (0x1018, 4): 1}
SAFE = {
    (0x6041, 0): 0x40, (0x6502, 0): 0x100, (0x6007, 0): 1, (0x605E, 0): 2, (0x605A, 0): 2, (0x1016, 1): 1,
    (0x1400, 5): 50, (0x1005, 0): 0x80, (0x603F, 0): 0,
}  # fmt: skip
OF_TWO_BYTES = (0x6041, 0x6007, 0x605E, 0x605A, 0x6072, 0x1400, 0x603F)


def surveyed(changes: dict[tuple[int, int], int | None]) -> tuple[str, ...]:
    """Remarks of a drive that is safe but for these objects; None takes one away."""
    held = {place: value for place, value in (PLATE | SAFE | changes).items() if value is not None}
    wire = Wire()
    send = wire.send

    def answer(can_id: int, data: bytes) -> bool:
        done = send(can_id, data)
        place = data[1] | data[2] << 8, data[3]
        head = data[1:4].hex()
        value = held.get(place)
        if value is None:
            text = f"80{head}00000206"
        else:
            text = f"{'4B' if place[0] in OF_TWO_BYTES else '43'}{head}{value.to_bytes(4, 'little').hex()}"
        wire.comes(0x580 + NODE, text)
        return done

    wire.send = answer  # type: ignore[method-assign]
    wire.comes(0x702, "7F", "")
    wire.comes(0x123, "00")
    (found,) = survey(wire, 0.01, range(NODE, NODE + 1))  # type: ignore[arg-type]
    return found.remarks


def test_a_survey_asks_every_node_although_the_transmit_queue_is_full() -> None:
    """The queue has room for four frames, and the bus takes one in 1 ms: 125 kbit/s."""
    wire, asked, sent_s = Wire(), list[int](), list[float]()

    def send(can_id: int, data: bytes) -> bool:
        full = len([at for at in sent_s if at > wire.time_s]) >= 4
        if not full:
            sent_s.append(max([wire.time_s, *sent_s[-1:]]) + 0.001)
            asked.append(can_id)
        return not full

    wire.send = send  # type: ignore[method-assign]
    assert survey(wire, 0.01) == ()  # type: ignore[arg-type]
    assert asked == [0x600 + node for node in range(1, 128)]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, ""),
        ({(0x1000, 0): 401}, "the low half of a drive"),
        ({(0x6502, 0): None}, "no 6502"),
        ({(0x6502, 0): 0x4}, "6502 has no CSV"),
        ({(0x6007, 0): 0}, "a silent master lets this axis run on"),
        ({(0x605E, 0): 0}, "605E = 0"),
        ({(0x605A, 0): 0}, "605A = 0"),
        ({(0x1016, 1): None, (0x1400, 5): None}, "nothing in this drive watches the controller"),
        ({(0x1016, 1): 0, (0x1400, 5): 0}, "nothing watches the controller"),
        ({(0x1016, 1): 0, (0x1400, 5): None}, "nothing watches the controller"),
        ({(0x1016, 1): 0}, ""),
        ({(0x1400, 5): 0}, ""),
        ({(0x1016, 1): None}, ""),
        ({(0x1005, 0): None}, "1005 is not 80h"),
        ({(0x1005, 0): 0x81}, "1005 is not 80h"),
        ({(0x603F, 0): None}, "no 603F"),
        ({(0x6041, 0): None}, "no CiA 402 drive"),
    ],
)
def test_a_survey_names_each_danger(changes: dict[tuple[int, int], int | None], words: str) -> None:
    said = " | ".join(surveyed(changes))
    assert words in said
    assert bool(said) is bool(words)


def test_a_survey_names_the_profile_and_what_a_maker_delivers() -> None:
    """An Elmo drive that has the ramp of the factory, and another limit of torque than that."""
    profile, ramp = surveyed({(0x1018, 1): 0x9A, (0x6085, 0): 2_000_000_000, (0x6072, 0): 1498})
    assert profile.startswith("profile elmo_gold (")
    assert ramp.startswith("6085:00 = 2000000000 as delivered: no ramp to speak of")
