"""A controller killed in motion, and the way of its axis by the account of the virtual drive: its time, its motor side.

What this computer does meanwhile does not enter: the drive says when the last telegram came, in its own time.
"""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from gantryctl.engineering.stops import StopClass, worst_stop
from gantryctl.machine import Machine
from gantryctl.wiring.simulator import plant_params

DRIVE_TICK_S: Final = 0.001
"""Period of the supervision of the virtual drive."""
TICKS: Final = 2
"""The drive looks at its deadline once a tick, and its ramp begins with the next one."""
STILL_DEG_S = 0.05
"""Motor side: below this the axis stands (`engineering.stops`)."""

Ask = Callable[..., dict[str, Any]]


class SilentStop(NamedTuple):
    """Way from the last telegram of a dead controller to rest.

    What does not enter, and why: the scan period, because a controller that dies between two telegrams has sent its
    last one before, so that the way from its death is the shorter one; and the phase of SYNC, because the deadline runs
    from the reception, whether or not the telegram has taken effect.

    Attributes:
        deadline_s: without an RPDO for this long the drive stops the axis (1400:05); it runs from the last one on.
        tick_s: added by the drive's clock.
        speed_deg_s: the highest that the motor side can have when the ramp begins.
        reaction_deg: way at this speed until the ramp begins.
        stop_deg: the quick stop from this speed on the full plant, with the eccentric moment of the check.
    """

    deadline_s: float
    tick_s: float
    speed_deg_s: float
    reaction_deg: float
    stop_deg: float

    @property
    def angle_deg(self) -> float:
        """The whole way."""
        return self.reaction_deg + self.stop_deg


def silent_stop(machine: Machine, speed_deg_s: float) -> SilentStop:
    """The stop of the axis of a dead controller, counted from its last telegram.

    Args:
        speed_deg_s: the larger of the speed at the last telegram and of the speed that it commands.
    """
    # An axis that speeds up goes beyond its last command: when the ramp ends, the load swings on the spring of the
    # gear with a / omega and takes the motor with it, by less. Seen over UDP: 6.06 deg/s of 6 half a second after a
    # ramp of 2 deg/s2; on vcan0 the way from 3.03 deg/s in the ramp was 0.0001 deg longer than without the swing.
    plant = plant_params(machine)
    swing_deg_s = machine.virtual_axis.acc_deg_s2 / math.sqrt(
        plant.stiffness_1_nm_per_rad / plant.inertia_load_kg_m2
    )
    speed = abs(speed_deg_s) + swing_deg_s
    deadline_s, tick_s = machine.can.rpdo_deadline_ms * 1e-3, TICKS * DRIVE_TICK_S
    stop = worst_stop(machine, StopClass.QUICK, speed)
    return SilentStop(deadline_s, tick_s, speed, speed * (deadline_s + tick_s), stop.angle_deg)


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
    stop = silent_stop(machine, max(abs(speed_deg_s), abs(command_deg_s)))
    return {
        "speed_deg_s": round(speed_deg_s, 4),
        "command_deg_s": round(command_deg_s, 4),
        "travelled_deg": round(abs(way - speed_deg_s * gap_s), 4),
        "from_reading_to_last_telegram_s": round(gap_s, 4),
        "highest_deg_s": round(stop.speed_deg_s, 4),
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
