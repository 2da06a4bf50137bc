"""The CANopen master: a CiA 402 drive in cyclic synchronous velocity behind the `Drive` port.

SYNC and process data belong to the scan; SDO is used before the first scan and after the last one only.
"""

from __future__ import annotations

from gantryctl.drives.canopen.bus.link import BusLink, Link
from gantryctl.drives.canopen.bus.node import NodeIdentity, RemoteNode
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.canopen.settings import CanopenSettings, InputBits
from gantryctl.drives.canopen.setup.parameter_check import ParameterRow, ParameterVerdict
from gantryctl.drives.canopen.setup.read_only import ReadOnlyDrive

__all__ = [
    "BusLink",
    "CanopenDrive",
    "CanopenSettings",
    "InputBits",
    "Link",
    "NodeIdentity",
    "ParameterRow",
    "ParameterVerdict",
    "ReadOnlyDrive",
    "RemoteNode",
]
