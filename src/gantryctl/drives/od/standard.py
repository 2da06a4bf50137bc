"""Objects of a speed-controlled axis: name, type and access by CiA 301 and CiA 402.

The standard completes a file that leaves a field out, and tells a usable object from another one of the same number.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.drives.od.model import Access
from gantryctl.drives.od.types import DataType

_U8, _U16, _U32 = DataType.UNSIGNED8, DataType.UNSIGNED16, DataType.UNSIGNED32
_I8, _I16, _I32 = DataType.INTEGER8, DataType.INTEGER16, DataType.INTEGER32
_RO, _RW, _CONST = Access.RO, Access.RW, Access.CONST


class Standard(NamedTuple):
    """Name, type and access of an entry by the standards."""

    name: str
    data_type: DataType
    access: Access


# 1000h to 1FFFh by CiA 301, 6000h to 9FFFh by CiA 402.
STANDARD: Final[dict[tuple[int, int], Standard]] = {
    (0x1000, 0): Standard("Device type", _U32, _RO),
    (0x1001, 0): Standard("Error register", _U8, _RO),
    (0x1005, 0): Standard("COB-ID SYNC message", _U32, _RW),
    (0x1006, 0): Standard("Communication cycle period", _U32, _RW),
    (0x1007, 0): Standard("Synchronous window length", _U32, _RW),
    (0x1008, 0): Standard("Manufacturer device name", DataType.VISIBLE_STRING, _CONST),
    (0x1009, 0): Standard("Manufacturer hardware version", DataType.VISIBLE_STRING, _CONST),
    (0x100A, 0): Standard("Manufacturer software version", DataType.VISIBLE_STRING, _CONST),
    (0x1010, 1): Standard("Save all parameters", _U32, _RW),
    (0x1011, 1): Standard("Restore all default parameters", _U32, _RW),
    (0x1014, 0): Standard("COB-ID EMCY", _U32, _RW),
    (0x1016, 1): Standard("Consumer heartbeat time", _U32, _RW),
    (0x1017, 0): Standard("Producer heartbeat time", _U16, _RW),
    (0x1018, 1): Standard("Vendor-ID", _U32, _RO),
    (0x1018, 2): Standard("Product code", _U32, _RO),
    (0x1018, 3): Standard("Revision number", _U32, _RO),
    (0x1018, 4): Standard("Serial number", _U32, _RO),
    (0x1019, 0): Standard("Synchronous counter overflow value", _U8, _RW),
    (0x1029, 1): Standard("Communication error", _U8, _RW),
    (0x1400, 1): Standard("COB-ID used by RPDO 1", _U32, _RW),
    (0x1400, 2): Standard("Transmission type of RPDO 1", _U8, _RW),
    (0x1400, 5): Standard("Event timer of RPDO 1", _U16, _RW),
    (0x1600, 0): Standard("Number of objects mapped in RPDO 1", _U8, _RW),
    (0x1600, 1): Standard("First object mapped in RPDO 1", _U32, _RW),
    (0x1800, 1): Standard("COB-ID used by TPDO 1", _U32, _RW),
    (0x1800, 2): Standard("Transmission type of TPDO 1", _U8, _RW),
    (0x1801, 1): Standard("COB-ID used by TPDO 2", _U32, _RW),
    (0x1A00, 0): Standard("Number of objects mapped in TPDO 1", _U8, _RW),
    (0x1A00, 1): Standard("First object mapped in TPDO 1", _U32, _RW),
    (0x1A01, 0): Standard("Number of objects mapped in TPDO 2", _U8, _RW),
    (0x6007, 0): Standard("Abort connection option code", _I16, _RW),
    (0x603F, 0): Standard("Error code", _U16, _RO),
    (0x6040, 0): Standard("Controlword", _U16, _RW),
    (0x6041, 0): Standard("Statusword", _U16, _RO),
    (0x605A, 0): Standard("Quick stop option code", _I16, _RW),
    (0x605B, 0): Standard("Shutdown option code", _I16, _RW),
    (0x605C, 0): Standard("Disable operation option code", _I16, _RW),
    (0x605D, 0): Standard("Halt option code", _I16, _RW),
    (0x605E, 0): Standard("Fault reaction option code", _I16, _RW),
    (0x6060, 0): Standard("Modes of operation", _I8, _RW),
    (0x6061, 0): Standard("Modes of operation display", _I8, _RO),
    (0x6064, 0): Standard("Position actual value", _I32, _RO),
    (0x606C, 0): Standard("Velocity actual value", _I32, _RO),
    (0x6072, 0): Standard("Max torque", _U16, _RW),
    (0x6075, 0): Standard("Motor rated current", _U32, _RW),
    (0x6076, 0): Standard("Motor rated torque", _U32, _RW),
    (0x6077, 0): Standard("Torque actual value", _I16, _RO),
    (0x607F, 0): Standard("Max profile velocity", _U32, _RW),
    (0x6080, 0): Standard("Max motor speed", _U32, _RW),
    (0x6085, 0): Standard("Quick stop deceleration", _U32, _RW),
    (0x608F, 1): Standard("Encoder increments", _U32, _RW),
    (0x608F, 2): Standard("Motor revolutions", _U32, _RW),
    (0x6091, 1): Standard("Motor revolutions", _U32, _RW),
    (0x6091, 2): Standard("Shaft revolutions", _U32, _RW),
    (0x60A9, 0): Standard("SI unit velocity", _U32, _RW),
    (0x60B1, 0): Standard("Velocity offset", _I32, _RW),
    (0x60B2, 0): Standard("Torque offset", _I16, _RW),
    (0x60C2, 1): Standard("Interpolation time period value", _U8, _RW),
    (0x60C2, 2): Standard("Interpolation time index", _I8, _RW),
    (0x60FD, 0): Standard("Digital inputs", _U32, _RO),
    (0x60FE, 1): Standard("Physical outputs", _U32, _RW),
    (0x60FE, 2): Standard("Output bit mask", _U32, _RW),
    (0x60FF, 0): Standard("Target velocity", _I32, _RW),
    (0x6502, 0): Standard("Supported drive modes", _U32, _RO),
}


def standard_of(index: int, sub: int) -> Standard | None:
    """Standard of an entry, or None; sub-index 0 of records and arrays counts the entries."""
    found = STANDARD.get((index, sub))
    if found is None and sub == 0 and any((index, other) in STANDARD for other in (1, 2, 5)):
        return Standard("Highest sub-index supported", _U8, _RO)
    return found
