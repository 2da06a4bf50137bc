"""Somebody else takes a turning drive out of operation by NMT: it is stopped at once, and what is told is true."""

from __future__ import annotations

import itertools

import pytest

from bus.bus_rig import NOMINAL_M, TORQUE_OFF_DEG, BusRig, bus_machine, few_at_1_ms
from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.program import PowerPhase

pytestmark = pytest.mark.can

STOP, PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 0x02, 0x80, 0x81, 0x82
COMMANDS = (STOP, PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION)
# Speed, command, whether the controller sees the frame; owner of the brake and scan period take turns.
ROWS = [
    (speed, command, seen, ("drive", "object_60FE")[n // 2 % 2], (1.0, 4.0, 10.0)[n % 3])
    for n, (speed, command, seen) in enumerate(itertools.product((6.0, -3.0, 1.0), COMMANDS, (True, False)))
]


@pytest.mark.parametrize(("speed", "command", "seen", "owner", "scan_ms"), few_at_1_ms(ROWS))
def test_a_drive_taken_out_of_operation_stops_at_once(
    speed: float, command: int, seen: bool, owner: str, scan_ms: float
) -> None:
    machine = bus_machine(owner, scan_ms, changes={"plant.load.eccentricity_m": NOMINAL_M})
    rig = BusRig(machine, 60.0).power_up().cruise(speed)
    begun, begun_s = len(rig.ticks), rig.engine.time_s
    rig.foreign(0x000, bytes((command, machine.can.node)), seen=seen)
    rig.run(4.0)
    assert rig.way_deg(begun - 1) < TORQUE_OFF_DEG[abs(speed)]
    end = rig.ticks[-1]
    assert end.state in (State.SWITCH_ON_DISABLED, State.FAULT)
    assert not end.brake_open
    assert not rig.enabled_again(begun)
    assert rig.axis.power.phase is PowerPhase.OFF
    assert rig.stops[0] in ("CAN-03", "CAN-13", "DRV-11")
    assert not rig.axis.feedback.position_valid
    told = rig.first_told
    assert "Nothing was switched on" not in told
    assert "the angle is not known" in told
    # A torque that is said to be off was off by then.
    off_at = next(n for n in range(begun, len(rig.ticks)) if rig.ticks[n].state is end.state) - begun + 1
    said = told.partition("orque seen off after ")[2].partition(" ms")[0]
    alarm_ms = 1e3 * (rig.axis.alarms.first_out.time_s - begun_s)
    # The alarm's own scan began up to a period before what it saw.
    assert not said or off_at <= alarm_ms + int(said) + scan_ms + 1
    assert said or "commanded, not confirmed: press the emergency stop" in told
    rig.engine.close()


def test_a_second_master_locks_the_axis() -> None:
    """E15: a foreign RPDO in motion, and then only service may go on, after the drive has been set up again."""
    rig = BusRig(bus_machine()).power_up().cruise(3.0)
    rig.foreign(0x202, bytes.fromhex("0f00000000000000"))
    rig.run(3.0)
    assert rig.stops == ["CAN-12"]
    rig.command(power=False)
    rig.run(0.1)
    rig.command(reset=True)
    rig.run(0.1)
    assert rig.axis.refusal is not None
    assert "service role" in rig.axis.refusal.text
    assert rig.drive.lost
    rig.engine.close()


@pytest.mark.parametrize(
    ("can_id", "data"),
    [(0x202, bytes(8)), (0x000, b"\x01\x02"), (0x080, b""), (0x602, bytes(8)), (0x77F, b"\x05")],
    ids=["RPDO", "NMT start", "SYNC", "SDO", "heartbeat"],
)
def test_no_enable_after_a_foreign_frame(can_id: int, data: bytes) -> None:
    """Whoever sends what only this controller may send is not known: power stays off until service resets."""
    rig = BusRig(bus_machine())
    rig.run(0.1)
    rig.foreign(can_id, data)
    rig.run(0.1)
    assert rig.stops == ["CAN-12"]
    rig.command(power=True)
    rig.run(1.0)
    assert all(tick.state is not State.ENABLED for tick in rig.ticks)
    rig.engine.close()
