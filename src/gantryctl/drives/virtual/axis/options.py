"""Option codes (605A to 605E, 6007): what a drive does when it leaves operation. Pure functions of the code."""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import Final, NamedTuple


class Ramp(Enum):
    """How the shaft is brought to rest."""

    NONE = 0
    """Torque off at once, the brake closes."""
    SLOW = 1
    """Slow-down ramp, 6084."""
    QUICK = 2
    """Quick-stop ramp, 6085."""
    LIMIT = 3
    """As hard as the torque limit allows (current limit, voltage limit)."""


class StopPlan(NamedTuple):
    """A ramp, and whether the drive stays energised afterwards."""

    ramp: Ramp
    stay: bool = False


class AbortConnection(IntEnum):
    """6007: what happens to the axis when communication is lost."""

    NOTHING = 0
    FAULT = 1
    DISABLE_VOLTAGE = 2
    QUICK_STOP = 3


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
    """605A."""
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
