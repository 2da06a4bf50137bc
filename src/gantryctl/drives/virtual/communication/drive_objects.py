"""Object table, drive profile (CiA 402) and manufacturer objects (2000h on): data for behaviour and EDS."""

from __future__ import annotations

from dataclasses import replace

from gantryctl.drives.od.model import (
    Access,
    DeviceDescription,
    DeviceInfo,
    Entry,
    ObjectKind,
    ObjectSpec,
    described,
)
from gantryctl.drives.virtual.axis.hardware import Hardware
from gantryctl.drives.virtual.axis.scaling import SI_UNIT, Scaling, r_min
from gantryctl.drives.virtual.communication.objects import (
    CONST,
    I8,
    I16,
    I32,
    PDOS,
    PRODUCT_CODE,
    REVISION,
    RO,
    RW,
    TEXT,
    U8,
    U16,
    U32,
    VENDOR_ID,
    communication_objects,
    group,
    pdo_objects,
    var,
)
from gantryctl.drives.virtual.personality import Personality
from gantryctl.units import rad

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
        *_control_objects(),
        *_motion_objects(hardware, kind, scaling),
        *_plate_objects(hardware, kind, scaling),
        *_vendor_objects(hardware),
    )
    given = {(index, sub): value for index, sub, value in kind.defaults}
    full = tuple(_with_defaults(spec, given) for spec in objects)
    visible = tuple(_as_seen(spec, kind) for spec in full if spec.index not in kind.absent)
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
    return described(full, info), described(visible, info)


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
        group(
            0x60FE,
            "Digital outputs",
            ObjectKind.ARRAY,
            Entry(0x60FE, 1, "Physical outputs", U32, RWW, 0, mappable=True, volatile=True),
            Entry(0x60FE, 2, "Output bit mask", U32, RW, 0),
        ),
    )


def _motion_objects(hardware: Hardware, kind: Personality, scaling: Scaling) -> tuple[ObjectSpec, ...]:
    quick = hardware.quick_dec_rad_s2 if kind.quick_dec_deg_s2 is None else rad(kind.quick_dec_deg_s2)
    normal = scaling.unsigned(hardware.normal_acc_rad_s2)
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
        var(0x6085, "Quick stop deceleration", U32, RW, scaling.unsigned(quick), limits=(1, None)),
        var(0x60B1, "Velocity offset", I32, RWW, maps=True, volatile=True),
        var(0x60B2, "Torque offset", I16, RWW, maps=True, volatile=True),
        group(
            0x60C2,
            "Interpolation time period",
            ObjectKind.RECORD,
            Entry(0x60C2, 1, "Interpolation time period value", U8, RW, 1, low=1),
            Entry(0x60C2, 2, "Interpolation time index", I8, RW, -3, low=-6, high=0),
        ),
        var(0x60FF, "Target velocity", I32, RWW, maps=True, volatile=True),
    )


def _plate_objects(hardware: Hardware, kind: Personality, scaling: Scaling) -> tuple[ObjectSpec, ...]:
    modes = 1 << (MODE_PV - 1) | (1 << (MODE_CSV - 1) if kind.csv else 0)

    def factor(index: int, name: str, first: tuple[str, int], second: tuple[str, int]) -> ObjectSpec:
        pair = (Entry(index, n, what, U32, RO, value) for n, (what, value) in enumerate((first, second), 1))
        return group(index, name, ObjectKind.ARRAY, *pair)

    turns = "Motor revolutions"
    return (
        var(0x6075, "Motor rated current", U32, RO, round(hardware.current_rated_a * 1000.0)),
        var(0x6076, "Motor rated torque", U32, RO, round(hardware.torque_rated_nm * 1000.0)),
        factor(
            0x608F, "Position encoder resolution", ("Encoder increments", kind.counts_per_turn), (turns, 1)
        ),
        factor(0x6091, "Gear ratio", (turns, 1), ("Shaft revolutions", 1)),
        var(0x60A8, "SI unit position", U32, RO, 0x00B5_0000),
        var(0x60A9, "SI unit velocity", U32, RO, SI_UNIT[scaling.velocity_unit]),
        # 6402, value 10: sinusoidal permanent-magnet brushless motor (CiA 402).
        var(0x6402, "Motor type", U16, RO, 10),
        var(0x6502, "Supported drive modes", U32, RO, modes),
    )


def _vendor_objects(hardware: Hardware) -> tuple[ObjectSpec, ...]:
    record = ObjectKind.RECORD
    owner = 1 if hardware.brake_owner == "object_60FE" else 0
    return (
        group(
            0x2100,
            "Brake",
            record,
            Entry(0x2100, 1, "Time to open, ms", U16, RW, round(hardware.brake_open_s * 1e3)),
            Entry(0x2100, 2, "Time to close, ms", U16, RW, round(hardware.brake_close_s * 1e3)),
            Entry(0x2100, 3, "Preload before opening, ms", U16, RW, PRELOAD_MS),
            Entry(0x2100, 4, "Owner: 0 drive, 1 object 60FE", U8, RO, owner),
        ),
        group(
            0x2101,
            "Load of the motor (I2t)",
            record,
            Entry(0x2101, 1, "Used part of the budget, per mille", U16, RO, 0, mappable=True, volatile=True),
            Entry(0x2101, 2, "Warning level, per mille", U16, RW, 800, low=1, high=1000),
        ),
        group(
            0x2110,
            "Encoder",
            record,
            Entry(0x2110, 1, "Serial number", TEXT, CONST, hardware.encoder_serial),
            Entry(0x2110, 2, "Position within one turn, increments", U32, RO, 0, volatile=True),
            Entry(0x2110, 3, "Turn", U32, RO, 0, volatile=True),
            Entry(0x2110, 4, "Turns told apart", U32, CONST, hardware.turns),
        ),
        var(0x2120, "Own time, ms", U32, RO, maps=True, volatile=True),
    )
