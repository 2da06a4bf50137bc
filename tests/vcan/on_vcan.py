"""Controller and drive over SocketCAN of a real kernel; run inside `support/vcan.sh`.

The drive is stepped: its time goes on by SYNC, so that what is judged does not depend on how fast this computer is.
"""

from __future__ import annotations

import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from gantryctl.drives.canopen.bus.interface import InterfaceCounters
from gantryctl.drives.canopen.bus.link import ECHOING, BusLink, Frame, open_bus
from gantryctl.trace.frames.files import read_frames
from vcan.rig import VcanBus, dumped, ended, netem

pytestmark = pytest.mark.can
# The tests without a drive come first: there is nobody else on the bus then.
SYNC = 0x080


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VcanBus]:
    made = VcanBus(tmp_path_factory.mktemp("bus"))
    yield made
    made.end()


@pytest.fixture
def other() -> Iterator[can.BusABC]:
    """Somebody else on the bus."""
    made = can.Bus(interface="socketcan", channel="vcan0", ignore_config=True)
    yield made
    made.shutdown()


@pytest.fixture
def link() -> Iterator[BusLink]:
    made = BusLink(open_bus("socketcan", "vcan0"), echoes="socketcan" in ECHOING)
    yield made
    made.close()


def test_our_own_frames_come_back_and_are_dropped(link: BusLink) -> None:
    for k in range(100):
        link.send(SYNC, b"")
        link.send(0x202, k.to_bytes(8, "little"))
    assert link.unseen == 100
    assert link.receive(0.1) is None
    assert link.unseen == 0


def test_a_bus_that_swallows_frames_gives_no_sync_back(link: BusLink) -> None:
    with netem("loss", "100%"):
        for _ in range(5):
            link.send(SYNC, b"")
        assert link.receive(0.1) is None
        assert (link.unseen, link.refused) == (5, 0)  # what CAN-01 sees
    link.send(SYNC, b"")
    assert link.receive(0.1) is None
    assert link.unseen == 0


def test_a_full_queue_refuses_frames_and_the_link_is_down_until_it_takes_them(link: BusLink) -> None:
    # Nothing leaves for ten seconds, and three frames may wait: the fourth is ENOBUFS.
    with netem("delay", "10s", "limit", "3"):
        for _ in range(6):
            link.send(SYNC, b"")
        assert (link.refused, link.queue_full) == (3, 3)
        assert link.down
    link.send(SYNC, b"")
    assert not link.down
    assert link.receive(0.1) is None  # it came back: nothing is left on its way to the next test


def test_the_kernel_keeps_the_frames_of_others_away_and_they_are_counted(other: can.BusABC) -> None:
    link = BusLink(open_bus("socketcan", "vcan0"), echoes=True, counters=InterfaceCounters("vcan0"))
    try:
        link.accept([0x182, 0x702])
        for can_id in (0x100, 0x182, 0x300, 0x702, 0x7FF):
            other.send(can.Message(arbitration_id=can_id, data=b"12345678", is_extended_id=False))
        assert [link.receive(0.1), link.receive(0.1), link.receive(0.1)] == [
            Frame(0x182, b"12345678"), Frame(0x702, b"12345678"), None,
        ]  # fmt: skip
        assert link.traffic.filtered == 3
    finally:
        link.close()
    assert link.traffic.filtered == 3  # the summary of a run comes after its end


def test_bus_off_is_kept_until_the_controller_of_the_bus_has_started_again(
    link: BusLink, other: can.BusABC
) -> None:
    # vcan has no errors of its own; an error frame of the kernel's form is one whoever sends it (linux/can/error.h).
    for kind, down in ((0x40, True), (0x100, False)):
        other.send(can.Message(arbitration_id=kind, data=bytes(8), is_error_frame=True, is_extended_id=False))
        assert link.receive(0.1) is None
        assert link.down is down
    assert link.bus_offs == 1


def test_candump_reads_what_an_echo_test_sends(link: BusLink, tmp_path: Path) -> None:
    with dumped(tmp_path / "dump.log"):
        link.send(0x602, bytes(range(8)))
    (line,) = (tmp_path / "dump.log").read_text().splitlines()
    assert line.endswith("vcan0 602#0001020304050607")


def test_a_move_arrives_and_its_log_is_what_candump_has_seen(bus: VcanBus, tmp_path: Path) -> None:
    log, foreign = tmp_path / "move.log", tmp_path / "candump.log"
    with dumped(foreign):
        code, out, err = ended(bus.start("move", "3", "--json", "--bus-log", str(log)))
    assert code == 0, err
    assert out["summary"]["end_deg"] == pytest.approx(3.0, abs=0.005)  # the in-position window
    ours, theirs = list(read_frames(log)), list(read_frames(foreign))
    # Each frame once, sent or received: none of our own is taken for another's when the kernel gives it back.
    assert Counter((f.can_id, f.data) for f in ours) == Counter((f.can_id, f.data) for f in theirs)
    for sent in (True, False):
        identifiers = {f.can_id for f in ours if f.sent is sent}
        assert [f[1:3] for f in ours if f.sent is sent] == [f[1:3] for f in theirs if f.can_id in identifiers]
    # Seconds since 1970 by both clocks: candump has the kernel's time of each frame.
    assert abs(ours[0].time_s - theirs[0].time_s) < 0.5
    text = subprocess.run(
        ["log2asc", "-I", str(log), "vcan0"], capture_output=True, text=True, check=True
    ).stdout
    told = Counter(word for line in text.splitlines() for word in line.split() if word in ("Rx", "Tx"))
    assert told == {"Tx": sum(f.sent for f in ours), "Rx": sum(not f.sent for f in ours)}
