"""Stretch of travel that an axis can reach from where it is: between the ends of travel or two no-go sectors.

No set-point and no stop enters a no-go sector, so an axis stays in the stretch in which it stands. A modulo axis has
its sectors once in every turn; the way round is a part of its stretch.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

Sector: TypeAlias = tuple[float, float]
"""Begin and end of a no-go sector, rad, the end the larger."""


class Stretch(NamedTuple):
    """What the set-point can reach, and what bounds it.

    Attributes:
        low_rad, high_rad: the set-point does not pass these two.
        below, above: the sector that is the reason; None at an end of travel, or without an end.
    """

    low_rad: float
    high_rad: float
    below: Sector | None
    above: Sector | None


def stretch_around(
    pos_rad: float, ends_rad: Sector, no_go_rad: tuple[Sector, ...], clearance_rad: float, *, endless: bool
) -> Stretch:
    """Stretch around an angle; of an axis that stands in a sector, that behind its nearer edge.

    Args:
        ends_rad: of travel. no_go_rad: sectors, those of a modulo axis in any turn.
        clearance_rad: the set-point keeps it to a sector.
    """
    low, high = ends_rad
    below: Sector | None = None
    above: Sector | None = None
    for begin, end in _near(pos_rad, no_go_rad, endless=endless):
        is_above = pos_rad - begin <= end - pos_rad
        if is_above and begin - clearance_rad < high:
            high, above = begin - clearance_rad, (begin, end)
        elif not is_above and end + clearance_rad > low:
            low, below = end + clearance_rad, (begin, end)
    return Stretch(low, high, below, above)


def _near(pos_rad: float, no_go_rad: tuple[Sector, ...], *, endless: bool) -> list[Sector]:
    """Sectors of a linear axis as they are; of a modulo axis those of this turn, the one before and the next."""
    if not endless:
        return list(no_go_rad)
    near = []
    for begin, end in no_go_rad:
        turns = math.floor((pos_rad - begin) / math.tau)
        # Of an axis in a sector, nearer to its begin, the one before is the end of the way back.
        near += [(begin + k * math.tau, end + k * math.tau) for k in (turns - 1, turns, turns + 1)]
    return near
