"""Turns of a modulo axis: the encoder count at 0 deg moves on with them, so that no angle grows."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Final

_TURN: Final = 2.0 * math.pi
# At rest half a turn more than the turn itself before anything is done: no axis that stands at +-180 deg goes to and
# fro between two zeros.
_RESTING_RAD: Final = 1.5 * math.pi
# Of a motion without an end: the set-point is exact to 9e-13 rad there, a thousandth of the finest count of a gantry.
CRUISING_TURNS: Final = 1000


class Turns:
    """Encoder count at 0 deg of a modulo axis.

    The count of a turn is a fraction: with 352/3 motor turns the zero lies between two counts after most turns. So the
    zero is computed from the first one and the number of turns, and no error adds up.

    Args:
        turn_counts: exact counts of a turn of the axis.
        zero_counts: encoder count at 0 deg.
    """

    __slots__ = ("_turns", "_zero", "turn_counts")

    def __init__(self, turn_counts: Fraction, zero_counts: float) -> None:
        self.turn_counts = turn_counts
        self.begin(zero_counts)

    def begin(self, zero_counts: float) -> float:
        """Take a new zero, to the count; return it."""
        self._zero, self._turns = round(zero_counts), 0
        return float(self._zero)

    def due(self, pos_ref_rad: float, *, resting: bool, cruising: bool) -> int:
        """Whole turns by which the zero has to move on now."""
        most = _RESTING_RAD if resting else CRUISING_TURNS * _TURN if cruising else math.inf
        return round(pos_ref_rad / _TURN) if abs(pos_ref_rad) > most else 0

    def move_on(self, turns: int) -> float:
        """Move the zero on by whole turns; the count at 0 deg after that."""
        self._turns += turns
        counts = self._turns * self.turn_counts
        # Python divides whole numbers of any size with one rounding.
        return (self._zero * counts.denominator + counts.numerator) / counts.denominator

    def kept_zero(self, counts: int, range_counts: int) -> int:
        """Zero offset to keep with a rest position, which is `counts` within the encoder's range.

        The range of an encoder on a motor is no whole number of turns of the axis, so the zero is kept as a distance
        from where the axis rests: modulo the fewest turns that are whole counts, so that it is exact.
        """
        span = self.turn_counts.numerator
        return counts % range_counts - ((counts - self._zero + span // 2) % span - span // 2)
