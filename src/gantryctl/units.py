"""The only place that converts units: radians and SI inside, degrees at the edge; and the unit at a name's end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final, Literal, NamedTuple, TypeAlias

RAD_PER_DEG: Final = math.pi / 180.0
DEG_PER_RAD: Final = 180.0 / math.pi
RAD_S_PER_R_MIN: Final = 2.0 * math.pi / 60.0
DEG_S_PER_R_MIN: Final = 6.0
# 0.005 deg of a turn, the usual window of an axis in position.
TURN_EDGE: Final = 0.005 / 360.0
# The paper's moments and the plant's (plant equations S1) are made with this rounded value.
GRAVITY_M_S2: Final = 9.81

DriveVelocityUnit: TypeAlias = Literal[
    "inc/s", "0.1 inc/s", "16.16 inc/ms", "r/min", "0.1 r/min", "0.001 r/min", "mrev/s"
]
"""Unit in which a drive on a bus counts speed; `drives.od.velocity_units` has the size of each."""


def behind(unit: str) -> str:
    """What stands behind a number that people read: " N m", and nothing where tables of units have "-" or nothing."""
    return "" if unit in ("", "-") else f" {unit}"


def within_turn(angle: float, low: float, turn: float) -> float:
    """An angle of an axis that turns without end, as people read it: from `low` on within a turn, all in one unit.

    The turn begins a little below `low`, so that an axis that settles at 0 deg does not show 360.
    """
    begin = low - turn * TURN_EDGE
    return begin + (angle - begin) % turn


_TURN_BEGIN: Final = "turn_begin_deg"


class Dial(NamedTuple):
    """How people read angles of an axis; numbers for machines (JSON, tags, recordings) stay as they are.

    Attributes:
        begin_deg: where the turn begins that they are read in; None where they are read as they are.
        stops_deg: mechanical stops of an axis that can stand at two places which read alike, as +-180 deg both read
            180; None where it cannot.
    """

    begin_deg: float | None = None
    stops_deg: tuple[float, float] | None = None

    def read_deg(self, angle_deg: float) -> float:
        """An angle of the axis as people read it; never a difference of angles."""
        return angle_deg if self.begin_deg is None else within_turn(angle_deg, self.begin_deg, 360.0)

    def end_of(self, angle_deg: float) -> Literal["", "-", "+"]:
        """The end of travel at which an angle lies whose reading another place of the axis shares; "" elsewhere."""
        if self.begin_deg is None or self.stops_deg is None:
            return ""
        low, high = self.stops_deg
        return "-" if angle_deg + 360.0 <= high else "+" if angle_deg - 360.0 >= low else ""

    def text(self, angle_deg: float, spec: str = "g") -> str:
        """The number that people read, without its unit: "340", or "180 (- end)" where two places read alike."""
        end, number = self.end_of(angle_deg), f"{self.read_deg(angle_deg):{spec}}"
        # Never "-0.00".
        number = number if float(number) else f"{0.0:{spec}}"
        return f"{number} ({end} end)" if end else number

    def span(self, low_deg: float, high_deg: float, spec: str = "g") -> str:
        """Two ends of a range, from the lower to the higher angle of the axis: "210 to 150"."""
        return f"{self.text(low_deg, spec)} to {self.text(high_deg, spec)}"

    def metadata(self) -> dict[str, float]:
        """What a recording says about it; nothing where angles are read as they are."""
        return {} if self.begin_deg is None else {_TURN_BEGIN: self.begin_deg}

    @classmethod
    def of_recording(cls, metadata: Mapping[str, Any]) -> Dial:
        """The dial that a recording tells."""
        return cls(metadata.get(_TURN_BEGIN))


SIGNED: Final = Dial()


def name_ending(name: str, suffixes: Iterable[str]) -> str:
    """The longest of `suffixes` that ends a name `<quantity>_<role>_<unit>`; "" when none does."""
    return max((end for end in suffixes if name.endswith(f"_{end}")), key=len, default="")


def rad(angle_deg: float) -> float:
    """Degrees to radians (also deg/s, deg/s2, deg/s3)."""
    return angle_deg * RAD_PER_DEG


def deg(angle_rad: float) -> float:
    """Radians to degrees (also rad/s, rad/s2, rad/s3)."""
    return angle_rad * DEG_PER_RAD


def rad_s_from_r_min(speed_r_min: float) -> float:
    """Revolutions per minute to rad/s."""
    return speed_r_min * RAD_S_PER_R_MIN


def r_min_from_rad_s(speed_rad_s: float) -> float:
    """Rad/s to revolutions per minute."""
    return speed_rad_s / RAD_S_PER_R_MIN
