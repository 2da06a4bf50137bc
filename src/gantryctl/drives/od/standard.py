"""Objects of a speed-controlled axis: name, type and access by CiA 301 and CiA 402, and what an axis in CSV needs.

The standard completes a file that leaves a field out, and tells a usable object from another one of the same number.
The table of needs is compared with an EDS.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Literal, NamedTuple

from gantryctl.drives.od.model import Access, DeviceDescription, Entry, ObjectKind
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


class Need(StrEnum):
    """Importance of an entry."""

    MUST = "must"
    """Without it there is no CSV axis."""
    STOP = "stop"
    """Decides what happens when something breaks; without it something else must."""
    MAY = "may"
    """Makes the axis better."""


@dataclass(frozen=True, slots=True)
class Wish:
    """Row of the table of needs."""

    index: int
    sub: int
    need: Need
    pdo: Literal["", "RPDO", "TPDO"]
    """Direction in which the entry must be mappable."""
    without: str
    """Substitute or consequence where the drive lacks it."""

    @property
    def standard(self) -> Standard:
        """Name, type and access by the standards."""
        return STANDARD[self.index, self.sub]

    @property
    def place(self) -> str:
        """Index and sub-index in the usual notation."""
        return f"{self.index:04X}:{self.sub:02X}"


_MUST, _STOP, _MAY = Need.MUST, Need.STOP, Need.MAY
_NO: Final = ""
_RX: Final = "RPDO"
_TX: Final = "TPDO"

# Optional objects must stay optional: of 30 real EDS files 20 have no 603F, and in 23 60B1 is missing or not mappable.
WISHES: Final[tuple[Wish, ...]] = (
    Wish(0x6040, 0, _MUST, _RX, "no CiA 402 drive"),
    Wish(0x6041, 0, _MUST, _TX, "no CiA 402 drive"),
    Wish(0x6060, 0, _MUST, _NO, "CSV cannot be selected"),
    Wish(0x6061, 0, _MUST, _NO, "the mode in force cannot be read"),
    Wish(0x6064, 0, _MUST, _TX, "no position feedback"),
    Wish(0x60FF, 0, _MUST, _RX, "no speed command"),
    Wish(0x1400, 1, _MUST, _NO, "no RPDO that could be set up"),
    Wish(0x1400, 2, _MUST, _NO, "the RPDO cannot be made synchronous"),
    Wish(0x1600, 1, _MUST, _NO, "the RPDO has a fixed mapping: usable only if it happens to fit"),
    Wish(0x1800, 1, _MUST, _NO, "no TPDO that could be set up"),
    Wish(0x1800, 2, _MUST, _NO, "the TPDO cannot be made synchronous"),
    Wish(0x1A00, 1, _MUST, _NO, "the TPDO has a fixed mapping: usable only if it happens to fit"),
    Wish(0x1016, 1, _STOP, _NO, "the drive does not watch the controller: only 1400:05 stops a silent axis"),
    Wish(0x1400, 5, _STOP, _NO, "no RPDO deadline: a stuck controller is noticed by heartbeat only"),
    Wish(0x6007, 0, _STOP, _NO, "the reaction to lost communication is fixed: prove it at standstill"),
    Wish(0x1029, 1, _STOP, _NO, "the NMT reaction to lost communication is fixed: prove it at standstill"),
    Wish(0x605A, 0, _STOP, _NO, "the quick stop is the drive's own: measure it before trusting it"),
    Wish(0x605B, 0, _STOP, _NO, "shutdown is the drive's own; the ramp is done by the controller first"),
    Wish(0x605C, 0, _STOP, _NO, "disable operation is the drive's own; the ramp is done by the controller first"),
    Wish(0x605D, 0, _STOP, _NO, "halt is not used in CSV: nothing is lost"),
    Wish(0x605E, 0, _STOP, _NO, "the reaction to a drive fault is fixed: count on torque off and brake"),
    Wish(0x6085, 0, _STOP, _NO, "the quick-stop ramp is set in the drive's own tool: measure it"),
    Wish(0x6080, 0, _STOP, _NO, "no speed ceiling in the drive: 607F if it acts in CSV, else the overspeed monitor"),
    Wish(0x6072, 0, _STOP, _NO, "no torque limit over the bus: set it in the drive's own tool"),
    Wish(0x1017, 0, _STOP, _NO, "no heartbeat of the drive: its silence shows by missing TPDOs only"),
    Wish(0x6502, 0, _MAY, _NO, "CSV support must be shown by a test: some drives accept mode 9 and never move"),
    Wish(0x60C2, 1, _MAY, _NO, "the drive cannot be told the SYNC period"),
    Wish(0x60C2, 2, _MAY, _NO, "the drive cannot be told the SYNC period"),
    Wish(0x606C, 0, _MAY, _TX, "speed from differences of 6064"),
    Wish(0x6077, 0, _MAY, _TX, "no torque: no torque proof before the brake opens, sag is watched instead"),
    Wish(0x60B2, 0, _MAY, _RX, "no torque preload: the drive's own brake sequence, sag is watched"),
    Wish(0x60B1, 0, _MAY, _RX, "speed feed-forward goes into 60FF"),
    Wish(0x603F, 0, _MAY, _TX, "error codes from EMCY only"),
    Wish(0x60FD, 0, _MAY, _TX, "no digital inputs over the bus"),
    Wish(0x60FE, 1, _MAY, _RX, "the brake cannot be worked by 60FE"),
    Wish(0x6076, 0, _MAY, _NO, "torque scale from the machine file only"),
    Wish(0x6075, 0, _MAY, _NO, "current scale from the machine file only"),
    Wish(0x608F, 1, _MAY, _NO, "encoder resolution from the machine file only; the test move proves it"),
    Wish(0x1005, 0, _MAY, _NO, "the SYNC identifier is taken for 0x80: prove that the drive reacts"),
    Wish(0x1006, 0, _MAY, _NO, "the drive does not know the SYNC period from here (see 60C2)"),
    Wish(0x1018, 1, _MAY, _NO, "identity by name and versions only"),
    Wish(0x1018, 4, _MAY, _NO, "one drive cannot be told from another of its kind"),
    Wish(0x100A, 0, _MAY, _NO, "the firmware version is not pinned"),
    Wish(0x1010, 1, _MAY, _NO, "parameters are lost at power off: written at every start"),
)  # fmt: skip


class Finding(NamedTuple):
    """Comparison of one need with a file."""

    wish: Wish
    entry: Entry | None
    ok: bool
    remarks: tuple[str, ...]
    """Oddities, and the substitute for a missing entry."""


def check_csv_axis(device: DeviceDescription) -> tuple[Finding, ...]:
    """Compare every need of a CSV axis with a file."""
    return tuple(_finding(device, wish) for wish in WISHES)


def lacking(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Unmet needs without which there is no CSV axis."""
    return tuple(finding for finding in findings if finding.wish.need is Need.MUST and not finding.ok)


def _finding(device: DeviceDescription, wish: Wish) -> Finding:
    entry = device.entry(wish.index, wish.sub)
    if entry is None:
        return Finding(wish, None, False, (wish.without,))
    wrong = []
    if entry.data_type is not wish.standard.data_type:
        wrong.append(f"is {entry.data_type.label} instead of {wish.standard.data_type.label}")
    if wish.standard.access.writable and not entry.access.writable:
        wrong.append("cannot be written")
    if not wish.standard.access.writable and not entry.access.readable:
        wrong.append("cannot be read")
    if (wish.pdo == _RX and not entry.rpdo) or (wish.pdo == _TX and not entry.tpdo):
        wrong.append(f"cannot be mapped into a {wish.pdo}")
    if wrong:
        return Finding(wish, entry, False, (*wrong, wish.without))
    return Finding(wish, entry, True, _remarks(device, wish, entry))


def _remarks(device: DeviceDescription, wish: Wish, entry: Entry) -> tuple[str, ...]:
    """Remarks on a value in the file."""
    # A default in a file is no promise: everything is read back from the drive.
    value = entry.value if entry.value is not None else entry.default
    said = []
    match wish.index, value:
        case 0x6502, None:
            said.append("the file does not say which modes: read from the drive")
        case 0x6502, int() if not value & 0x100:
            said.append(f"0x{value:X} has no CSV (bit 8): the drive may accept mode 9 and never move")
        case 0x6007, 0:
            said.append("0 = a silent controller lets this axis run on: 3 (quick stop) is written")
        case 0x605A, 0:
            said.append("0 = quick stop only switches the torque off: 2 or 6 is written")
        case 0x605E, 0:
            said.append("0 = a fault takes the torque off without a ramp")
        case 0x1005, int() if value & 0x7FF != 0x80:
            said.append(f"SYNC on identifier 0x{value & 0x7FF:X}: 0x80 is written")
        case 0x6085, int():
            said.append(f"{value} in the drive's unit; the machine's own is written before the first enable")
    if wish.index in (0x1600, 0x1A00) and device.objects[wish.index].kind is ObjectKind.ARRAY:
        said.append("declared as ARRAY: common libraries then map nothing; we map by plain SDO and read back")
    return tuple(said)
