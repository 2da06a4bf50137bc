"""The link by hand: states of the controller of the bus, failures in a row, what comes back, bits on the wire."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Any

import can
import pytest

from gantryctl.drives.canopen.bus import link as link_module
from gantryctl.drives.canopen.bus.interface import Counted, InterfaceCounters
from gantryctl.drives.canopen.bus.link import BusLink, Frame, open_bus
from gantryctl.drives.canopen.bus.node import NmtCommand
from gantryctl.drives.canopen.bus.requests import SdoRequests
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError
from gantryctl.errors import UsageError
from gantryctl.image import LinkFlag
from unit.drives.canopen.dictionary import Dictionary
from unit.drives.canopen.test_refusals_and_silence import Scripted, message
from unit.drives.canopen.wire import Wire, remote_node

pytestmark = pytest.mark.can

# Classes of the error frames of SocketCAN, and states in their second byte (linux/can/error.h).
CONTROLLER, BUS_OFF, RESTARTED = 0x04, 0x40, 0x100
OVERFLOW, RX_WARNING, TX_WARNING, RX_PASSIVE, TX_PASSIVE, ACTIVE = 0x01, 0x04, 0x08, 0x10, 0x20, 0x40
PASSIVE, OFF, WELL = LinkFlag.ERROR_PASSIVE, LinkFlag.BUS_OFF, LinkFlag.NONE


def error(kind: int, state: int = 0) -> can.Message:
    return message(kind, bytes((0, state, 0, 0, 0, 0, 0, 0)), is_error_frame=True)


@pytest.mark.parametrize(
    ("frames", "trouble", "passives", "bus_offs"),
    [
        ([error(CONTROLLER, RX_PASSIVE)], PASSIVE, 1, 0), ([error(CONTROLLER, TX_PASSIVE)], PASSIVE, 1, 0),
        ([error(CONTROLLER, RX_WARNING)], WELL, 0, 0), ([error(CONTROLLER, TX_WARNING)], WELL, 0, 0),
        ([error(CONTROLLER, RX_PASSIVE), error(CONTROLLER, TX_PASSIVE)], PASSIVE, 1, 0),
        # A buffer that ran over is no state; a warning is one, and the one before has ended.
        ([error(CONTROLLER, TX_PASSIVE), error(CONTROLLER, OVERFLOW)], PASSIVE, 1, 0),
        ([error(CONTROLLER, TX_PASSIVE), error(CONTROLLER, RX_WARNING)], WELL, 1, 0),
        ([error(CONTROLLER, TX_PASSIVE), error(CONTROLLER, ACTIVE)], WELL, 1, 0),
        ([error(CONTROLLER, TX_PASSIVE), error(CONTROLLER, ACTIVE), error(CONTROLLER, RX_PASSIVE)], PASSIVE, 2, 0),
        ([error(BUS_OFF)], OFF, 0, 1), ([error(BUS_OFF), error(BUS_OFF)], OFF, 0, 1),
        ([error(CONTROLLER, TX_PASSIVE), error(BUS_OFF)], OFF | PASSIVE, 1, 1),
        ([error(CONTROLLER, TX_PASSIVE), error(BUS_OFF), error(RESTARTED)], WELL, 1, 1),
        ([error(BUS_OFF), message(0x182)], WELL, 0, 1), ([error(BUS_OFF), message(0x182), error(BUS_OFF)], OFF, 0, 2),
        ([error(0x08, TX_PASSIVE)], WELL, 0, 0), ([message(CONTROLLER, b"\0", is_error_frame=True)], WELL, 0, 0),
    ],
)  # fmt: skip
def test_the_controller_of_the_bus_tells_its_state(
    frames: list[can.Message], trouble: LinkFlag, passives: int, bus_offs: int
) -> None:
    link = BusLink(Scripted(*frames))
    for _ in frames:
        link.receive(0.0)
    assert (link.trouble, link.passives, link.bus_offs) == (trouble, passives, bus_offs)
    assert link.ignored == sum(frame.is_error_frame for frame in frames)
    # Of a controller that is bus-off the kernel still takes frames.
    assert link.send(0x202, b"")
    assert link.down is bool(trouble & OFF)
    link.close()
    assert link.down


# Of linux/can/error.h: a frame not sent in time, arbitration, a violated protocol, transceiver, no answer, any error.
@pytest.mark.parametrize("kind", [0x01, 0x02, 0x08, 0x10, 0x20, 0x80])
@pytest.mark.parametrize(
    ("before", "trouble"), [([], WELL), ([error(BUS_OFF)], OFF), ([error(CONTROLLER, TX_PASSIVE)], PASSIVE)]
)
def test_an_error_of_another_class_is_no_state(
    before: list[can.Message], trouble: LinkFlag, kind: int
) -> None:
    link = BusLink(Scripted(*before, error(kind)))
    for _ in (*before, kind):
        link.receive(0.0)
    assert link.trouble == trouble


@pytest.mark.parametrize(
    ("advances", "told", "stepped"), [(False, False, False), (False, True, True), (True, False, True)]
)
def test_a_drive_in_this_process_is_always_stepped(advances: bool, told: bool, stepped: bool) -> None:
    link = BusLink(Scripted(), advance=(lambda seconds: None) if advances else None, stepped=told)
    assert link.stepped is stepped
    link.close()


class Failing(Scripted):
    """Takes the frames that it is told to take."""

    def __init__(self, takes: str) -> None:
        super().__init__()
        self.takes = list(takes)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.takes.pop(0) == "-":
            raise can.CanOperationError("no")


@pytest.mark.parametrize(
    ("takes", "down"), [("--+--", False), ("--+---", True), ("---+", False), ("++--", False)]
)
def test_three_failures_in_a_row_are_a_bus_that_is_down(takes: str, down: bool) -> None:
    link = BusLink(Failing(takes))
    for _ in takes:
        link.send(0x202, b"")
    assert (link.down, link.refused) == (down, takes.count("-"))
    link.close()


@pytest.mark.parametrize(
    ("fault", "full"),
    [
        (can.CanOperationError("full", error_code=errno.ENOBUFS), 1), (OSError(errno.ENOBUFS, "full"), 1),
        (can.CanOperationError("gone", error_code=errno.ENODEV), 0), (OSError(errno.ENODEV, "gone"), 0),
        (can.CanOperationError("no"), 0),
    ],
)  # fmt: skip
def test_a_full_queue_is_told_from_a_bus_that_has_gone(fault: Exception, full: int) -> None:
    bus = Scripted()

    def send(msg: can.Message, timeout: float | None = None) -> None:
        raise fault

    bus.send = send  # type: ignore[method-assign]
    link = BusLink(bus)
    assert not link.send(0x202, b"")
    assert (link.refused, link.queue_full) == (1, full)
    link.close()


def test_a_pause_is_a_sleep_or_the_time_of_the_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    passed: list[float] = []
    monkeypatch.setattr(link_module.time, "sleep", slept.append)
    for link in (
        BusLink(Scripted()),
        BusLink(Scripted(), stepped=True),
        BusLink(Scripted(), advance=passed.append),
    ):
        link.pause(0.25)
        link.pace(0.004)
        link.close()
    # Only a drive that nothing steps is waited for until the next scan.
    assert (slept, passed) == ([0.25, 0.004, 0.25], [0.25])


def test_only_a_sync_that_comes_back_was_sent() -> None:
    bus = Scripted()
    link = BusLink(bus, echoes=True)
    for can_id in (0x080, 0x202, 0x080):
        link.send(can_id, b"")
    assert link.unseen == 2
    for can_id, unseen in ((0x202, 2), (0x080, 0)):
        bus.given = [message(can_id)]
        assert link.receive(0.0) is None
        assert link.unseen == unseen
    link.close()
    plain = BusLink(Scripted())
    plain.send(0x080, b"")
    assert plain.unseen == 0
    plain.close()


def test_bits_of_frames_sent_and_received() -> None:
    """47 bits without data (ISO 11898-1, without stuff bits): 8 bytes 111, 2 bytes 63, 3 of another format 71."""
    link = BusLink(Scripted(message(0x182, b"ab"), message(0x12345, b"abc", is_extended_id=True)))
    link.send(0x202, bytes(8))
    assert link.traffic.bits == 111
    for _ in range(2):
        link.receive(0.0)
    assert link.traffic == (111 + 63 + 71, 0)
    link.close()
    assert link.traffic == (111 + 63 + 71, 0)


class Interface:
    """Counters of a network interface, in steps of 15 frames and 60 bytes."""

    def __init__(self, *, counts_own: bool) -> None:
        self.counts_own, self._reads, self.closed = counts_own, 0, False

    def read(self) -> Counted:
        self._reads += 1
        return Counted(10 + 15 * (self._reads - 1), 100 + 60 * (self._reads - 1))

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize(("counts_own", "bits", "others"), [(True, 1185, 11), (False, 1185 + 3 * 47, 14)])
def test_frames_that_a_filter_keeps_away_are_those_of_others(
    counts_own: bool, bits: int, others: int
) -> None:
    """15 frames with 60 bytes since the beginning, 15 x 47 + 8 x 60 bits: one of them was received, three are ours."""
    counters: Any = Interface(counts_own=counts_own)
    link = BusLink(Scripted(message(0x182, b"ab")), counters=counters)
    for _ in range(3):
        link.send(0x080, b"")
    link.receive(0.0)
    assert link.traffic == (bits, others)
    link.close()
    assert counters.closed
    assert BusLink(Scripted()).traffic == (0, 0)


@pytest.mark.parametrize("counts_own", [True, False])
@pytest.mark.parametrize("seen", [15, 20])
def test_where_every_frame_was_seen_there_is_none_of_others(counts_own: bool, seen: int) -> None:
    """15 frames are counted; those that come between the count and the reading are no fewer than none."""
    frames = [] if counts_own else [message(0x182)] * seen
    link = BusLink(Scripted(*frames), counters=Interface(counts_own=counts_own))  # type: ignore[arg-type]
    for _ in range(seen):
        link.send(0x202, b"") if counts_own else link.receive(0.0)
    assert link.traffic.filtered == 0
    link.close()


@pytest.mark.parametrize(("advances", "waits_s"), [(True, [0.0, 0.0]), (False, [0.5])])
def test_only_a_bus_outside_is_waited_for(advances: bool, waits_s: list[float]) -> None:
    """A drive in this process has answered when its time has gone on."""
    bus, waited_s = Scripted(), list[float | None]()

    def recv(timeout: float | None = None) -> None:
        waited_s.append(timeout)

    bus.recv = recv  # type: ignore[method-assign, assignment]
    link = BusLink(bus, advance=(lambda seconds: None) if advances else None)
    assert link.receive(0.001 if advances else 0.5) is None
    assert waited_s == pytest.approx(waits_s, abs=1e-3)
    link.close()


def statistics(folder: Path, frames: str, data_bytes: str, *, board: bool) -> Path:
    (folder / "can0" / "statistics").mkdir(parents=True)
    (folder / "can0" / "statistics" / "rx_packets").write_text(frames)
    (folder / "can0" / "statistics" / "rx_bytes").write_text(data_bytes)
    if board:
        (folder / "can0" / "device").mkdir()
    return folder


@pytest.mark.parametrize("board", [True, False])
def test_the_counters_of_an_interface_are_those_of_the_system(tmp_path: Path, board: bool) -> None:
    """A controller on a board does not count what this computer sends; a virtual interface gives it back."""
    counters = InterfaceCounters("can0", statistics(tmp_path, "15\n", "60\n", board=board))
    assert (counters.counts_own, counters.read()) == (not board, (15, 60))
    (tmp_path / "can0" / "statistics" / "rx_packets").write_text("16\n")
    assert counters.read() == (16, 60)
    for _ in range(2):
        counters.close()


def test_an_interface_without_statistics_is_none(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="can1"):
        InterfaceCounters("can1", tmp_path)
    with pytest.raises(OSError, match="statistics"):
        InterfaceCounters("can0", statistics(tmp_path, "many", "60", board=True))


def test_an_interface_that_there_is_not_is_named_with_those_that_there_are() -> None:
    with pytest.raises(UsageError, match=r"'telepathy'.*it has: .*socketcan"):
        open_bus("telepathy")


def test_a_filter_passes_every_identifier_that_was_ever_accepted() -> None:
    """All eleven bits of an identifier, of plain frames."""
    bus, filters, kinds = Scripted(), list[list[int]](), set[tuple[int, bool]]()

    def keep(rows: Any) -> None:
        filters.append([row["can_id"] for row in rows])
        kinds.update((row["can_mask"], row["extended"]) for row in rows)

    bus.set_filters = keep  # type: ignore[method-assign, assignment]
    counters: Any = Interface(counts_own=True)
    link = BusLink(bus, counters=counters)
    link.accept((0x182, 0x080))
    link.accept((0x702,))
    assert filters == [[0x080, 0x182], [0x080, 0x182, 0x702]]
    assert kinds == {(0x7FF, False)}
    # Where nobody counts the others every frame is received.
    BusLink(bus).accept((0x182,))
    assert len(filters) == 2


# --- frames of a node -------------------------------------------------------------------------------------------------


def test_what_the_master_sends_to_all_and_to_its_node() -> None:
    """CiA 301: SYNC at 080h, heartbeat of node 127 in OPERATIONAL, NMT at 0."""
    wire = Wire()
    node = remote_node(wire)
    assert (node.boots, node.foreign, node.foreign_id, node.unknown) == (0, 0, -1, 0)
    node.sync()
    node.heartbeat()
    for command in NmtCommand:
        node.nmt(command)
    assert wire.sent == [
        (0x080, ""), (0x77F, "05"), (0x000, "01 02"), (0x000, "02 02"), (0x000, "80 02"), (0x000, "81 02"),
        (0x000, "82 02"),
    ]  # fmt: skip


def test_a_node_has_20_ms_to_leave_operational_and_is_heard_meanwhile() -> None:
    wire = Wire()
    node = remote_node(wire)
    wire.comes(0x702, "7F")
    node.enter_pre_operational()
    assert (wire.sent, node.state) == ([(0x000, "80 02")], 0x7F)
    assert wire.time_s == pytest.approx(0.02)


def test_each_part_of_an_identity_has_its_own_object() -> None:
    node = remote_node(Wire())
    sdo = Dictionary({(0x1000, 0): 0x55, **{(0x1018, sub): 0x11 * sub for sub in (1, 2, 3, 4)}})
    sdo.text = {0x1008: "a drive", 0x1009: "board 3", 0x100A: "2.7"}.__getitem__  # type: ignore[method-assign]
    node.sdo = sdo  # type: ignore[assignment]
    identity = node.identity()
    assert identity == (0x11, 0x22, 0x33, 0x44, 0x55, "a drive", "board 3", "2.7")
    assert identity.text == "a drive, software 2.7, serial 68"


def test_an_emergency_message_is_kept_with_its_code_and_the_scan_in_which_it_came() -> None:
    node = remote_node(Wire())
    # What comes while it is set up came before the first scan; some drives send three bytes.
    node.dispatch(Frame(0x082, bytes.fromhex("50 23 04")))
    assert node.emergencies.messages.pop() == (0, 0x2350, 4, b"")
    node.scan = 7
    node.dispatch(Frame(0x082, bytes.fromhex("10 23 02 01 02 03 04 05")))
    node.dispatch(Frame(0x083, bytes.fromhex("50 23 02 00 00 00 00 00")))  # of another node
    (told,) = node.emergencies.messages
    assert (told.scan, told.code, told.register, told.vendor.hex()) == (7, 0x2310, 2, "0102030405")
    assert (node.emergencies.count, node.unknown) == (2, 1)


@pytest.mark.parametrize(
    ("data", "state"), [("05", 0x05), ("85", 0x05), ("7F", 0x7F), ("FF", 0x7F), ("04", 0x04), ("", None)]
)
def test_a_heartbeat_is_a_sign_of_life_with_or_without_a_state(data: str, state: int | None) -> None:
    """Bit 7 toggles in node guarding; some drives send heartbeats without data."""
    node = remote_node(Wire())
    node.heartbeat_age = 30
    node.dispatch(Frame(0x702, bytes.fromhex(data)))
    assert (node.heartbeat_age, node.state) == (0, state)


def test_the_first_frame_in_our_name_is_told_and_all_are_counted() -> None:
    node = remote_node(Wire())
    for can_id in (0x77F, 0x080, 0x602):
        node.dispatch(Frame(can_id, b""))
    assert (node.foreign, node.foreign_id) == (3, 0x77F)


def test_an_answer_is_waited_for_as_long_as_it_may_take() -> None:
    wire, seen = Wire(), list[bytes | None]()
    node = remote_node(wire)
    requests = SdoRequests(node)
    requests.read(0x6041, 0, seen.append)
    requests.wait(0.1)
    assert (wire.time_s, requests.waiting) == (pytest.approx(0.1), True)
    wire.comes(0x702, "05")
    wire.comes(0x582, "4B 41 60 00 37 12 00 00")
    requests.wait(0.1)
    assert (wire.time_s, seen, node.state) == (pytest.approx(0.1), [b"\x37\x12"], 0x05)


def test_answers_that_came_too_late_are_passed_over_and_frames_of_others_are_not() -> None:
    wire, passed = Wire(), list[Frame]()
    sdo = SdoClient(wire, 2, passed.append, 0.05)  # type: ignore[arg-type]
    wire.comes(0x582, "4B 41 60 00 37 12 00 00")
    wire.comes(0x702, "05")
    sdo._pass_over()
    assert passed == [Frame(0x702, b"\x05")]


def test_frames_of_others_do_not_hold_up_a_request_for_ever() -> None:
    wire, passed = Wire(), list[Frame]()
    receive = wire.receive

    def slow(timeout_s: float) -> Frame | None:
        wire.time_s += 0.02
        wire.comes(0x123, "00")
        return receive(timeout_s)

    wire.receive = slow  # type: ignore[method-assign]
    sdo = SdoClient(wire, 2, passed.append, 0.05)  # type: ignore[arg-type]
    with pytest.raises(SdoError, match="no answer"):
        sdo.write(0x6040, 0, b"\0\0")
    assert len(passed) == 3


def test_frames_that_could_not_be_read_in_time_are_left() -> None:
    """The answer says whether none was left: behind them no telegram is believed."""
    wire = Wire()
    node = remote_node(wire)
    wire.comes(0x123, "00", "00", "00")
    assert node.drain()
    wire.comes(0x123, *["00"] * 501)
    assert not node.drain()
    assert len(wire.coming) == 1  # 500 frames in one go, however many come
    assert node.drain()
    receive = wire.receive

    def slow(timeout_s: float) -> Frame | None:
        wire.time_s += 0.001
        return receive(timeout_s)

    wire.receive = slow  # type: ignore[method-assign]
    wire.comes(0x123, *["00"] * 10)
    assert not node.drain(0.0035)
    assert len(wire.coming) == 6
