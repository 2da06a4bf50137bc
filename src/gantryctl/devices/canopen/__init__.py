"""The CANopen master: a CiA 402 drive in cyclic synchronous velocity behind the `Drive` port.

SYNC and process data belong to the scan; SDO is used before the first scan and after the last one only.
"""

from __future__ import annotations

from gantryctl.devices.canopen.counters import BusCounters
from gantryctl.devices.canopen.drive import CanopenDrive
from gantryctl.devices.canopen.link import BusLink, Link
from gantryctl.devices.canopen.looking import LookedAtDrive
from gantryctl.devices.canopen.matrix import Row, Verdict
from gantryctl.devices.canopen.node import NodeIdentity, RemoteNode
from gantryctl.devices.canopen.settings import CanopenSettings, InputBits

__all__ = [
    "BusCounters",
    "BusLink",
    "CanopenDrive",
    "CanopenSettings",
    "InputBits",
    "Link",
    "LookedAtDrive",
    "NodeIdentity",
    "RemoteNode",
    "Row",
    "Verdict",
]
