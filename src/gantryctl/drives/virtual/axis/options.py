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


# 605A: 1 to 4 end in Switch on disabled, 5 to 8 stay in Quick stop active; 3 and 4 are current and voltage limit.
_QUICK_STOP: Final = {
    0: StopPlan(Ramp.NONE),
    1: StopPlan(Ramp.SLOW),
    2: StopPlan(Ramp.QUICK),
    3: StopPlan(Ramp.LIMIT),
    4: StopPlan(Ramp.LIMIT),
    5: StopPlan(Ramp.SLOW, stay=True),
    6: StopPlan(Ramp.QUICK, stay=True),
    7: StopPlan(Ramp.LIMIT, stay=True),
    8: StopPlan(Ramp.LIMIT, stay=True),
}


def quick_stop_plan(code: int) -> StopPlan:
    """Reaction of 605A."""
    return _QUICK_STOP[code]


def leave_plan(code: int) -> StopPlan:
    """605B shutdown and 605C disable operation: 0 torque off, 1 slow-down ramp."""
    return StopPlan(Ramp.SLOW if code == 1 else Ramp.NONE)


def fault_plan(code: int) -> StopPlan:
    """605E: 0 torque off, 1 slow-down ramp, 2 quick-stop ramp, 3 and 4 at the limits."""
    return StopPlan(_QUICK_STOP[code].ramp)


def halt_ramp(code: int) -> Ramp:
    """605D: 1 slow-down ramp, 2 quick-stop ramp, 3 and 4 at the limits; the drive stays enabled."""
    return _QUICK_STOP[code].ramp
