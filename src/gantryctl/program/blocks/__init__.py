"""Function blocks under their PLCopen names (without the prefix); docs/reference/blocks.md has the table.

A block is called once per scan with its inputs as keyword arguments and shows its outputs as attributes.
Bad inputs give an error output and no motion, never an exception. `Jog`, `Inch` and `BrakeTest` are vendor
blocks, not PLCopen Part 1. `TON` to `CTU` are the standard blocks of IEC 61131-3.
"""

from gantryctl.program.blocks.administration import BrakeTest, Power, Reset, SetOverride, SetPosition
from gantryctl.program.blocks.by_hand import Inch, Jog
from gantryctl.program.blocks.cam_switch import Cam, CamDirection, DigitalCamSwitch
from gantryctl.program.blocks.motion import (
    Halt,
    Home,
    MoveAbsolute,
    MoveAdditive,
    MoveRelative,
    MoveVelocity,
    Stop,
)
from gantryctl.program.blocks.parameters import ReadBoolParameter, ReadParameter, WriteParameter
from gantryctl.program.blocks.reading import (
    ReadActualPosition,
    ReadActualTorque,
    ReadActualVelocity,
    ReadAxisError,
    ReadAxisInfo,
    ReadMotionState,
    ReadStatus,
)
from gantryctl.program.blocks.standard import CTU, F_TRIG, R_TRIG, RS, SR, TOF, TON, TP
from gantryctl.program.blocks.touch_probe import AbortTrigger, TouchProbe

__all__ = [
    "CTU",
    "F_TRIG",
    "RS",
    "R_TRIG",
    "SR",
    "TOF",
    "TON",
    "TP",
    "AbortTrigger",
    "BrakeTest",
    "Cam",
    "CamDirection",
    "DigitalCamSwitch",
    "Halt",
    "Home",
    "Inch",
    "Jog",
    "MoveAbsolute",
    "MoveAdditive",
    "MoveRelative",
    "MoveVelocity",
    "Power",
    "ReadActualPosition",
    "ReadActualTorque",
    "ReadActualVelocity",
    "ReadAxisError",
    "ReadAxisInfo",
    "ReadBoolParameter",
    "ReadMotionState",
    "ReadParameter",
    "ReadStatus",
    "Reset",
    "SetOverride",
    "SetPosition",
    "Stop",
    "TouchProbe",
    "WriteParameter",
]
