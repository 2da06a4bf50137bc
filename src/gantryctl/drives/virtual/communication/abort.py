"""SDO abort codes of the virtual drive, CiA 301."""

from __future__ import annotations

from enum import IntEnum


# The master has a table of its own: two readings of CiA 301 share no mistake (decision 0008).
class Abort(IntEnum):
    """Abort codes that this server sends."""

    TOGGLE = 0x05030000
    """Toggle bit not alternated."""
    COMMAND = 0x05040001
    """Command specifier not valid or unknown; a server without block transfer refuses it so."""
    BLOCK_SIZE = 0x05040002
    SEQUENCE = 0x05040003
    """Invalid sequence number of a block transfer."""
    CHECKSUM = 0x05040004
    OUT_OF_MEMORY = 0x05040005
    WRITE_ONLY = 0x06010001
    """Attempt to read a write-only object."""
    READ_ONLY = 0x06010002
    """Attempt to write a read-only object."""
    NO_OBJECT = 0x06020000
    NOT_MAPPABLE = 0x06040041
    PDO_LENGTH = 0x06040042
    """Number and length of the objects to be mapped exceed the PDO."""
    INCOMPATIBLE = 0x06040043
    """General parameter incompatibility."""
    SIZE = 0x06070010
    """Data type does not match, length of the parameter does not match."""
    SIZE_HIGH = 0x06070012
    SIZE_LOW = 0x06070013
    NO_SUB = 0x06090011
    VALUE = 0x06090030
    """Invalid value for the parameter."""
    VALUE_HIGH = 0x06090031
    VALUE_LOW = 0x06090032
    STORE = 0x08000020
    """Data cannot be transferred or stored to the application."""
    STATE = 0x08000022
    """Data cannot be transferred or stored because of the present device state."""


class SdoAbort(Exception):
    """Refusal of an access by the object dictionary; the server answers it by an SDO abort."""

    def __init__(self, code: Abort) -> None:
        self.code = code
        super().__init__(f"{code.name} ({code.value:08X})")
