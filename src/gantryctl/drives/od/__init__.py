"""What a CANopen object dictionary is: data types, objects, EDS and DCF files, what a speed axis needs of them.

The virtual drive is made of such a description and writes its own EDS from it; the master and the command line
read those of real drives.
"""

from __future__ import annotations

from gantryctl.drives.od.model import (
    Access,
    DeviceDescription,
    DeviceInfo,
    EdsError,
    Entry,
    Note,
    ObjectKind,
    ObjectSpec,
    described,
)
from gantryctl.drives.od.reading import parse_eds, read_eds
from gantryctl.drives.od.types import DataType, Value, bit_length, decode, encode, limits
from gantryctl.drives.od.writing import write_eds

__all__ = [
    "Access",
    "DataType",
    "DeviceDescription",
    "DeviceInfo",
    "EdsError",
    "Entry",
    "Note",
    "ObjectKind",
    "ObjectSpec",
    "Value",
    "bit_length",
    "decode",
    "described",
    "encode",
    "limits",
    "parse_eds",
    "read_eds",
    "write_eds",
]
