"""Data types of CiA 301: codes, sizes, ranges, bytes."""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import Final, NamedTuple

Value = int | float | str | bytes


class DataType(IntEnum):
    """Codes of the static data types (CiA 301, objects 0001h to 001Bh)."""

    BOOLEAN = 0x01
    INTEGER8 = 0x02
    INTEGER16 = 0x03
    INTEGER32 = 0x04
    UNSIGNED8 = 0x05
    UNSIGNED16 = 0x06
    UNSIGNED32 = 0x07
    REAL32 = 0x08
    VISIBLE_STRING = 0x09
    OCTET_STRING = 0x0A
    UNICODE_STRING = 0x0B
    TIME_OF_DAY = 0x0C
    TIME_DIFFERENCE = 0x0D
    DOMAIN = 0x0F
    INTEGER24 = 0x10
    REAL64 = 0x11
    INTEGER40 = 0x12
    INTEGER48 = 0x13
    INTEGER56 = 0x14
    INTEGER64 = 0x15
    UNSIGNED24 = 0x16
    UNSIGNED40 = 0x18
    UNSIGNED48 = 0x19
    UNSIGNED56 = 0x1A
    UNSIGNED64 = 0x1B

    @property
    def label(self) -> str:
        """Short name as in manuals: U16, I32, STRING."""
        kind = self.name
        for long, short in (("UNSIGNED", "U"), ("INTEGER", "I"), ("REAL", "REAL"), ("BOOLEAN", "BOOL")):
            if kind.startswith(long):
                return short + kind[len(long) :]
        return kind


class Number(NamedTuple):
    """Layout of an integer type."""

    bits: int
    signed: bool


INTEGERS: Final = {DataType.BOOLEAN: Number(8, False)} | {
    DataType[f"{kind}{bits}"]: Number(bits, kind == "INTEGER")
    for kind in ("INTEGER", "UNSIGNED")
    for bits in range(8, 72, 8)
}
REALS: Final = {DataType.REAL32: "<f", DataType.REAL64: "<d"}
STRINGS: Final = frozenset({DataType.VISIBLE_STRING, DataType.UNICODE_STRING, DataType.OCTET_STRING})


def bit_length(data_type: DataType) -> int | None:
    """Size in bits; None for strings and domains."""
    number = INTEGERS.get(data_type)
    if number is not None:
        return number.bits
    if data_type in REALS:
        return 8 * struct.calcsize(REALS[data_type])
    return 48 if data_type in (DataType.TIME_OF_DAY, DataType.TIME_DIFFERENCE) else None


def limits(data_type: DataType) -> tuple[int, int] | None:
    """Range of an integer type."""
    number = INTEGERS.get(data_type)
    if number is None:
        return None
    if data_type is DataType.BOOLEAN:
        return 0, 1
    half = 1 << (number.bits - 1)
    return (-half, half - 1) if number.signed else (0, 2 * half - 1)


def encode(data_type: DataType, value: Value) -> bytes:
    """Little-endian bytes of a value.

    Raises:
        ValueError: the value does not fit the type.
    """
    number = INTEGERS.get(data_type)
    try:
        if number is not None:
            return int(value).to_bytes(number.bits // 8, "little", signed=number.signed)
        if data_type in REALS:
            return struct.pack(REALS[data_type], float(value))
    except (OverflowError, struct.error):
        raise ValueError(f"{value!r} does not fit {data_type.label}") from None
    if isinstance(value, bytes):
        return value
    if data_type is DataType.UNICODE_STRING:
        return str(value).encode("utf-16-le", errors="replace")
    return str(value).encode("latin-1", errors="replace")


def decode(data_type: DataType, data: bytes) -> Value:
    """Value of little-endian bytes.

    Raises:
        ValueError: wrong number of bytes for the type.
    """
    bits = bit_length(data_type)
    if bits is not None and len(data) * 8 != bits:
        raise ValueError(f"{data_type.label} has {bits // 8} bytes, got {len(data)}")
    number = INTEGERS.get(data_type)
    if number is not None:
        return int.from_bytes(data, "little", signed=number.signed)
    if data_type in REALS:
        unpacked: float = struct.unpack(REALS[data_type], data)[0]
        return unpacked
    if data_type is DataType.VISIBLE_STRING:
        return data.split(b"\0", 1)[0].decode("latin-1")
    if data_type is DataType.UNICODE_STRING:
        return data.decode("utf-16-le", errors="replace")
    return bytes(data)
