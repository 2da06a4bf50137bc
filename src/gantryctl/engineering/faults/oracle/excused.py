"""What the oracle cannot know of a row of the catalogue."""

from __future__ import annotations

from typing import Final

EXCUSED: Final = {
    # Whether an encoder that shows nothing is alive is tried by a command that grows; the true way is the row's.
    "A3b": ("INV-2",),
    "A3c": ("INV-2",),
    # A brake that does not hold, and an encoder in doubt or no torque: nothing is left that could hold the load. That
    # people are told, and in time, is demanded by the row (`FaultCase.also`).
    "A20": ("INV-2",),
    "B13": ("INV-2",),
    # The contact is what lies about the brake.
    "C6": ("INV-7",),
    # A telegram carries no time: two in the wrong order are a step of the reading for one scan.
    "E5": ("INV-3",),
}
"""Invariants by row."""
