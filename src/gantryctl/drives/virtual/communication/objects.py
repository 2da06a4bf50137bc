"""Object table: communication area (CiA 301), drive profile (CiA 402), manufacturer objects; for behaviour and EDS."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Final

from gantryctl.drives.od.model import (
    Access,
    DeviceDescription,
    DeviceInfo,
    Entry,
    ObjectKind,
    ObjectSpec,
    described,
)
from gantryctl.drives.od.types import DataType
from gantryctl.drives.od.velocity_units import VELOCITY_UNITS
from gantryctl.drives.virtual.axis.hardware import Hardware, Scaling, r_min
from gantryctl.drives.virtual.communication.overlay import lay_over
from gantryctl.drives.virtual.personality import Personality
from gantryctl.units import rad

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
_EVENT_TIMER: Final = 5

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


def _group(kind: ObjectKind, name: str, *entries: Entry, count: Access = CONST) -> ObjectSpec:
    """Record or array with its sub-index 0."""
    index, highest = entries[0].index, max(entry.sub for entry in entries)
    zero = Entry(index, 0, "Highest sub-index supported", U8, count, highest)
    return ObjectSpec(index, name, kind, {0: zero, **{entry.sub: entry for entry in entries}})


array, record = partial(_group, ObjectKind.ARRAY), partial(_group, ObjectKind.RECORD)


def communication_objects(kind: Personality, serial_number: int) -> tuple[ObjectSpec, ...]:
    """Objects 1000h to 1FFFh without the PDO parameters."""
    identity = {"Vendor-ID": VENDOR_ID, "Product code": PRODUCT_CODE, "Revision number": REVISION}
    identity["Serial number"] = serial_number
    plate = [Entry(0x1018, n, name, U32, RO, value) for n, (name, value) in enumerate(identity.items(), 1)]
    errors = [Entry(0x1003, n, f"Standard error field {n}", U32, RO, 0) for n in range(1, ERRORS + 1)]
    watched = [Entry(0x1016, n, f"Consumer heartbeat time {n}", U32, RW, 0) for n in range(1, CONSUMERS + 1)]
    groups = ("all parameters", "communication parameters", "application parameters")
    save = [Entry(0x1010, n, f"Save {what}", U32, RW, 1) for n, what in enumerate(groups, 1)]
    load = [Entry(0x1011, n, f"Restore {what}", U32, RW, 1) for n, what in enumerate(groups, 1)]
    return (
        var(0x1000, "Device type", U32, RO, kind.device_type),
        var(0x1001, "Error register", U8, RO, maps=True, volatile=True),
        array("Pre-defined error field", *errors, count=RW),
        var(0x1005, "COB-ID SYNC message", U32, RW, 0x80 if kind.sync_cob_id is None else kind.sync_cob_id),
        var(0x1006, "Communication cycle period", U32, RW),
        var(0x1007, "Synchronous window length", U32, RW),
        var(0x1008, "Manufacturer device name", TEXT, CONST, "gantryctl virtual drive"),
        var(0x1009, "Manufacturer hardware version", TEXT, CONST, "simulated"),
        var(0x100A, "Manufacturer software version", TEXT, CONST, "1.0"),
        array("Store parameters", *save),
        array("Restore default parameters", *load),
        var(0x1014, "COB-ID EMCY", U32, RW, 0x80, node=True),
        var(0x1015, "Inhibit time EMCY", U16, RW),
        array("Consumer heartbeat time", *watched),
        var(0x1017, "Producer heartbeat time", U16, RW),
        record("Identity object", *plate),
        array("Error behaviour", Entry(0x1029, 1, "Communication error", U8, RW, 0, low=0, high=2)),
        record(
            "SDO server parameter",
            Entry(0x1200, 1, "COB-ID client to server", U32, RO, 0x600, node_relative=True),
            Entry(0x1200, 2, "COB-ID server to client", U32, RO, 0x580, node_relative=True),
        ),
    )


def pdo_objects(kind: Personality) -> tuple[ObjectSpec, ...]:
    """PDO parameters from 1400h, 1600h, 1800h, 1A00h on; by default the first PDO of each direction is valid."""
    found: list[ObjectSpec] = []
    for number, (receive, transmit) in enumerate(_FACTORY):
        for index, name, cob_id, factory in (
            (0x1400 + number, f"RPDO {number + 1}", 0x200, receive),
            (0x1800 + number, f"TPDO {number + 1}", 0x180 | NO_RTR, transmit),
        ):
            own = cob_id + 0x100 * number | (PDO_INVALID if number else 0)
            found += [
                record(f"{name} communication parameter", *_communication(index, own)),
                _mapping(index + 0x200, f"{name} mapping parameter", factory, kind),
            ]
    return tuple(found)


def _communication(index: int, cob_id: int) -> tuple[Entry, ...]:
    inhibit = Entry(index, 3, "Inhibit time", U16, RW, 0)
    return (
        Entry(index, 1, "COB-ID used by PDO", U32, RW, cob_id, node_relative=True),
        Entry(index, 2, "Transmission type", U8, RW, 255),
        *((inhibit,) if index >= 0x1800 else ()),
        Entry(index, 5, "Event timer", U16, RW, 0),
    )


def _mapping(index: int, name: str, factory: tuple[int, ...], kind: Personality) -> ObjectSpec:
    usable = [entry for entry in factory if entry >> 16 not in (*kind.absent, *kind.not_mappable)]
    padded = [*usable, *[0] * (MAPPED - len(usable))]
    entries = {0: Entry(index, 0, "Number of mapped objects", U8, RW, len(usable))}
    entries |= {n: Entry(index, n, f"Mapped object {n}", U32, RW, value) for n, value in enumerate(padded, 1)}
    return ObjectSpec(index, name, ObjectKind.ARRAY if kind.array_mapping else ObjectKind.RECORD, entries)


RWW = Access.RWW
MODE_PV = 3
MODE_CSV = 9
PRELOAD_MS = 50


def device_tables(hardware: Hardware, kind: Personality) -> tuple[DeviceDescription, DeviceDescription]:
    """Device description for the behaviour, and the one that the bus sees."""
    scaling = Scaling(hardware, kind)
    objects = (
        *communication_objects(kind, hardware.serial_number),
        *pdo_objects(kind),
        *(spec for spec in _control_objects() if spec.index != 0x60E4 or hardware.load_encoder is not None),
        *_motion_objects(hardware, kind, scaling),
        *_plate_objects(hardware, kind, scaling),
        *_vendor_objects(hardware),
    )
    given = {(index, sub): value for index, sub, value in kind.defaults}
    full, seen = lay_over(tuple(_with_defaults(spec, given) for spec in objects), kind)
    visible = tuple(_as_seen(spec, kind) for spec in seen if spec.index not in kind.absent)
    info = DeviceInfo(
        vendor_name="gantryctl",
        vendor_number=VENDOR_ID,
        product_name=f"virtual drive ({kind.name})",
        product_number=PRODUCT_CODE,
        revision_number=REVISION,
        bit_rates=(125_000, 250_000, 500_000, 1_000_000),
        rpdos=PDOS,
        tpdos=PDOS,
        file_name="drive.eds",
        description=kind.summary,
        created_by="gantryctl drive sim --write-eds",
    )
    return described(full, info), described(visible, _plate_of(visible, info, kind))


def _plate_of(visible: tuple[ObjectSpec, ...], info: DeviceInfo, kind: Personality) -> DeviceInfo:
    """Name plate of the model: what its object 1018 says."""
    plate = next((spec.entries for spec in visible if spec.index == 0x1018), None)
    if kind.table is None or plate is None:
        return info
    vendor, product, revision = (
        entry.default if entry is not None and isinstance(entry.default, int) else None
        for entry in map(plate.get, (1, 2, 3))
    )
    return replace(
        info,
        vendor_name="",
        vendor_number=vendor,
        product_name=kind.name,
        product_number=product,
        revision_number=revision,
    )


def _with_defaults(spec: ObjectSpec, given: dict[tuple[int, int], int]) -> ObjectSpec:
    entries = {
        sub: replace(entry, default=given.get((spec.index, sub), entry.default))
        for sub, entry in spec.entries.items()
    }
    return replace(spec, entries=entries)


def _as_seen(spec: ObjectSpec, kind: Personality) -> ObjectSpec:
    entries = spec.entries
    if spec.index in kind.not_mappable:
        entries = {sub: replace(entry, mappable=False) for sub, entry in entries.items()}
    if spec.index in range(0x1400, 0x1400 + PDOS) and kind.no_deadline:
        entries = {sub: entry for sub, entry in entries.items() if sub != _EVENT_TIMER}
    if spec.index == 0x6502 and kind.no_mode_default:
        entries = {0: replace(entries[0], default=None)}
    return replace(spec, entries=entries)


def _control_objects() -> tuple[ObjectSpec, ...]:
    return (
        var(0x6007, "Abort connection option code", I16, RW, 1, limits=(0, 3)),
        var(0x603F, "Error code", U16, RO, maps=True, volatile=True),
        var(0x6040, "Controlword", U16, RWW, maps=True, volatile=True),
        var(0x6041, "Statusword", U16, RO, maps=True, volatile=True),
        var(0x605A, "Quick stop option code", I16, RW, 2, limits=(0, 8)),
        var(0x605B, "Shutdown option code", I16, RW, 0, limits=(0, 1)),
        var(0x605C, "Disable operation option code", I16, RW, 1, limits=(0, 1)),
        var(0x605D, "Halt option code", I16, RW, 1, limits=(1, 4)),
        var(0x605E, "Fault reaction option code", I16, RW, 2, limits=(0, 4)),
        var(0x6060, "Modes of operation", I8, RWW, maps=True, volatile=True),
        var(0x6061, "Modes of operation display", I8, RO, maps=True, volatile=True),
        var(0x60FD, "Digital inputs", U32, RO, maps=True, volatile=True),
        array(
            "Additional position actual value",
            Entry(0x60E4, 1, "Encoder on the ring", I32, RO, 0, mappable=True, volatile=True),
        ),
        array(
            "Digital outputs",
            Entry(0x60FE, 1, "Physical outputs", U32, RWW, 0, mappable=True, volatile=True),
            Entry(0x60FE, 2, "Output bit mask", U32, RW, 0),
        ),
    )


def _motion_objects(hardware: Hardware, kind: Personality, scaling: Scaling) -> tuple[ObjectSpec, ...]:
    quick = hardware.quick_dec_rad_s2 if kind.quick_dec_deg_s2 is None else rad(kind.quick_dec_deg_s2)
    normal = scaling.ramp(hardware.normal_acc_rad_s2)
    limit = scaling.torque(hardware.torque_max_nm)
    ceiling = hardware.speed_max_rad_s
    small = scaling.unsigned(0.01 * ceiling)
    return (
        var(0x6064, "Position actual value", I32, RO, maps=True, volatile=True),
        var(0x606B, "Velocity demand value", I32, RO, maps=True, volatile=True),
        var(0x606C, "Velocity actual value", I32, RO, maps=True, volatile=True),
        var(0x606D, "Velocity window", U16, RW, min(small, 0xFFFF)),
        var(0x606E, "Velocity window time", U16, RW, 100),
        var(0x606F, "Velocity threshold", U16, RW, min(small, 0xFFFF)),
        var(0x6072, "Max torque", U16, RWW, limit, maps=True, limits=(0, limit)),
        var(0x6077, "Torque actual value", I16, RO, maps=True, volatile=True),
        var(0x6078, "Current actual value", I16, RO, maps=True, volatile=True),
        var(0x6079, "DC link circuit voltage", U32, RO, maps=True, volatile=True),
        var(0x607F, "Max profile velocity", U32, RW, scaling.unsigned(ceiling), limits=(1, None)),
        var(0x6080, "Max motor speed", U32, RW, r_min(ceiling), limits=(1, r_min(ceiling))),
        var(0x6083, "Profile acceleration", U32, RW, normal, limits=(1, None)),
        var(0x6084, "Profile deceleration", U32, RW, normal, limits=(1, None)),
        var(0x6085, "Quick stop deceleration", U32, RW, scaling.ramp(quick), limits=(1, None)),
        var(0x60B1, "Velocity offset", I32, RWW, maps=True, volatile=True),
        var(0x60B2, "Torque offset", I16, RWW, maps=True, volatile=True),
        record(
            "Interpolation time period",
            Entry(0x60C2, 1, "Interpolation time period value", U8, RW, 1, low=1),
            Entry(0x60C2, 2, "Interpolation time index", I8, RW, -3, low=-6, high=0),
        ),
        var(0x60FF, "Target velocity", I32, RWW, maps=True, volatile=True),
    )


def _plate_objects(hardware: Hardware, kind: Personality, scaling: Scaling) -> tuple[ObjectSpec, ...]:
    modes = 1 << (MODE_PV - 1) | (1 << (MODE_CSV - 1) if kind.csv else 0)

    def factor(index: int, name: str, first: tuple[str, int], second: tuple[str, int]) -> ObjectSpec:
        pair = (Entry(index, n, what, U32, RO, value) for n, (what, value) in enumerate((first, second), 1))
        return array(name, *pair)

    turns = "Motor revolutions"
    # A unit that no word of 60A9 means has no such object.
    unit = VELOCITY_UNITS[scaling.velocity_unit].si_unit
    return (
        var(0x6075, "Motor rated current", U32, RO, round(hardware.current_rated_a * 1000.0)),
        var(
            0x6076, "Motor rated torque", U32, RO, round(hardware.torque_rated_nm * kind.rated_torque_per_nm)
        ),
        factor(
            0x608F, "Position encoder resolution", ("Encoder increments", kind.counts_per_turn), (turns, 1)
        ),
        factor(0x6091, "Gear ratio", (turns, 1), ("Shaft revolutions", 1)),
        var(0x60A8, "SI unit position", U32, RO, 0x00B5_0000),
        *(() if unit is None else (var(0x60A9, "SI unit velocity", U32, RO, unit),)),
        # 6402, value 10: sinusoidal permanent-magnet brushless motor (CiA 402).
        var(0x6402, "Motor type", U16, RO, 10),
        var(0x6502, "Supported drive modes", U32, RO, modes),
    )


def _vendor_objects(hardware: Hardware) -> tuple[ObjectSpec, ...]:
    owner = 1 if hardware.brake_owner == "object_60FE" else 0
    return (
        record(
            "Brake",
            Entry(0x2100, 1, "Time to open, ms", U16, RW, round(hardware.brake_open_s * 1e3)),
            Entry(0x2100, 2, "Time to close, ms", U16, RW, round(hardware.brake_close_s * 1e3)),
            Entry(0x2100, 3, "Preload before opening, ms", U16, RW, PRELOAD_MS),
            Entry(0x2100, 4, "Owner: 0 drive, 1 object 60FE", U8, RO, owner),
        ),
        record(
            "Load of the motor (I2t)",
            Entry(0x2101, 1, "Used part of the budget, per mille", U16, RO, 0, mappable=True, volatile=True),
            Entry(0x2101, 2, "Warning level, per mille", U16, RW, 800, low=1, high=1000),
        ),
        record(
            "Encoder",
            Entry(0x2110, 1, "Serial number", TEXT, CONST, hardware.encoder_serial),
            Entry(0x2110, 2, "Position within one turn, increments", U32, RO, 0, volatile=True),
            Entry(0x2110, 3, "Turn", U32, RO, 0, volatile=True),
            Entry(0x2110, 4, "Turns told apart", U32, CONST, hardware.turns),
            Entry(
                0x2110,
                5,
                "Status: bits 0 checksum error, 1 alarm, 2 warning, 3 battery",
                U16,
                RO,
                0,
                mappable=True,
                volatile=True,
            ),
        ),
        var(0x2120, "Own time, ms", U32, RO, maps=True, volatile=True),
    )
