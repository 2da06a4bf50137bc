"""Traffic that is not as it must be, and a drive that complains or does not obey: detected, told, stopped."""

from __future__ import annotations

import can
import pytest

from bus.bus_rig import QUICK_STOP_DEG, TORQUE_OFF_DEG, BusRig, bus_machine
from gantryctl.drives.canopen.bus.link import BusLink
from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.program import AxisState

pytestmark = pytest.mark.can

OWNERS_AND_SCANS = [("drive", 1.0), ("object_60FE", 4.0), ("drive", 10.0)]


def stopped(rig: BusRig, begun: int, code: str, limit_deg: float) -> None:
    """The axis has come to rest by `code`, within the limit, and stays off."""
    assert rig.stops[0] == code, rig.told
    assert rig.axis.state is AxisState.ERROR_STOP
    assert rig.way_deg(begun - 1) < limit_deg
    assert not rig.ticks[-1].brake_open
    assert not rig.enabled_again(begun)
    rig.engine.close()


@pytest.mark.parametrize(
    ("speed", "owner", "scan_ms"),
    [
        # Each direction and owner; a scan of 1 ms costs ten times as much as one of 10 ms.
        pytest.param(
            speed,
            owner,
            scan_ms,
            marks=[] if scan_ms == 10.0 or (speed, scan_ms) == (6.0, 4.0) else [pytest.mark.slow],
        )
        for speed in (6.0, -1.0)
        for owner, scan_ms in OWNERS_AND_SCANS
    ],
)
class TestInMotion:
    """Each row begins in cruise."""

    def test_three_telegrams_of_a_wrong_length(self, owner: str, scan_ms: float, speed: float) -> None:
        rig = BusRig(bus_machine(owner, scan_ms)).power_up().cruise(speed)
        begun = len(rig.ticks)
        rig.spoil_telegrams(1, "length", 3, 5)
        rig.run(4.0)
        stopped(rig, begun, "CAN-04", QUICK_STOP_DEG[abs(speed)])

    def test_a_full_bus(self, owner: str, scan_ms: float, speed: float) -> None:
        """Frames of 111 bits from somebody else, as many as fit."""
        rig = BusRig(bus_machine(owner, scan_ms)).power_up().cruise(speed)
        begun = len(rig.ticks)
        flood = int(scan_ms * 1000 / 111) + 1

        def more() -> bool:
            for _ in range(flood):
                rig.node._out(0x07F, bytes(8))
            return False

        rig.engine.run_until(lambda _: more(), 4.0)
        stopped(rig, begun, "CAN-10", QUICK_STOP_DEG[abs(speed)])

    def test_another_mode(self, owner: str, scan_ms: float, speed: float) -> None:
        """6061 is asked for ten times a second; the drive follows meanwhile, so the way is one of the stop."""
        rig = BusRig(bus_machine(owner, scan_ms)).power_up().cruise(speed)
        rig.inject("drive", "mode_display", mode=3)
        rig.until(lambda: bool(rig.codes), 0.13)
        begun = len(rig.ticks)
        rig.run(4.0)
        stopped(rig, begun, "DRV-06", TORQUE_OFF_DEG[abs(speed)])

    def test_local_control(self, owner: str, scan_ms: float, speed: float) -> None:
        rig = BusRig(bus_machine(owner, scan_ms)).power_up().cruise(speed)
        begun = len(rig.ticks)
        rig.inject("drive", "status", set=0, clear=0x200)
        rig.run(4.0)
        assert "bit 9" in rig.first_told
        stopped(rig, begun, "DRV-05", TORQUE_OFF_DEG[abs(speed)])

    def test_an_emergency_message_without_a_fault(self, owner: str, scan_ms: float, speed: float) -> None:
        rig = BusRig(bus_machine(owner, scan_ms)).power_up().cruise(speed)
        begun = len(rig.ticks)
        rig.ask({"cmd": "event", "event": "emcy", "code": 0x5112})
        rig.run(4.0)
        assert "5112" in rig.first_told
        stopped(rig, begun, "DRV-12", QUICK_STOP_DEG[abs(speed)])


@pytest.mark.parametrize(
    ("scan_ms", "speed"), [pytest.param(1.0, 6.0, marks=pytest.mark.slow), (4.0, 6.0), (10.0, -1.0)]
)
def test_more_frames_than_a_scan_can_read(scan_ms: float, speed: float) -> None:
    """The drive's telegrams wait behind them: what is how old cannot be told, and no encoder is blamed."""
    rig = BusRig(bus_machine("drive", scan_ms)).power_up().cruise(speed)
    begun = len(rig.ticks)
    frames = [can.Message(arbitration_id=0x7E5, is_extended_id=False)] * 700

    def more() -> bool:
        rig.drive.link._bus._waiting.extend(frames)
        return False

    rig.engine.run_until(lambda _: more(), 2.0)
    assert not any(code.startswith("ENC") for code in rig.codes), rig.told
    stopped(rig, begun, "CAN-10", QUICK_STOP_DEG[abs(speed)])


def test_a_flood_of_warnings_is_told_and_stops_nothing() -> None:
    rig = BusRig(bus_machine()).power_up().cruise(3.0)
    for _ in range(20):
        rig.ask({"cmd": "event", "event": "emcy", "code": 0x8120})
        rig.run(0.02)
    assert rig.codes == ["CAN-09"]
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    rig.command(power=False, move=False)
    rig.until(lambda: rig.axis.is_off, 10.0)
    rig.engine.close()


def test_a_fault_with_its_message_is_no_complaint() -> None:
    """The message comes before the state, and only the fault is told, by its name."""
    rig = BusRig(bus_machine()).power_up().cruise(3.0)
    rig.node.axis.fault(0x3210)
    rig.run(4.0)
    assert rig.stops[0] == "DRV-10"
    assert "DC link overvoltage" in rig.first_told
    assert "DRV-12" not in rig.codes
    rig.engine.close()


def test_a_drive_that_misses_its_commands_says_so() -> None:
    """E8: the drive's own deadline stops it, and the first alarm names the cause."""
    rig = BusRig(bus_machine()).power_up().cruise(3.0)
    begun = len(rig.ticks)
    rig.inject("frame", "identifier", can_id=0x202, kind="drop")
    rig.run(4.0)
    assert "8250" in rig.first_told
    stopped(rig, begun, "CAN-05", QUICK_STOP_DEG[3.0])


def test_a_target_that_is_not_zero_keeps_the_drive_off() -> None:
    rig = BusRig(bus_machine())
    rig.node.od.readers[0x60FF, 0] = lambda: 12345
    rig.run(1.0)
    assert rig.codes == ["DRV-08"]
    rig.command(power=True)
    rig.run(1.0)
    assert all(tick.state is not State.ENABLED for tick in rig.ticks)
    rig.engine.close()


def test_another_mode_keeps_the_drive_off() -> None:
    rig = BusRig(bus_machine())
    rig.inject("drive", "mode_display", mode=1)
    rig.run(1.0)
    assert rig.codes == ["DRV-06"]
    rig.command(power=True)
    rig.run(1.0)
    assert all(tick.state is not State.ENABLED for tick in rig.ticks)
    rig.engine.close()


def test_a_sync_that_never_comes_back_is_lost() -> None:
    """On an interface that gives frames back, the one that was sent is missing (E1)."""

    class Silent(can.BusABC):
        channel_info = "gives nothing back"

        def __init__(self) -> None:
            self._can_protocol = can.CanProtocol.CAN_20

        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            pass

    link = BusLink(Silent(), echoes=True, advance=lambda _: None)
    for _ in range(5):
        link.send(0x080, b"")
    assert link.unseen == 5


def test_a_sync_that_does_not_come_back_stops_the_axis() -> None:
    rig = BusRig(bus_machine()).power_up().cruise(3.0)
    begun = len(rig.ticks)
    rig.drive.link.unseen = 9
    rig.run(4.0)
    stopped(rig, begun, "CAN-01", QUICK_STOP_DEG[3.0])


def test_three_uneven_periods_in_a_row_are_told_and_two_are_not() -> None:
    rig = BusRig(bus_machine(scan_ms=4.0))
    rig.run(0.1)
    # The drive of this rig is stepped, so the clock is not looked at: the periods are handed in.
    for elapsed_s in (0.007, 0.007, 0.005, 0.007, 0.001):
        rig.drive._supervision.period(elapsed_s)
        rig.run(0.004)
    assert rig.codes == []
    rig.drive._supervision.period(0.0)
    rig.run(0.01)
    assert rig.codes == ["CAN-02"]
    rig.engine.close()
