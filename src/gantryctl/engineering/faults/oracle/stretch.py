"""Where an axis may be: between the ends of over-travel, outside of every no-go sector."""

from __future__ import annotations

import math
from typing import NamedTuple

from gantryctl.program.settings import TravelSettings


class Stretch(NamedTuple):
    """Permitted angles around the present one, rad at the gantry.

    Attributes:
        in_sector: the axis stands in a no-go sector, which it may leave.
    """

    low_rad: float
    high_rad: float
    in_sector: bool


def stretch_around(travel: TravelSettings, here_rad: float) -> Stretch:
    """The stretch of this travel (settings of the axis) in which an angle of the gantry lies."""
    low, high, in_sector = travel.over_travel_min_rad, travel.over_travel_max_rad, False
    for begin, end in travel.no_go_rad:
        # A modulo axis has the sector in every turn: the one that begins below here, and the next.
        turns = math.floor((here_rad - begin) / math.tau) if travel.endless else 0
        for turn in (turns, turns + 1) if travel.endless else (0,):
            first, last = begin + turn * math.tau, end + turn * math.tau
            if first < here_rad < last:
                in_sector = True
            elif last <= here_rad:
                low = max(low, last)
            else:
                high = min(high, first)
    return Stretch(low, high, in_sector)
