"""Function blocks under their PLCopen names (without the prefix); docs/reference/blocks.md has the table.

A block is called once per scan with its inputs as keyword arguments and shows its outputs as attributes.
Bad inputs give an error output and no motion, never an exception. `Jog`, `Inch` and `BrakeTest` are vendor
blocks, not PLCopen Part 1. `TON` to `CTU` are the standard blocks of IEC 61131-3.
"""

from gantryctl.program.blocks.administration import BrakeTest, Power, Reset, SetOverride, SetPosition
from gantryctl.program.blocks.by_hand import Inch, Jog
from gantryctl.program.blocks.motion import Halt, Home, MoveAbsolute, MoveRelative, MoveVelocity, Stop
from gantryctl.program.blocks.reading import (
    ReadActualPosition,
    ReadActualTorque,
    ReadActualVelocity,
    ReadAxisError,
    ReadMotionState,
    ReadStatus,
)
from gantryctl.program.blocks.standard import CTU, F_TRIG, R_TRIG, RS, SR, TOF, TON, TP

__all__ = [
    "CTU",
    "F_TRIG",
    "RS",
    "R_TRIG",
    "SR",
    "TOF",
    "TON",
    "TP",
    "BrakeTest",
    "Halt",
    "Home",
    "Inch",
    "Jog",
    "MoveAbsolute",
    "MoveRelative",
    "MoveVelocity",
    "Power",
    "ReadActualPosition",
    "ReadActualTorque",
    "ReadActualVelocity",
    "ReadAxisError",
    "ReadMotionState",
    "ReadStatus",
    "Reset",
    "SetOverride",
    "SetPosition",
    "Stop",
]
