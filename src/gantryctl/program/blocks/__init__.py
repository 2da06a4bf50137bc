"""Function blocks under their PLCopen names (without the prefix); docs/reference/blocks.md has the table.

A block is called once per scan with its inputs as keyword arguments and shows its outputs as attributes.
Bad inputs give an error output and no motion, never an exception. `Jog`, `Inch` and `BrakeTest` are vendor
blocks, not PLCopen Part 1.
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

__all__ = [
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
