"""Values of objects in words: names by CiA 301 and CiA 402, units as the bus or the machine file has told them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from gantryctl.drives.canopen.cia402 import (
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    FAULT_RESET,
    FOLLOWS_COMMAND,
    INTERNAL_LIMIT,
    QUICK_STOP,
    REMOTE,
    SHUTDOWN,
    SWITCH_ON,
    WARNING,
    decode_statusword,
)
from gantryctl.drives.canopen.emergency import emergency_text
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.drives.od.standard import standard_of
from gantryctl.drives.od.types import INTEGERS, Value, decode
from gantryctl.drives.od.velocity_units import VELOCITY_UNITS, unit_of_word
from gantryctl.units import r_min_from_rad_s

Objects = Mapping[tuple[int, int], int]
"""Values of a node's objects by index and sub-index, as far as they are known."""

_COMMANDS: Final = {
    DISABLE_VOLTAGE: "disable voltage",
    QUICK_STOP: "quick stop",
    SHUTDOWN: "shutdown",
    SWITCH_ON: "switch on",
    ENABLE_OPERATION: "enable operation",
    FAULT_RESET: "fault reset",
}
_COMMAND_BITS: Final = 0x8F
_STATUS_BITS: Final = (
    (WARNING, "warning"), (REMOTE, "remote"), (INTERNAL_LIMIT, "internal limit"), (FOLLOWS_COMMAND, "follows command"),
)  # fmt: skip
_POSITIONS: Final = (0x6064, 0x607A)
_RING: Final = 0x60E4
_VELOCITIES: Final = (0x606C, 0x60FF, 0x60B1)
_TORQUES: Final = (0x6071, 0x6072, 0x6074, 0x6077, 0x60B2)
_WORDS: Final = (0x60FD, 0x60FE)
_COMMUNICATION: Final = range(0x1000, 0x2000)
_MAPPINGS: Final = (*range(0x1600, 0x1800), *range(0x1A00, 0x1C00))


class ObjectValue(NamedTuple):
    """Object with its value.

    Attributes:
        text: the value with its unit or meaning.
    """

    obj: int
    sub: int
    name: str
    value: Value
    text: str

    @property
    def place(self) -> str:
        """Index and sub-index in the usual notation."""
        return f"{self.obj:04X}:{self.sub:02X}"

    def __str__(self) -> str:
        return f"{self.place} {self.name} = {self.text}".replace("  ", " ")


def object_value(
    index: int, sub: int, data: bytes, known: Objects, settings: CanopenSettings | None
) -> ObjectValue:
    """Object of a telegram or an SDO transfer.

    Args:
        data: as on the bus, little-endian.
        known: what the node has told of its units.
        settings: of the machine file, for units that it has not told.
    """
    standard = standard_of(index, sub)
    value: Value = int.from_bytes(data, "little")
    if standard is not None:
        try:
            value = decode(standard.data_type, data)
        except ValueError:  # another length than the standard has; of its types only whole numbers have one
            value = int.from_bytes(data, "little", signed=INTEGERS[standard.data_type].signed)
    if not isinstance(value, int):
        text = repr(value)
    elif index in _MAPPINGS and sub:
        text = f"{value:08X}h {_name(value >> 16, value >> 8 & 0xFF)}"
    else:
        text = _number(index, value, known, settings)
    return ObjectValue(index, sub, "" if standard is None else standard.name, value, text)


def _name(index: int, sub: int) -> str:
    standard = standard_of(index, sub)
    return f"{index:04X}:{sub:02X}" if standard is None else standard.name


def _number(index: int, value: int, known: Objects, settings: CanopenSettings | None) -> str:
    """Number with its unit or meaning."""
    if index == 0x6040:
        return f"{value:04X}h {_COMMANDS.get(value & _COMMAND_BITS, 'a combination of bits')}"
    if index == 0x6041:
        state = decode_statusword(value).name.lower().replace("_", " ")
        bits = [name for bit, name in _STATUS_BITS if value & bit]
        return ", ".join((f"{value:04X}h {state}", *bits))
    if index == 0x603F:
        return emergency_text(value)
    if index in _WORDS:
        bits = [name for name, bit in _inputs(settings) if index == 0x60FD and value >> bit & 1]
        return " ".join((f"{value:08X}h", *bits))
    if index in _COMMUNICATION:
        return f"{value:X}h ({value})"
    scaled = _scaled(index, value, known, settings)
    return str(value) if scaled is None else f"{value} ({scaled})"


def _inputs(settings: CanopenSettings | None) -> list[tuple[str, int]]:
    if settings is None:
        return []
    return [(name, bit) for name, bit in settings.inputs._asdict().items() if isinstance(bit, int)]


def _scaled(index: int, value: int, known: Objects, settings: CanopenSettings | None) -> str | None:
    """Quantity at the motor shaft, as the drive counts it; None where its unit is not known."""
    increments = _increments(known, settings)
    if index in _POSITIONS and increments:
        return f"{value / increments:.5f} turns"
    ring = None if settings is None else settings.load_encoder
    if index == _RING and ring is not None and ring.node is None:
        return f"{value / ring.counts_per_turn:.7f} turns of the axis"
    if index in _VELOCITIES:
        unit = unit_of_word(known[0x60A9, 0]) if (0x60A9, 0) in known else None
        unit = unit or (None if settings is None else settings.told_speed_unit)
        if unit is not None and (increments or VELOCITY_UNITS[unit].per_turn_s):
            rad_s = value / VELOCITY_UNITS[unit].per_rad_s(increments)
            return f"{r_min_from_rad_s(rad_s):.3f} r/min"
    if index in _TORQUES:
        rated_nm = known.get((0x6076, 0), 0) / (1000.0 if settings is None else settings.rated_torque_per_nm)
        if settings is not None:
            rated_nm = (rated_nm or settings.torque_rated_nm) * settings.torque_reference
        if math.isfinite(rated_nm) and rated_nm > 0.0:
            return f"{value * rated_nm / 1000.0:.2f} N m"
        return f"{value / 10.0:.1f} % of the rated torque"
    return None


def _increments(known: Objects, settings: CanopenSettings | None) -> int:
    """Increments of 6064 in one motor turn; 0 where they are not known."""
    if settings is not None:
        return settings.increments_per_turn
    turns = known.get((0x608F, 2), 1)
    return known.get((0x608F, 1), 0) // turns if turns else 0
