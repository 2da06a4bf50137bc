"""Rows of the alarm table: the bus between controller and drive."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Reaction, Severity
from gantryctl.program.alarms.definition import Definition

_STOP: Final = Severity.STOP
_QS, _TO = Reaction.QUICK_STOP, Reaction.TORQUE_OFF

_CABLE: Final = (
    "Check bus cable, terminators and load. Reset with power off, or start again: it sets the drive up anew."
)

BUS: Final = (
    Definition(
        Code.CAN_06, "Heartbeat of the drive lost", _STOP, _TO,
        "The drive's heartbeat is missing",
        "The drive is switched off, has crashed, or its cable is open.",
        _CABLE,
    ),
    Definition(
        Code.CAN_07, "Reading too old", _STOP, _QS,
        "The drive's reading is {measured:.0f} ms old, limit {limit:.0f} ms",
        "The drive's telegrams come late or not at all.",
        "Check bus cable, terminators and load, then reset.",
    ),
    Definition(
        Code.CAN_08, "Bus down", _STOP, _TO,
        "The CAN controller sends or receives no more",
        "Bus-off, an open or short cable, or the adapter was unplugged. The drive's own watch stops the axis.",
        _CABLE,
    ),
    Definition(
        Code.CAN_12, "Another master on the bus", _STOP, _QS,
        "Telegrams that only this controller may send came from somebody else",
        "A second controller, or a service tool that takes part in control.",
        "Take it off the bus, then reset.",
    ),
    Definition(
        Code.CAN_13, "Drive not operational", _STOP, _TO,
        "The drive has left the NMT state OPERATIONAL",
        "The drive lost the controller's heartbeat, or somebody else stopped it.",
        _CABLE,
    ),
    Definition(
        Code.DRV_05, "Command ignored", _STOP, _QS,
        "The drive is enabled and does not follow the speed command (bit 12 of 6041 is 0)",
        "Local control, a limit inside the drive, or a wrong mode.",
        "Read the drive's own display, remove the cause, then reset.",
    ),
    Definition(
        Code.DRV_09, "Drive parameter changed", Severity.WARNING, Reaction.HLT,
        "A parameter of the drive is not what it was set to: {measured}",
        "Somebody changed it while the drive was run, by a service tool or at the drive itself.",
        "Find out who. Switch power off and reset: the drive is set up anew. No motion before.", blocks_motion=True,
    ),
    Definition(
        Code.DRV_11, "Drive restarted", _STOP, _TO,
        "The drive has restarted by itself",
        "Its supply failed, or somebody reset it. It has forgotten what the controller told it.",
        "Look for the cause. Reset with power off, or start again: it sets the drive up anew.",
    ),
)  # fmt: skip
