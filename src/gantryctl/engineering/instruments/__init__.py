"""Instruments that measure the angle of the gantry from outside the control loop.

port         what is asked of an instrument: `Instrument`, `Reading`
line_port    one behind a line of text: TCP, serial
line_server  the other end: an instrument of this process, served to others
by_hand      a person who reads and gives the number
ring_encoder the encoder on the ring of the machine itself
sources      what makes the angle of a tracker, level, autocollimator or ring encoder wrong, and instruments made of it
tracker      a simulated laser tracker with its errors
load_encoder, motor_side: what an encoder makes of the mean angles of a simulated dwell, rad: first the load in
             space, then, where known, the ring against its base, then the motor at the gantry
"""

from __future__ import annotations

from gantryctl.engineering.instruments.by_hand import ByHand
from gantryctl.engineering.instruments.line_port import LinePort, parse_address
from gantryctl.engineering.instruments.load_encoder import LoadEncoder
from gantryctl.engineering.instruments.motor_side import MotorSide
from gantryctl.engineering.instruments.port import Instrument, Reading
from gantryctl.engineering.instruments.ring_encoder import RingEncoder
from gantryctl.engineering.instruments.tracker import SimulatedTracker, TrackerErrors

__all__ = [
    "ByHand",
    "Instrument",
    "LinePort",
    "LoadEncoder",
    "MotorSide",
    "Reading",
    "RingEncoder",
    "SimulatedTracker",
    "TrackerErrors",
    "parse_address",
]
