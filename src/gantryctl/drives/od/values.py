"""Numbers and values in the notation of EDS and DCF files (CiA 306)."""

from __future__ import annotations

import math
import struct
from typing import Final, NamedTuple

from gantryctl.drives.od.types import INTEGERS, REALS, STRINGS, DataType, Value

_NODE: Final = "$NODEID"
_MAX_TEXT: Final = 200


class Number(NamedTuple):
    """Number, and whether the node id is to be added."""

    value: int
    relative: bool = False


def parse_number(text: str) -> Number | None:
    """Sum of numbers and at most one $NODEID, in any order and spelling; None for any other text."""
    compact = "".join(text.split()).upper()
    if not compact or len(compact) > _MAX_TEXT:
        return None
    total, nodes = 0, 0
    for term in compact.split("+"):
        if term == _NODE:
            nodes += 1
            continue
        value = _integer(term)
        if value is None:
            return None
        total += value
    return Number(total, nodes == 1) if nodes <= 1 else None


def _integer(term: str) -> int | None:
    sign, digits = (-1, term[1:]) if term.startswith("-") else (1, term)
    if not digits.isascii():
        return None
    try:
        if digits.startswith("0X"):
            return sign * int(digits[2:], 16) if _plain(digits[2:]) else None
        if digits.endswith("H") and digits[:1].isdigit():
            return sign * int(digits[:-1], 16) if _plain(digits[:-1]) else None
        if not digits.isdigit():
            return None
        # A leading 0 is octal (CiA 306), unless a digit 8 or 9 shows that it was not meant so.
        octal = len(digits) > 1 and digits[0] == "0" and not set("89") & set(digits)
        return sign * int(digits, 8 if octal else 10)
    except ValueError:
        return None


def _plain(digits: str) -> bool:
    # int() would take underscores and signs as well.
    return digits.isalnum()


def parse_value(text: str, data_type: DataType) -> tuple[Value, bool] | None:
    """Value of a type, and whether it is an offset to the node id; None for a text that is not of the type."""
    if data_type in STRINGS:
        return (_octets(text) if data_type is DataType.OCTET_STRING else text), False
    if data_type in REALS:
        real = _real(text, data_type)
        return None if real is None else (real, False)
    number = INTEGERS.get(data_type)
    if number is None:
        return None
    found = parse_number({"true": "1", "false": "0"}.get(text.lower(), text))
    if found is None:
        return None
    low = -(1 << (number.bits - 1)) if number.signed else 0
    value = found.value
    if number.signed and (1 << (number.bits - 1)) <= value < (1 << number.bits):
        # 0xFFFFFFFF of an I32 is -1: many files write signed values in hexadecimal.
        value -= 1 << number.bits
    if not low <= value < (1 << number.bits):
        return None
    return value, found.relative


def _real(text: str, data_type: DataType) -> float | None:
    try:
        if text.lower().startswith("0x"):
            layout = REALS[data_type]
            bits = int(text, 16).to_bytes(struct.calcsize(layout), "little")
            value: float = struct.unpack(layout, bits)[0]
        else:
            value = float(text.replace(",", "."))
    except (ValueError, OverflowError):
        return None
    return value if math.isfinite(value) else None


def _octets(text: str) -> bytes:
    try:
        return bytes.fromhex(text.removeprefix("0x"))
    except ValueError:
        return text.encode("latin-1", errors="replace")
