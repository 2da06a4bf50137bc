"""Instruments that measure the angle of the gantry from outside the control loop.

A dwell at one stop is described by its mean angles, rad: first the load in space (what a tracker sees),
then, where known, the ring against its base (what an encoder on the ring sees), then the motor at the gantry
(what the drive's own encoder sees). Every instrument takes the one it can see.
"""

from __future__ import annotations

from gantryctl.engineering.instruments.load_encoder import LoadEncoder
from gantryctl.engineering.instruments.motor_side import MotorSide

__all__ = ["LoadEncoder", "MotorSide"]
