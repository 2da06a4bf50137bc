"""A controller killed in motion, and the way of its axis by the account of the virtual drive: its time, its motor side.

What this computer does meanwhile does not enter: the drive says when the last telegram came, in its own time.
"""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Callable
from typing import Any

from gantryctl.engineering.stops.silence import silent_stop
from gantryctl.machine import Machine

DRIVE_TICK_S = 0.001
STILL_DEG_S = 0.05
"""Motor side: below this the axis stands (`engineering.stops`)."""

Ask = Callable[..., dict[str, Any]]


def kill_in_motion(ask: Ask, machine: Machine, pid: int) -> dict[str, Any]:
    """Kill the controller `pid`; way, times and limit, the way from the last telegram that the drive has got.

    Args:
        ask: of the drive's side channel.
    """
    assert machine.can.velocity_unit == "inc/s"
    before = ask("truth")
    os.kill(pid, signal.SIGKILL)
    speed_deg_s = math.degrees(before["vel_motor_rad_s"]) / machine.axis.ratio
    # Twice the deadline later, not at rest: a supervisor may have the next controller on the bus by then.
    while (status := ask("status"))["time_s"] < before[
        "time_s"
    ] + 2.0 * machine.can.rpdo_deadline_ms / 1000.0:
        pass
    last_s = status["command_s"]
    turns = ask("read", index=0x60FF, sub=0)["value"] / machine.can.increments_per_turn
    while True:
        now = ask("truth")
        slow = abs(math.degrees(now["vel_motor_rad_s"])) / machine.axis.ratio < STILL_DEG_S
        if (slow and now["time_s"] > before["time_s"] + 0.2) or now["time_s"] > before["time_s"] + 10.0:
            break
    # At rest the drive closes its brake, then takes the torque off.
    while (status := ask("status"))["state"] == "FAULT_REACTION" and status["time_s"] < now["time_s"] + 2.0:
        pass
    command_deg_s = 360.0 * turns / machine.axis.ratio
    # From the reading before the kill to the last telegram: some ms at a steady speed.
    gap_s = last_s - before["time_s"]
    way = math.degrees(now["pos_motor_rad"] - before["pos_motor_rad"]) / machine.axis.ratio
    stop = silent_stop(machine, max(abs(speed_deg_s), abs(command_deg_s)), DRIVE_TICK_S)
    return {
        "speed_deg_s": round(speed_deg_s, 4),
        "command_deg_s": round(command_deg_s, 4),
        "travelled_deg": round(abs(way - speed_deg_s * gap_s), 4),
        "from_reading_to_last_telegram_s": round(gap_s, 4),
        "deadline_s": stop.deadline_s,
        "drive_ticks_s": stop.tick_s,
        "reaction_deg": round(stop.reaction_deg, 4),
        "quick_stop_deg": round(stop.stop_deg, 4),
        "limit_deg": round(stop.angle_deg, 4),
        "state": status["state"],
        "error_code": status["error_code"],
        "brake_open": status["brake_open"],
    }


def judge(run: dict[str, Any]) -> None:
    """Hold a run to what deadline, clock and ramp of the drive add up to."""
    assert 0.0 < run["travelled_deg"] <= run["limit_deg"], run
    # Sooner than the deadline nothing stops: the way is also not shorter than that of a much harder ramp.
    assert run["travelled_deg"] > abs(run["command_deg_s"]) * run["deadline_s"], run
    assert run["state"] == "FAULT", run
    # 8130: heartbeat lost, 8250: RPDO deadline (CiA 301). The deadline comes first by 100 ms.
    assert run["error_code"] == 0x8250, run
    assert run["brake_open"] is False, run
