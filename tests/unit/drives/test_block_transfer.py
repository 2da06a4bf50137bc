"""SDO block transfer: our client against our server and the canopen library, its client against our server, over a
bus that loses, doubles and reorders frames.
"""

from __future__ import annotations

import queue
import random
import struct
from collections.abc import Callable, Iterator

import can
import canopen
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.drives.canopen.bus.block_transfer import crc
from gantryctl.drives.canopen.bus.link import BusLink
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError
from gantryctl.drives.od.model import Access, DeviceDescription, Entry, ObjectKind, ObjectSpec
from gantryctl.drives.od.types import DataType
from gantryctl.drives.virtual.communication.block_transfer import checksum
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.sdo import SdoServer

pytestmark = pytest.mark.can

NODE, RESPONSE = 2, 0x582
TEXT, READ_ONLY = 0x2000, 0x2001
TEXT_SIZE = 300
"""Bytes: 43 segments."""
FAULTS = ("lost", "twice", "swapped")


def dictionary(data: bytes) -> Dictionary:
    """An object that may be written, and one that may only be read."""
    objects = {}
    for index, access in ((TEXT, Access.RW), (READ_ONLY, Access.RO)):
        entry = Entry(index, 0, "text", DataType.OCTET_STRING, access, default=data)
        objects[index] = ObjectSpec(index, "text", ObjectKind.VAR, {0: entry})
    device = DeviceDescription(objects)
    return Dictionary(device, device, NODE)


class ServerBus(can.BusABC):
    """A bus with our server on its other end; `spoil` gives the fate of each frame, by its number and direction.

    A swapped frame comes behind the next one, or when nothing follows it.
    """

    channel_info = "server"

    def __init__(self, server_data: bytes = b"", *, blocks: bool = True) -> None:
        self.od = dictionary(server_data)
        self.now_s = 0.0
        self.server = SdoServer(self.od, blocks, lambda: self.now_s)
        self.waiting: queue.Queue[bytes] = queue.Queue()
        self.spoil: Callable[[int, bool], str] = lambda number, down: ""
        self.number = 0
        self.held: dict[bool, bytes] = {}
        self.asked: list[int] = []
        self._can_protocol = can.CanProtocol.CAN_20
        super().__init__(channel="server")

    def _through(self, data: bytes, *, down: bool) -> Iterator[bytes]:
        fate = self.spoil(self.number, down)
        self.number += 1
        if fate == "swapped":
            self.held[down] = data
            return
        if fate == "bent":
            data = data[:-1] + bytes((data[-1] ^ 1,))
        if fate != "lost":
            yield data
        if fate == "twice":
            yield data
        if down in self.held:
            yield self.held.pop(down)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        for request in list(self._through(bytes(msg.data), down=True)):
            self._serve(request)

    def _serve(self, request: bytes) -> None:
        self.asked.append(request[0])
        for response in self.server.answer(request):
            for arriving in self._through(response, down=False):
                self.waiting.put(arriving)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self.waiting.empty() and True in self.held:
            self._serve(self.held.pop(True))
        if self.waiting.empty() and False in self.held:
            self.waiting.put(self.held.pop(False))
        try:
            data = self.waiting.get(timeout=timeout) if timeout else self.waiting.get_nowait()
        except queue.Empty:
            return None, False
        return can.Message(arbitration_id=RESPONSE, data=data, is_extended_id=False), False


def our_client(bus: ServerBus) -> SdoClient:
    def advance(seconds: float) -> None:
        bus.now_s += seconds

    return SdoClient(BusLink(bus, advance=advance), NODE, lambda frame: None, 0.5)


def content(size: int, seed: int = 1) -> bytes:
    return random.Random(seed).randbytes(size)


def test_both_readings_of_the_checksum_agree_with_the_example_of_the_standard() -> None:
    """CiA 301: the CRC of the nine characters 1 to 9 is 31C3h."""
    assert checksum(b"123456789") == crc(b"123456789") == 0x31C3


@pytest.mark.parametrize("size", [56, 57, 63, 7 * 127, 7 * 127 + 1, 2000])
def test_whatever_is_long_goes_by_blocks(size: int) -> None:
    data = content(size)
    bus = ServerBus(data)
    client = our_client(bus)
    assert client.read(TEXT, 0) == data
    assert 0xA4 in bus.asked
    bus.asked.clear()
    client.write(TEXT, 0, data[::-1])
    assert bus.od.value(TEXT, 0) == data[::-1]
    assert bus.asked[0] == 0xC6


def test_a_server_without_blocks_is_asked_once() -> None:
    data = content(TEXT_SIZE)
    bus = ServerBus(data, blocks=False)
    client = our_client(bus)
    for _ in range(2):
        assert client.read(TEXT, 0) == data
    assert bus.asked.count(0xA4) == 1
    client.write(TEXT, 0, data[::-1])
    assert bus.od.value(TEXT, 0) == data[::-1]


def test_a_refusal_is_told_by_its_own_code() -> None:
    client = our_client(ServerBus())
    with pytest.raises(SdoError, match=r"2001:00: cannot be written \(abort code 06010002\)"):
        client.write(READ_ONLY, 0, content(TEXT_SIZE))
    with pytest.raises(SdoError, match=r"too long \(abort code 06070012\)"):
        client.write(TEXT, 0, content(4000))


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("write", [False, True], ids=["upload", "download"])
def test_one_frame_may_be_spoilt_anywhere(fault: str, write: bool) -> None:
    """Each frame of a transfer in turn, both ways: lost segments are sent again, and the data are right."""
    data = content(TEXT_SIZE)
    for spoilt in range(2 * TEXT_SIZE // 7):
        bus = ServerBus(b"" if write else data)
        bus.spoil = lambda number, _, at=spoilt: fault if number == at else ""
        client = our_client(bus)
        if write:
            client.write(TEXT, 0, data)
            assert bus.od.value(TEXT, 0) == data, spoilt
        else:
            assert client.read(TEXT, 0) == data, spoilt


@pytest.mark.parametrize("write", [False, True], ids=["upload", "download"])
def test_a_segment_with_a_wrong_byte_shows_in_the_checksum(write: bool) -> None:
    """The transfer is done again as a whole."""
    data = content(TEXT_SIZE)
    for bent in range(10, 40):
        bus = ServerBus(b"" if write else data)
        bus.spoil = lambda number, _, at=bent: "bent" if number == at else ""
        client = our_client(bus)
        if write:
            client.write(TEXT, 0, data)
        assert (bus.od.value(TEXT, 0) if write else client.read(TEXT, 0)) == data, bent
        assert bus.asked.count(0xC6 if write else 0xA4) == 2


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(56, 1500), st.floats(0.0, 0.1), st.booleans())
def test_a_bus_that_spoils_frames_never_makes_wrong_data(
    seed: int, size: int, share: float, write: bool
) -> None:
    """The data are right, or the transfer ends with an error."""
    rng, data = random.Random(seed), content(size, seed)
    bus = ServerBus(b"before" if write else data)
    bus.spoil = lambda number, down: rng.choice(FAULTS) if rng.random() < share else ""
    client = our_client(bus)
    try:
        if write:
            client.write(TEXT, 0, data)
        else:
            assert client.read(TEXT, 0) == data
    except SdoError:
        assert share > 0.0
        assert bus.od.value(TEXT, 0) in (b"before", data)
    else:
        assert not write or bus.od.value(TEXT, 0) == data


def test_a_block_download_that_was_left_takes_no_request_for_a_segment() -> None:
    bus = ServerBus(content(TEXT_SIZE))
    bus.server.answer(b"\xc6" + struct.pack("<HBI", TEXT, 0, TEXT_SIZE))
    assert bus.server.answer(struct.pack("<BHB4x", 0x40, TEXT, 0)) == ()  # segment 64, out of order
    bus.now_s += 0.4
    assert bus.server.answer(struct.pack("<BHB4x", 0x40, TEXT, 0))[0][0] == 0x41


@pytest.mark.parametrize(
    ("frames", "code"),
    [
        (["a4 00 20 00 00 00 00 00"], 0x0504_0002),
        (["a4 00 20 00 80 00 00 00"], 0x0504_0002),
        (["a4 00 20 00 7f 00 00 00", "a3", "a2 7f 7f"], 0x0504_0003),
        (["c6 00 20 00 05 00 00 00", "81 61 62 63 64 65", "c9 00 00"], 0x0504_0004),
        (["c2 00 20 00 06 00 00 00", "81 61 62 63 64 65", "c9 00 00"], 0x0607_0010),
        (["c2 01 20 00 06 00 00 00"], 0x0601_0002),
        (["c2 00 30 00 06 00 00 00"], 0x0602_0000),
        (["a4 00 30 00 7f 00 00 00"], 0x0602_0000),
        (["a2 00 20 00"], 0x0504_0001),
    ],
)
def test_what_fits_no_step_is_refused_with_its_code(frames: list[str], code: int) -> None:
    server = ServerBus(content(TEXT_SIZE)).server
    for text in frames:
        answers = server.answer(bytes.fromhex(text).ljust(8, b"\0"))
    assert answers[-1][0] == 0x80
    assert struct.unpack_from("<I", answers[-1], 4)[0] == code


# --- the canopen library ----------------------------------------------------------------------------------------------


class Library:
    """The library's SDO client on a bus with our server."""

    def __init__(self, data: bytes) -> None:
        self.bus = ServerBus(data)
        self.network = canopen.Network(self.bus)
        self.network.notifier = can.Notifier(self.bus, self.network.listeners, 0.02)
        self.sdo = self.network.add_node(NODE, canopen.ObjectDictionary()).sdo
        self.sdo.RESPONSE_TIMEOUT = 2.0

    def close(self) -> None:
        self.network.notifier.stop(5.0)
        self.bus.shutdown()


@pytest.fixture
def library() -> Iterator[Library]:
    made = Library(content(1500))
    yield made
    made.close()


@pytest.mark.parametrize("lost", [None, 20, 100])
def test_its_client_uploads_from_our_server(library: Library, lost: int | None) -> None:
    library.bus.spoil = lambda number, down: "lost" if number == lost else ""
    with library.sdo.open(TEXT, 0, "rb", block_transfer=True) as stream:
        assert stream.read() == content(1500)


@pytest.mark.parametrize("lost", [None, 20, 100])
def test_its_client_downloads_to_our_server(library: Library, lost: int | None) -> None:
    data = content(1500, 7)
    library.bus.spoil = lambda number, down: "lost" if number == lost else ""
    with library.sdo.open(TEXT, 0, "wb", size=len(data), block_transfer=True) as stream:
        stream.write(data)
    assert library.bus.od.value(TEXT, 0) == data


def test_our_client_reads_and_writes_its_local_node() -> None:
    """Its server takes a block upload by segments, and refuses a block download."""
    with can.Bus("blocks", interface="virtual") as ours, can.Bus("blocks", interface="virtual") as theirs:
        network = canopen.Network(theirs)
        od = canopen.ObjectDictionary()
        variable = canopen.objectdictionary.ODVariable("text", TEXT)
        variable.data_type = canopen.objectdictionary.OCTET_STRING
        od.add_object(variable)
        node = canopen.LocalNode(NODE, od)
        network.notifier = can.Notifier(theirs, network.listeners, 0.02)
        network.add_node(node)
        try:
            client = SdoClient(BusLink(ours), NODE, lambda frame: None, 2.0)
            node.set_data(TEXT, 0, content(TEXT_SIZE))
            assert client.read(TEXT, 0) == content(TEXT_SIZE)
            client.write(TEXT, 0, content(TEXT_SIZE, 3))
            assert node.get_data(TEXT, 0) == content(TEXT_SIZE, 3)
        finally:
            network.notifier.stop(5.0)
