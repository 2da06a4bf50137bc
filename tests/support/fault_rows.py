"""What the oracle sees in a run of a row of the fault catalogue."""

from __future__ import annotations

from gantryctl.engineering.faults.case import FaultCase
from support.oracle.taps import Oracle

EXCUSED = {
    # Whether an encoder that shows nothing is alive is tried by a command that grows; the true way is the row's.
    "A3b": ("INV-2",),
    "A3c": ("INV-2",),
    "A20": (
        "INV-2",
    ),  # a brake that does not hold and an encoder in doubt: nothing is left that could hold the load
    "C6": ("INV-7",),  # the contact is what lies about the brake
    "E5": (
        "INV-3",
    ),  # a telegram carries no time: two in the wrong order are a step of the reading for one scan
}
"""What the oracle cannot know of a row."""


def seen_by(oracle: Oracle, case: FaultCase) -> list[str]:
    """What the oracle saw, which belongs to the row: one that waits for a mend may break an invariant too."""
    # The way to rest, INV-1, is judged by the row's own limit, from the moment of the injection.
    excused = ("INV-1", *EXCUSED.get(case.number, ()))
    seen = [str(violation) for violation in oracle.violations if violation.invariant not in excused]
    oracle.violations.clear()
    return seen
