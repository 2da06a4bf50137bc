"""Object table, communication profile area (CiA 301): data for behaviour and EDS."""

from __future__ import annotations

from typing import Final

from gantryctl.drives.od.model import Access, Entry, ObjectKind, ObjectSpec
from gantryctl.drives.od.types import DataType
from gantryctl.drives.virtual.personality import Personality

PDOS: Final = 4
"""RPDOs, and as many TPDOs."""
MAPPED: Final = 8
"""Entries of one mapping."""
CONSUMERS: Final = 4
ERRORS: Final = 8
"""Length of the error history 1003."""
# Bits 31 and 30 of a PDO identifier (CiA 301).
PDO_INVALID: Final = 0x8000_0000
NO_RTR: Final = 0x4000_0000

U8, U16, U32 = DataType.UNSIGNED8, DataType.UNSIGNED16, DataType.UNSIGNED32
I8, I16, I32 = DataType.INTEGER8, DataType.INTEGER16, DataType.INTEGER32
TEXT = DataType.VISIBLE_STRING
RO, RW, CONST = Access.RO, Access.RW, Access.CONST

VENDOR_ID: Final = 0x0000_07FF
PRODUCT_CODE: Final = 0x0047_0402
REVISION: Final = 0x0001_0000

# Default mapping of each PDO: RPDO entries, TPDO entries, index << 16 | sub << 8 | bits. The first two are the
# default PDO mapping of CiA 402.
_FACTORY: Final = (
    ((0x60400010,), (0x60410010,)),
    ((0x60400010, 0x60600008), (0x60410010, 0x60610008)),
    ((0x60400010, 0x60FF0020), (0x60410010, 0x60640020)),
    ((0x60FF0020, 0x60B20010), (0x60640020, 0x60770010)),
)


def var(
    index: int,
    name: str,
    data_type: DataType,
    access: Access,
    default: int | str | None = 0,
    *,
    maps: bool = False,
    limits: tuple[int, int | None] | None = None,
    volatile: bool = False,
    node: bool = False,
) -> ObjectSpec:
    """Object with one entry."""
    low, high = limits or (None, None)
    one = Entry(index, 0, name, data_type, access, default, node, maps, low, high, volatile=volatile)
    return ObjectSpec(index, name, ObjectKind.VAR, {0: one})


def group(index: int, name: str, kind: ObjectKind, *entries: Entry, count: Access = CONST) -> ObjectSpec:
    """Record or array with its sub-index 0."""
    highest = max(entry.sub for entry in entries)
    zero = Entry(index, 0, "Highest sub-index supported", U8, count, highest)
    return ObjectSpec(index, name, kind, {0: zero, **{entry.sub: entry for entry in entries}})


def communication_objects(kind: Personality, serial_number: int) -> tuple[ObjectSpec, ...]:
    """Objects 1000h to 1FFFh without the PDO parameters."""
    array, record = ObjectKind.ARRAY, ObjectKind.RECORD
    identity = (VENDOR_ID, PRODUCT_CODE, REVISION, serial_number)
    names = ("Vendor-ID", "Product code", "Revision number", "Serial number")
    errors = [Entry(0x1003, n, f"Standard error field {n}", U32, RO, 0) for n in range(1, ERRORS + 1)]
    watched = [Entry(0x1016, n, f"Consumer heartbeat time {n}", U32, RW, 0) for n in range(1, CONSUMERS + 1)]
    groups = ("all parameters", "communication parameters", "application parameters")
    save = [Entry(0x1010, n, f"Save {what}", U32, RW, 1) for n, what in enumerate(groups, 1)]
    load = [Entry(0x1011, n, f"Restore {what}", U32, RW, 1) for n, what in enumerate(groups, 1)]
    return (
        var(0x1000, "Device type", U32, RO, kind.device_type),
        var(0x1001, "Error register", U8, RO, maps=True, volatile=True),
        group(0x1003, "Pre-defined error field", array, *errors, count=RW),
        var(0x1005, "COB-ID SYNC message", U32, RW, 0x80 if kind.sync_cob_id is None else kind.sync_cob_id),
        var(0x1006, "Communication cycle period", U32, RW),
        var(0x1007, "Synchronous window length", U32, RW),
        var(0x1008, "Manufacturer device name", TEXT, CONST, "gantryctl virtual drive"),
        var(0x1009, "Manufacturer hardware version", TEXT, CONST, "simulated"),
        var(0x100A, "Manufacturer software version", TEXT, CONST, "1.0"),
        group(0x1010, "Store parameters", array, *save),
        group(0x1011, "Restore default parameters", array, *load),
        var(0x1014, "COB-ID EMCY", U32, RW, 0x80, node=True),
        var(0x1015, "Inhibit time EMCY", U16, RW),
        group(0x1016, "Consumer heartbeat time", array, *watched),
        var(0x1017, "Producer heartbeat time", U16, RW),
        group(
            0x1018,
            "Identity object",
            record,
            *(
                Entry(0x1018, n, name, U32, RO, value)
                for n, (name, value) in enumerate(zip(names, identity, strict=True), 1)
            ),
        ),
        group(
            0x1029,
            "Error behaviour",
            array,
            Entry(0x1029, 1, "Communication error", U8, RW, 0, low=0, high=2),
        ),
        group(
            0x1200,
            "SDO server parameter",
            record,
            Entry(0x1200, 1, "COB-ID client to server", U32, RO, 0x600, node_relative=True),
            Entry(0x1200, 2, "COB-ID server to client", U32, RO, 0x580, node_relative=True),
        ),
    )


def pdo_objects(kind: Personality) -> tuple[ObjectSpec, ...]:
    """PDO parameters from 1400h, 1600h, 1800h, 1A00h on; by default the first PDO of each direction is valid."""
    found: list[ObjectSpec] = []
    for number in range(PDOS):
        receive, transmit = _FACTORY[number]
        off = 0 if number == 0 else PDO_INVALID
        found += [
            group(
                0x1400 + number,
                f"RPDO {number + 1} communication parameter",
                ObjectKind.RECORD,
                *_communication(0x1400 + number, 0x200 + 0x100 * number | off, transmit=False),
            ),
            group(
                0x1800 + number,
                f"TPDO {number + 1} communication parameter",
                ObjectKind.RECORD,
                *_communication(0x1800 + number, 0x180 + 0x100 * number | NO_RTR | off, transmit=True),
            ),
            _mapping(0x1600 + number, f"RPDO {number + 1} mapping parameter", receive, kind),
            _mapping(0x1A00 + number, f"TPDO {number + 1} mapping parameter", transmit, kind),
        ]
    return tuple(found)


def _communication(index: int, cob_id: int, transmit: bool) -> tuple[Entry, ...]:
    inhibit = Entry(index, 3, "Inhibit time", U16, RW, 0)
    return (
        Entry(index, 1, "COB-ID used by PDO", U32, RW, cob_id, node_relative=True),
        Entry(index, 2, "Transmission type", U8, RW, 255),
        *((inhibit,) if transmit else ()),
        Entry(index, 5, "Event timer", U16, RW, 0),
    )


def _mapping(index: int, name: str, factory: tuple[int, ...], kind: Personality) -> ObjectSpec:
    usable = [entry for entry in factory if entry >> 16 not in (*kind.absent, *kind.not_mappable)]
    padded = [*usable, *[0] * (MAPPED - len(usable))]
    entries = {0: Entry(index, 0, "Number of mapped objects", U8, RW, len(usable))}
    entries |= {n: Entry(index, n, f"Mapped object {n}", U32, RW, value) for n, value in enumerate(padded, 1)}
    return ObjectSpec(index, name, ObjectKind.ARRAY if kind.array_mapping else ObjectKind.RECORD, entries)
