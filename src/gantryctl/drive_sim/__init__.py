"""The virtual drive: a CANopen node (CiA 301, CiA 402) with the whole gantry behind it.

Written against the CiA texts, not against our master. `DriveNode` is the drive: frames in, frames out, time as an
argument. `DirectBus` puts it on a python-can bus in the same thread, `DriveLoop` on any python-can bus, in real time
or stepped by SYNC; `ControlServer` and `Requests` are its side channel for faults and truth.
"""

from __future__ import annotations

from gantryctl.drive_sim.control import ControlClient, ControlServer
from gantryctl.drive_sim.direct import DirectBus
from gantryctl.drive_sim.hardware import Hardware
from gantryctl.drive_sim.loop import BusLink, DriveLoop, running
from gantryctl.drive_sim.node import DriveNode
from gantryctl.drive_sim.personality import PERSONALITIES, Personality, personality
from gantryctl.drive_sim.requests import Requests
from gantryctl.drive_sim.store import ParameterStore
from gantryctl.drive_sim.table_drive import device_tables

__all__ = [
    "PERSONALITIES",
    "BusLink",
    "ControlClient",
    "ControlServer",
    "DirectBus",
    "DriveLoop",
    "DriveNode",
    "Hardware",
    "ParameterStore",
    "Personality",
    "Requests",
    "device_tables",
    "personality",
    "running",
]
