"""Units and ranges of the analogue tags, as OPC UA shows them (Part 8, section 5.6.3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from asyncua import ua

from gantryctl.service.protocol.tags import TAGS, Tag

_CEFACT: Final = "http://www.opcfoundation.org/UA/units/un/cefact"


class _Unit(NamedTuple):
    """A unit of UNECE Recommendation 20.

    Attributes:
        code: its common code. largest: magnitude of normal values where the machine's limits say nothing.
        signed: values below zero are normal, too.
    """

    code: str
    symbol: str
    name: str
    largest: float
    signed: bool = False


_UNITS: Final = {
    "deg": _Unit("DD", "°", "degree [unit of angle]", 360.0, signed=True),
    "deg/s": _Unit("E96", "°/s", "degree per second", 10.0, signed=True),
    "deg/s2": _Unit("M45", "°/s²", "degree [unit of angle] per second squared", 10.0, signed=True),
    "N m": _Unit("NU", "N·m", "newton metre", 1e3, signed=True),
    "s": _Unit("SEC", "s", "second [unit of time]", 3600.0),
    "ms": _Unit("C26", "ms", "millisecond", 1000.0),
    "us": _Unit("B98", "µs", "microsecond", 1e5),
    "%": _Unit("P1", "%", "percent", 100.0),
    "": _Unit("C62", "", "one", 1.0),
}
# At the axis, where the other limits of this unit are those of the motor.
_OF_THE_AXIS: Final = {"eccentric_moment_nm": "moment_max_nm", "moment_max_nm": "moment_max_nm"}
_LIMITS: Final = [
    t
    for t in TAGS
    if (t.kind, t.direction, t.rate) == ("float", "out", "on change") and t.name not in _OF_THE_AXIS
]


def information(tag: Tag) -> Any:
    """`EUInformation` of a tag."""
    unit = _UNITS[tag.unit]
    # Part 8, section 5.6.3.4: the characters of the common code as bytes of a number.
    number = int.from_bytes(unit.code.encode("ascii"))
    return ua.EUInformation(_CEFACT, number, ua.LocalizedText(unit.symbol), ua.LocalizedText(unit.name))


def normal_range(tag: Tag, tags: Mapping[str, Any]) -> Any:
    """`EURange` of a tag: to the largest limit of its unit that the machine has.

    Args:
        tags: values of all tags.
    """
    unit = _UNITS[tag.unit]
    own = _OF_THE_AXIS.get(tag.name)
    names = [own] if own else [each.name for each in _LIMITS if each.unit == tag.unit]
    limits = [abs(value) for value in map(tags.get, names) if isinstance(value, int | float)]
    largest = max(limits, default=0.0) or unit.largest
    return ua.Range(-largest if unit.signed else 0.0, largest)
