"""Units in which drives count speed in 60FF and 606C, and the word of 60A9 for each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from gantryctl.units import DriveVelocityUnit


@dataclass(frozen=True, slots=True)
class VelocityUnit:
    """Unit of 60FF and 606C; exactly one of the two sizes is not 0.

    Attributes:
        per_turn_s: units in one motor turn a second; 0 for a unit that counts increments.
        per_increment_s: units in one increment of 6064 a second; 0 for a unit that counts turns.
        si_unit: 60A9, prefix, numerator and denominator in one word (CiA 402); None where no word of 60A9 means it.
    """

    per_turn_s: float
    per_increment_s: float
    si_unit: int | None

    def per_rad_s(self, increments_per_turn: int) -> float:
        """Units in one rad/s of a motor with this encoder."""
        per_turn_s = self.per_turn_s or self.per_increment_s * increments_per_turn
        return per_turn_s / (2.0 * math.pi)


VELOCITY_UNITS: Final[dict[DriveVelocityUnit, VelocityUnit]] = {
    # Numerator B5h increments, B4h revolutions; denominator 03h seconds, 47h minutes; prefix a power of ten, FFh = -1.
    "inc/s": VelocityUnit(0.0, 1.0, 0x00B5_0300),
    # Copley counts in tenths of a count (CANopen Programmer's Manual, objects 60FF and 606C).
    "0.1 inc/s": VelocityUnit(0.0, 10.0, 0xFFB5_0300),
    # Technosoft: 65 536 units are one increment in one sample of its slow loop, 1 ms unless its tool says otherwise.
    "16.16 inc/ms": VelocityUnit(0.0, 65.536, None),
    "r/min": VelocityUnit(60.0, 0.0, 0x00B4_4700),
    "0.1 r/min": VelocityUnit(600.0, 0.0, 0xFFB4_4700),
    "0.001 r/min": VelocityUnit(60_000.0, 0.0, 0xFDB4_4700),
    "mrev/s": VelocityUnit(1000.0, 0.0, 0xFDB4_0300),
}


def unit_of_word(word: int) -> DriveVelocityUnit | None:
    """Unit that a value of 60A9 means; None for another word."""
    return next((name for name, unit in VELOCITY_UNITS.items() if unit.si_unit == word), None)
