"""Room of a step with the position loop open: no limit of the travel acts there, so the step must end before one."""

from __future__ import annotations

from typing import Final

from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import silent_way_deg
from gantryctl.operation.home_reference import AbsoluteReading, why_not_referenced

# A step that means to stand: its leash is what a brake or a torque may turn the shaft by.
_STANDS_DEG: Final = 0.1
_SAGS_DEG: Final = 0.05
# A sector of a modulo axis is there in every turn; its ends lie within two turns of the angle that is shown.
_TURNS: Final = (-720.0, -360.0, 0.0, 360.0, 720.0)


def sag_deg(machine: Machine) -> float:
    """What an axis that stands may sag by when its torque goes off and the brake closes.

    The load of the check moment sinks until the brake holds, which gives way by what its test permits: 0.034 deg on the
    reference gantry, 0.2 deg on a table whose brake has some play.
    """
    return max(_SAGS_DEG, silent_way_deg(machine, 0.0, 0.0, brake=True) + machine.brake.sag_max_deg)


def stand_deg(machine: Machine) -> float:
    """Leash of a step that means to stand."""
    return max(_STANDS_DEG, sag_deg(machine))


def why_no_room(
    machine: Machine, reading: AbsoluteReading, leash_deg: float, doubted_by: str = "", way: float = 0.0
) -> str:
    """Why a step may not go as far as its leash, in words; "" where it may.

    Args:
        doubted_by: the alarm since which the angle is in doubt, "" for none.
        way: its sign is the direction in which the step turns the axis; 0: either.
    """
    stands_deg = stand_deg(machine)
    # On the leash of a step that means to stand, or on a hair. A brake with more play permits no turn more.
    if leash_deg <= _STANDS_DEG or leash_deg == stands_deg:
        return ""
    unknown = why_not_referenced(reading)
    if unknown is not None:
        return f"nobody knows how far the axis may turn: {unknown.text}"
    if doubted_by:
        return (
            "nobody knows how far the axis may turn: its angle is in doubt; service compares it, then reset"
        )
    at_deg = reading.angle_deg
    assert at_deg is not None  # it is referenced
    back_deg, ahead_deg = (leash_deg if way * side >= 0.0 else stands_deg for side in (-1.0, 1.0))
    met = _met(machine, at_deg - back_deg, at_deg + ahead_deg)
    if not met:
        return ""
    at = machine.axis.dial.text(at_deg, ".1f")
    return f"the axis stands at {at} deg and may turn by {leash_deg:.1f} deg, to {met}: turn it away from there first"


def _met(machine: Machine, low_deg: float, high_deg: float) -> str:
    """What lies between two angles that no axis may come to; "" for nothing."""
    axis = machine.axis
    dial = axis.dial
    if not axis.modulo:
        if low_deg <= axis.limit_switch_min_deg:
            return f"the limit switch at {dial.text(axis.limit_switch_min_deg)} deg"
        if high_deg >= axis.limit_switch_max_deg:
            return f"the limit switch at {dial.text(axis.limit_switch_max_deg)} deg"
    for begin, end in axis.sectors_deg:
        for turn in _TURNS if axis.modulo else (0.0,):
            if low_deg < end + turn and high_deg > begin + turn:
                return f"the no-go sector {dial.text(begin)} to {dial.text(end)} deg"
    return ""
