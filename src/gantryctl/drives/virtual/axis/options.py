"""Option codes 605A to 605E and 6007 (CiA 402): reactions of the drive, as pure functions of the code."""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import Final, NamedTuple


class Ramp(Enum):
    """Ramp that brings the shaft to rest."""

    NONE = 0
    """Torque off at once, the brake closes."""
    SLOW = 1
    """Slow-down ramp, 6084."""
    QUICK = 2
    """Quick-stop ramp, 6085."""
    LIMIT = 3
    """As hard as the torque limit allows (current limit, voltage limit)."""


class StopPlan(NamedTuple):
    """Ramp, and whether the drive stays energised afterwards."""

    ramp: Ramp
    stay: bool = False


class AbortConnection(IntEnum):
    """6007: reaction of the axis to lost communication."""

    NOTHING = 0
    FAULT = 1
    DISABLE_VOLTAGE = 2
    QUICK_STOP = 3


# By option code; 3 and 4 are current limit and voltage limit.
_RAMPS: Final = (Ramp.NONE, Ramp.SLOW, Ramp.QUICK, Ramp.LIMIT, Ramp.LIMIT)


def quick_stop_plan(code: int) -> StopPlan:
    """Reaction of 605A: 0 to 4 end in Switch on disabled, 5 to 8 are 1 to 4 and stay in Quick stop active."""
    return StopPlan(_RAMPS[code - 4 if code > 4 else code], stay=code > 4)


def leave_ramp(code: int) -> Ramp:
    """Ramp of 605B shutdown and 605C disable operation: 0 torque off, 1 slow-down ramp."""
    return Ramp.SLOW if code == 1 else Ramp.NONE


def stop_ramp(code: int) -> Ramp:
    """Ramp of 605E fault reaction and 605D halt, where the drive stays enabled."""
    return _RAMPS[code]
