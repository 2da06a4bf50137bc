"""The controller of the bus in the computer: bus-off, error passive, a full queue, frames that the kernel filters."""

from __future__ import annotations

import errno
from pathlib import Path

import can
import pytest

from bus.bus_rig import BusRig, bus_machine
from gantryctl.drives.canopen.bus.interface import InterfaceCounters
from gantryctl.drives.canopen.bus.link import BusLink
from gantryctl.image import LinkFlag

pytestmark = pytest.mark.can


class Adapter(can.BusABC):
    """Takes frames, or refuses them with an error of the system; delivers what a test puts in."""

    channel_info = "adapter"

    def __init__(self) -> None:
        self.waiting: list[can.Message] = []
        self.error: int | None = None
        self.passing: list[int] = []
        self._can_protocol = can.CanProtocol.CAN_20

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.error is not None:
            raise can.CanOperationError("Failed to transmit", self.error)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        return self.waiting.pop(0) if self.waiting else None

    def set_filters(self, filters: can.typechecking.CanFilters | None = None) -> None:
        assert filters is not None
        assert all(f["can_mask"] == 0x7FF and f.get("extended") is False for f in filters)
        self.passing = [f["can_id"] for f in filters]

    def error_frame(self, kind: int, state: int = 0) -> None:
        """An error frame of SocketCAN (linux/can/error.h)."""
        data = bytes((0, state, 0, 0, 0, 0, 0, 0))
        self.waiting.append(can.Message(arbitration_id=kind, data=data, is_error_frame=True))

    def frame(self, can_id: int, data: bytes = b"") -> None:
        self.waiting.append(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))


BUS_OFF, RESTARTED, CONTROLLER = 0x40, 0x100, 0x04
WARNING, PASSIVE, ACTIVE = 0x08, 0x20, 0x40


def linked(**options: object) -> tuple[Adapter, BusLink]:
    adapter = Adapter()
    return adapter, BusLink(adapter, advance=lambda _: None, **options)


def test_bus_off_stays_until_a_frame_is_seen_on_the_bus() -> None:
    """The kernel takes frames of a controller that is bus-off, and drops them: taking one proves nothing."""
    adapter, link = linked()
    adapter.error_frame(BUS_OFF)
    link.receive(0.0)
    link.send(0x80, b"")
    assert link.down
    assert link.trouble == LinkFlag.BUS_OFF
    adapter.frame(0x181)
    link.receive(0.0)
    assert not link.down
    assert (link.trouble, link.bus_offs) == (LinkFlag.NONE, 1)


def test_a_restarted_controller_is_not_bus_off() -> None:
    adapter, link = linked()
    for kind in (BUS_OFF, RESTARTED):
        adapter.error_frame(kind)
        link.receive(0.0)
    assert not link.down


def test_error_passive_lasts_until_the_controller_says_so() -> None:
    adapter, link = linked()
    for state, trouble in (
        (WARNING, LinkFlag.NONE),
        (PASSIVE, LinkFlag.ERROR_PASSIVE),
        (PASSIVE, LinkFlag.ERROR_PASSIVE),
        (WARNING, LinkFlag.NONE),
        (PASSIVE, LinkFlag.ERROR_PASSIVE),
        (ACTIVE, LinkFlag.NONE),
    ):
        adapter.error_frame(CONTROLLER, state)
        link.receive(0.0)
        assert link.trouble == trouble, state
    assert link.passives == 2
    # The byte of the states has a meaning in frames of that class alone.
    for kind in (0x01, 0x02, 0x08, 0x80):
        adapter.error_frame(kind, PASSIVE)
        link.receive(0.0)
    assert (link.trouble, link.passives) == (LinkFlag.NONE, 2)


def test_a_full_queue_is_counted_and_is_down_after_three_frames() -> None:
    adapter, link = linked()
    adapter.error = errno.ENOBUFS
    for failed in range(3):
        assert not link.down, failed
        link.send(0x202, bytes(8))
    assert link.down
    adapter.error = None
    link.send(0x202, bytes(8))
    assert (link.down, link.queue_full) == (False, 3)


def test_a_refused_frame_leaves_no_echo_to_wait_for() -> None:
    """A copy of it that comes from another master later is seen."""
    adapter, link = linked(echoes=True)
    adapter.error = errno.ENOBUFS
    link.send(0x202, b"ab")
    adapter.frame(0x202, b"ab")
    assert link.receive(0.0) == (0x202, b"ab")


# --- what is told ---------------------------------------------------------------------------------------------------


def test_error_passive_is_a_warning_that_stays_until_the_reset() -> None:
    rig = BusRig(bus_machine()).power_up()
    rig.drive.link._passive = True
    rig.run(0.02)
    rig.drive.link._passive = False
    rig.run(0.5)
    assert [str(code) for code in rig.axis.alarms.active] == ["CAN-15"]
    assert "error passive" in rig.told[0]
    assert rig.stops == []
    rig.command(power=False)
    rig.until(lambda: rig.axis.is_off, 10.0)
    rig.command(reset=True)
    rig.run(0.1)
    assert not rig.axis.alarms.active
    rig.engine.close()


def test_bus_off_is_named_by_its_alarm() -> None:
    rig = BusRig(bus_machine()).power_up()
    bus = rig.drive.link._bus
    true_send = bus.send
    # The kernel takes frames that never reach the bus, and reports it once.
    bus.send = lambda msg, timeout=None: None
    bus._waiting.append(can.Message(arbitration_id=BUS_OFF, data=bytes(8), is_error_frame=True))
    rig.run(1.0)
    assert rig.stops[0] == "CAN-08"
    assert "bus-off" in rig.first_told
    assert "CAN controller: bus-off 1 times" in rig.drive.health().lines()
    bus.send = true_send
    rig.engine.close()


@pytest.mark.parametrize("can_ids", [(0x202,), (0x202, 0x080, 0x77F)], ids=["some", "all"])
def test_a_full_queue_is_named_by_its_alarm(can_ids: tuple[int, ...]) -> None:
    """Of some frames it is a warning, and the drive's own watch stops the axis; of all the bus is down."""
    rig = BusRig(bus_machine()).power_up()
    bus = rig.drive.link._bus
    true_send = bus.send

    def refuse(msg: can.Message, timeout: float | None = None) -> None:
        if msg.arbitration_id in can_ids:
            raise can.CanOperationError("Failed to transmit", errno.ENOBUFS)
        true_send(msg, timeout)

    bus.send = refuse
    rig.run(1.0)
    assert rig.codes[0] == "CAN-15"
    assert "ENOBUFS" in rig.told[0]
    assert rig.stops[0] == ("CAN-05" if len(can_ids) == 1 else "CAN-08")
    assert len(can_ids) == 1 or "ENOBUFS" in rig.first_told
    bus.send = true_send
    rig.engine.close()


@pytest.mark.parametrize(
    ("can_id", "data", "words"),
    [
        (0x202, bytes(8), "RPDO), identifier 202h"),
        (0x000, b"\x01\x02", "NMT), identifier 000h"),
        (0x080, b"", "SYNC, identifier 080h"),
        (0x602, bytes(8), "SDO), identifier 602h"),
        (0x77F, b"\x05", "heartbeat, identifier 77Fh"),
    ],
)
def test_another_master_is_named_by_its_identifier(can_id: int, data: bytes, words: str) -> None:
    rig = BusRig(bus_machine())
    rig.run(0.1)
    rig.foreign(can_id, data)
    rig.run(0.02)
    rig.foreign(0x202, bytes(8))
    rig.run(0.1)
    assert rig.codes[0] == "CAN-12"
    assert words in rig.told[0]
    rig.engine.close()


# --- frames of others -----------------------------------------------------------------------------------------------


def interface(root: Path, *, hardware: bool) -> Path:
    folder = root / "can7"
    (folder / "statistics").mkdir(parents=True)
    if hardware:
        (folder / "device").mkdir()
    counted(folder, 100, 800)
    return folder


def counted(folder: Path, frames: int, data_bytes: int) -> None:
    for name, value in (("rx_packets", frames), ("rx_bytes", data_bytes)):
        (folder / "statistics" / name).write_text(f"{value}\n")


@pytest.mark.parametrize("hardware", [True, False])
def test_frames_of_others_are_filtered_by_the_kernel_and_counted_by_the_interface(
    tmp_path: Path, hardware: bool
) -> None:
    folder = interface(tmp_path, hardware=hardware)
    adapter, link = linked(counters=InterfaceCounters("can7", tmp_path))
    link.accept((0x182, 0x282))
    link.accept((0x80, 0x182))
    assert adapter.passing == [0x80, 0x182, 0x282]
    link.send(0x80, b"")
    adapter.frame(0x182, bytes(8))
    link.receive(0.0)
    # On the wire since then: ours, the drive's, and 50 of others with 4 bytes each. vcan counts ours as received.
    own = 0 if hardware else 1
    counted(folder, 100 + own + 1 + 50, 800 + 8 + 200)
    assert link.traffic.filtered == 50
    assert link.traffic.bits == 47 * 52 + 8 * 208
    link.close()
    # A run is summed up after its bus was left.
    assert link.traffic.filtered == 50


def test_an_interface_without_statistics_filters_nothing(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="can7"):
        InterfaceCounters("can7", tmp_path)
    adapter, link = linked()
    link.accept((0x182,))
    assert adapter.passing == []


def test_whatever_the_master_must_see_passes_the_filter() -> None:
    """Its drive's frames, and all that only this controller may send (CAN-12)."""
    rig = BusRig(bus_machine("object_60FE"))
    seen = rig.drive.node.identifiers
    telegrams = {0x182, 0x282}
    ours = {0x000, 0x080, 0x202, 0x302, 0x602, 0x77F}
    assert telegrams | ours | {0x082, 0x582, 0x702} <= seen
    rig.engine.close()
