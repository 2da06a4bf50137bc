"""Column names of a trace: `<quantity>_<role>_<unit>`, the unit last, radians and SI.

`pos_ref_rad`, `vel_cmd_rad_s`, `torque_act_nm`. A name without a known unit at its end is a plain number: a
state, a flag, a ratio. The first column is always `time_s`. Degrees exist in exported files only.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final, NamedTuple

from gantryctl.errors import UsageError
from gantryctl.units import deg, name_ending

TIME_COLUMN: Final = "time_s"
# Time for which a row stands, in recordings that have fewer rows while the axis rests: the scan period, or the time
# since the row before where the rows between were left out.
SPACING_COLUMN: Final = "spacing_s"

# By the end of a name: how people write the unit.
SI_UNITS: Final = {
    "rad_s3": "rad/s³",
    "rad_s2": "rad/s²",
    "rad_s": "rad/s",
    "rad": "rad",
    "nm_s_per_rad": "N m s/rad",
    "nm_per_rad": "N m/rad",
    "nm": "N m",
    "n": "N",
    "per_s": "1/s",
    "m_s2": "m/s²",
    "m_s": "m/s",
    "m": "m",
    "s": "s",
    "a": "A",
    "v": "V",
    "w": "W",
    "j": "J",
    "counts": "counts",
}
DEGREE_UNITS: Final = {"deg_s3": "deg/s³", "deg_s2": "deg/s²", "deg_s": "deg/s", "deg": "deg"}
# What a person might write instead, and what the trace wants: checked when a recording begins, not when it is read,
# because exported files may be in degrees (decision 0006).
FOREIGN_UNITS: Final = {
    **{suffix: suffix.replace("deg", "rad") for suffix in DEGREE_UNITS},
    "mdeg": "rad",
    "mrad": "rad",
    "rpm": "rad_s",
    "r_min": "rad_s",
    "knm": "nm",
    "mm_s": "m_s",
    "mm": "m",
    "um": "m",
    "ms": "s",
    "us": "s",
    "kw": "w",
}
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


class Unit(NamedTuple):
    """Unit as the end of a column name and as people write it."""

    suffix: str
    symbol: str


def unit_of(name: str) -> Unit:
    """Unit of a column, from the end of its name; degrees too, as exported files have them."""
    symbols = SI_UNITS | DEGREE_UNITS
    suffix = name_ending(name, symbols)
    return Unit(suffix, symbols[suffix] if suffix else "")


def in_degrees(name: str) -> str:
    """Name of the same quantity in degrees; unchanged where the unit is not an angle's."""
    suffix = unit_of(name).suffix
    if suffix.startswith("rad"):
        return name.removesuffix(suffix) + suffix.replace("rad", "deg")
    return name


def degree_factor(name: str) -> float:
    """Factor from the values of a column to degrees; 1 where the unit is not an angle's."""
    return deg(1.0) if in_degrees(name) != name else 1.0


def validate_columns(columns: Sequence[str]) -> tuple[str, ...]:
    """Check the columns of a new recording.

    Raises:
        UsageError: a wrong, repeated or missing name, all of them named.
    """
    problems = []
    if not columns or columns[0] != TIME_COLUMN:
        problems.append(f"the first column must be {TIME_COLUMN}, not {columns[0] if columns else 'nothing'}")
    for index, name in enumerate(columns):
        foreign = name_ending(name, FOREIGN_UNITS)
        if not _NAME.fullmatch(name):
            problems.append(f"{name!r}: only small letters, digits and single underscores, a letter first")
        elif foreign and len(foreign) >= len(unit_of(name).suffix):
            wanted = name.removesuffix(foreign) + FOREIGN_UNITS[foreign]
            problems.append(f"{name}: a trace holds radians and SI; did you mean {wanted}?")
        if name in columns[:index]:
            problems.append(f"{name}: there twice")
    if problems:
        raise UsageError("columns of a trace:\n" + "\n".join("  " + line for line in problems))
    return tuple(columns)
