"""Tags while the axis is being commissioned: what the drive shows; what only a program knows is off, or null."""

from __future__ import annotations

import math
from importlib.metadata import version
from typing import Any

from gantryctl.commissioning.watch import Seen
from gantryctl.image import DriveState
from gantryctl.machine import Machine
from gantryctl.program import AxisState, BrakeTestPhase, PowerPhase
from gantryctl.program.alarms.log import messages_to_wire
from gantryctl.program.alarms.words import Words
from gantryctl.service.command.arming import Armed
from gantryctl.service.controller.publisher import control_tags, fitted, machine_tags
from gantryctl.service.memory.snapshot import FAST
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.tags import BY_NAME


def fast_tags(machine: Machine, seen: Seen | None, *, moves: bool, holds_load: bool) -> dict[str, float]:
    """The 20 Hz tags.

    Args:
        seen: what the step under way sees; None without one, or before it has opened the drive.
        moves: the step under way can move the axis.
        holds_load: torque alone holds the load of the step under way.
    """
    found = {name: math.nan if BY_NAME[name].null else 0.0 for name in FAST}
    # Nobody vouches for the angle: encoder and zero offset are being proven.
    pos_deg = math.nan if seen is None or seen.angle_deg is None else seen.angle_deg
    vel_deg_s = math.nan if seen is None or seen.speed_deg_s is None else seen.speed_deg_s
    found |= {
        "pos_act_deg": pos_deg,
        "vel_act_deg_s": vel_deg_s,
        "pos_ref_deg": pos_deg if math.isfinite(pos_deg) else 0.0,
        "axis_state": AxisState.DISABLED,
        "power_phase": (PowerPhase.TORQUE_HOLD if holds_load else PowerPhase.OFF).value,
        "brake_test_phase": BrakeTestPhase.IDLE.value,
        "at_rest": not moves,
        "following_error_trip_deg": machine.monitors.following_error_base_deg,
        "drive_state": DriveState.UNKNOWN,
    }
    drive = None if seen is None else seen.drive
    if drive is None:
        return found
    inputs = drive.inputs
    return found | {
        "drive_state": drive.state,
        "torque_act_nm": drive.torque_act_nm,
        "brake_open": drive.brake_open,
        "brake_open_cmd": drive.brake_open,
        "estop_ok": inputs.estop_ok,
        "enabling_switch": inputs.enabling_switch,
        "limit_minus_ok": inputs.limit_minus_ok,
        "limit_plus_ok": inputs.limit_plus_ok,
        "mains_ready": inputs.mains_ready,
        "collision_ok": fitted(inputs.collision_ok),
        "door_ok": fitted(inputs.door_ok),
        "motion_permit": fitted(inputs.motion_permit),
        "estop_ok_2": fitted(inputs.estop_ok_2),
    }


def slow_tags(
    machine: Machine, holder: Identity | None, armed: Armed | None, *, second_person: bool
) -> dict[str, Any]:
    """The tags that are sent on change, as far as they mean something now."""
    return {
        **machine_tags(machine),
        **control_tags(holder, armed, second_person=second_person),
        "version": version("gantryctl"),
        "mode": "none",
        "blocked_by": str(Words.BEING_COMMISSIONED),
        "blocked_by_messages": messages_to_wire(Words.BEING_COMMISSIONED),
        "refusal_text": "",
        "refusal_messages": [],
        "reset_locked": False,
        "commissioning_available": True,
    }
