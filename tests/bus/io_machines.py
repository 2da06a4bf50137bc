"""The gantry with an I/O node, and an encoder on the ring, beside its drive; brake and interlocks on the node."""

from __future__ import annotations

from typing import Final

from bus.bus_rig import bus_machine
from gantryctl.machine import Machine

IO: Final[dict[str, object]] = {
    "can.io.node": 3,
    "can.io.inputs.estop_ok": 0,
    "can.io.inputs.enabling_switch": 1,
    "can.io.inputs.door_ok": 2,
    "can.io.inputs.collision_ok": 3,
    "can.io.inputs.motion_permit": 4,
    "can.io.inputs.brake_open": 9,
    "can.io.outputs.brake_release": 0,
    "can.io.outputs.horn": 1,
    "can.io.outputs.lamp": 2,
    "can.io.outputs.in_position": 8,
    "can.io.outputs.at_rest": 9,
}
RING: Final[dict[str, object]] = {"can.load_encoder.source": "node", "can.load_encoder.node": 4}
# The horn of the controller on the drive's own outputs, the brake too.
ON_DRIVE: Final[dict[str, object]] = {
    "can.outputs.brake_release": 16,
    "can.outputs.horn": 17,
    "can.outputs.at_rest": 18,
}


def io_machine(scan_ms: float = 4.0, changes: dict[str, object] | None = None) -> Machine:
    """Brake, emergency stop, door, collision and lamps on the I/O node."""
    return bus_machine("controller_output", scan_ms, changes=IO | (changes or {}))
