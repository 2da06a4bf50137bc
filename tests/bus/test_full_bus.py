"""Frames of others up to a full bus: noticed when there is no room or no time, and never blamed on the encoder."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from bus.bus_rig import QUICK_STOP_DEG, BusRig, bus_machine
from gantryctl.program import AxisState

pytestmark = pytest.mark.can

HALF_PER_MS = 4.5
"""Frames of 8 bytes, 111 bits each without stuff bits: half of 1 Mbit/s."""
JUMP_DEG = 0.5
"""More than the axis turns in the 30 ms and two scans by which a telegram may be late, at 3 deg/s and 10 ms."""


def half_full(rig: BusRig) -> Callable[[object], bool]:
    """Frames of somebody else after each scan, on half of the bus."""
    frames = round(HALF_PER_MS * rig.machine.control.scan_period_ms)

    def more(_: object) -> bool:
        for _frame in range(frames):
            rig.node._out(0x07F, bytes(8))
        return False

    return more


def ended(rig: BusRig) -> None:
    """Bring the axis to rest, with power off."""
    rig.command(power=False, move=False)
    rig.until(lambda: rig.axis.is_off, 10.0)
    rig.engine.close()


@pytest.mark.parametrize("scan_ms", [pytest.param(1.0, marks=pytest.mark.slow), 4.0, 10.0])
def test_a_half_full_bus_is_no_alarm(scan_ms: float) -> None:
    rig = BusRig(bus_machine("drive", scan_ms)).power_up().cruise(6.0)
    rig.engine.run_until(half_full(rig), 1.0)
    assert rig.codes == []
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    ended(rig)


@pytest.mark.parametrize(
    ("scan_ms", "speed", "lag", "count"),
    [
        (10.0, 6.0, 1, 30),
        (10.0, -6.0, 2, 30),
        (4.0, 6.0, 2, 30),
        pytest.param(1.0, 3.0, 2, 30, marks=pytest.mark.slow),
    ],
)
def test_telegrams_held_up_by_frames_of_others_are_no_jump_and_no_second_sender(
    scan_ms: float, speed: float, lag: int, count: int
) -> None:
    """Every telegram comes some SYNCs late for a time, then all that are outstanding come at once."""
    rig = BusRig(bus_machine("drive", scan_ms)).power_up().cruise(speed)
    more = half_full(rig)
    rig.engine.run_until(more, 0.1)
    for number in (1, 2):
        rig.spoil_telegrams(number, "delay", lag, count)
    rig.engine.run_until(more, 0.8)
    assert max(rig.drive.health().duplicated) == lag  # those that came at once
    assert rig.codes == []
    ended(rig)


@pytest.mark.parametrize("scan_ms", [1.0, 4.0, 10.0])
def test_a_jump_of_the_encoder_is_found_on_a_half_full_bus(scan_ms: float) -> None:
    """Even while telegrams are held up: the reading goes further than the axis can in all that time."""
    rig = BusRig(bus_machine("drive", scan_ms)).power_up().cruise(3.0)
    more = half_full(rig)
    for number in (1, 2):
        rig.spoil_telegrams(number, "delay")
    rig.engine.run_until(more, 0.2)
    assert rig.codes == []
    jump_turns = JUMP_DEG / 360.0 * rig.machine.axis.ratio
    rig.node.faults.position_offset = round(jump_turns * rig.machine.can.increments_per_turn)
    rig.engine.run_until(more, 2.0)
    assert rig.stops[0] == "ENC-01", rig.told
    rig.engine.close()


@pytest.mark.parametrize(("every", "full"), [(3, True), (6, False)])
def test_frames_that_cannot_all_be_read_now_and_then(every: int, full: bool) -> None:
    """A rest in every third scan is a bus that is too full, in every sixth a computer that was held up."""
    rig = BusRig(bus_machine("drive", 10.0)).power_up().cruise(3.0)
    begun, scans, drain = len(rig.ticks), 0, rig.drive.node.drain

    def cut_off(within_s: float = math.inf) -> bool:
        nonlocal scans
        scans += 1
        return drain(within_s) and scans % every != 0

    rig.drive.node.drain = cut_off
    rig.run(1.0)
    if full:
        assert rig.stops[0] == "CAN-10", rig.told
        # The third rest comes within ten scans.
        assert rig.way_deg(begun - 1) < QUICK_STOP_DEG[3.0] + 3.0 * 0.1
        rig.engine.close()
    else:
        assert rig.codes == []
        ended(rig)
