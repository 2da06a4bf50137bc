"""Angles of its travel at which an axis is tried: the reference machine's where they fit, else the nearest that do."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.machine.tables.model import Machine

# The gears stay on one flank there: away from the angles without eccentric moment, and from those where it is largest.
_ON_ONE_FLANK_DEG: Final = 15.0
# From a no-go sector.
_AWAY_DEG: Final = 0.5
# Room of a trial at its place.
_ROOM_DEG: Final = 5.0


def fitted_stretch_deg(machine: Machine, low_deg: float, high_deg: float) -> tuple[float, float]:
    """A stretch of travel as long as `low_deg..high_deg`, nearest to it; shorter where travel is."""
    least, most = reach_deg(machine)
    way = min(high_deg - low_deg, most - least)
    begin = min(max(low_deg, least), most - way)
    return begin, begin + way


def reach_deg(machine: Machine) -> tuple[float, float]:
    """Where a trial may go: travel, or its stretch between no-go sectors, and away from those."""
    axis = machine.axis
    low, high = axis.home_stretch_deg
    if low > axis.pos_min_deg:
        low += _AWAY_DEG
    if high < axis.pos_max_deg:
        high -= _AWAY_DEG
    return (low, high) if low < high else axis.home_stretch_deg


def heaviest_deg(machine: Machine) -> tuple[float, float]:
    """Angles of travel with the largest eccentric moment, either way: 90 and -90 deg on the reference machine."""
    axis, load = machine.axis, machine.plant.load
    level = load.eccentric_angle_deg
    least, most = reach_deg(machine)
    first = math.ceil((least - level - 90.0) / 180.0)
    last = math.floor((most - level - 90.0) / 180.0)
    candidates = [level + 90.0 + 180.0 * k for k in range(first, last + 1)] + [least, most]
    # Of several turns the one around the place where a new machine stands.
    candidates.sort(key=lambda angle: abs(angle - axis.start_angle_deg))

    def moment(angle_deg: float) -> float:
        # Rounded, so that of two equal ones the nearer is chosen.
        return round(math.sin(math.radians(angle_deg - level)), 12)

    return max(candidates, key=moment), min(candidates, key=moment)


def one_flank_deg(machine: Machine) -> float:
    """Where steps are made, so that the gears stay on one flank: 75 deg on the reference machine."""
    at = heaviest_deg(machine)[0] - _ON_ONE_FLANK_DEG
    low, high = fitted_stretch_deg(machine, at - _ROOM_DEG, at + _ROOM_DEG)
    return 0.5 * (low + high)
