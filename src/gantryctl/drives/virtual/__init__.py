"""The virtual drive: a CANopen node (CiA 301, CiA 402) with the whole gantry behind it.

Written against the CiA texts, not against our master. `DriveNode` is the drive: frames in, frames out, time as an
argument. `DirectBus` puts it on a python-can bus in the same thread, `DriveLoop` on any python-can bus, in real time
or stepped by SYNC; `ControlServer` and `Requests` are its side channel for faults and truth.
"""

from __future__ import annotations

from gantryctl.drives.virtual.axis.hardware import Hardware
from gantryctl.drives.virtual.communication.drive_objects import device_tables
from gantryctl.drives.virtual.communication.store import ParameterStore
from gantryctl.drives.virtual.loop import DirectBus, DriveLoop, FrameSender, running
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.personality import PERSONALITIES, Personality, personality
from gantryctl.drives.virtual.side_channel.control import ControlClient, ControlServer
from gantryctl.drives.virtual.side_channel.requests import Requests

__all__ = [
    "PERSONALITIES",
    "ControlClient",
    "ControlServer",
    "DirectBus",
    "DriveLoop",
    "DriveNode",
    "FrameSender",
    "Hardware",
    "ParameterStore",
    "Personality",
    "Requests",
    "device_tables",
    "personality",
    "running",
]
