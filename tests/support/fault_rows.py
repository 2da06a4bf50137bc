"""What the oracle sees in a run of a row of the fault catalogue."""

from __future__ import annotations

from gantryctl.engineering.faults.case import FaultCase
from gantryctl.engineering.faults.oracle.excused import EXCUSED
from gantryctl.engineering.faults.oracle.taps import Oracle


def seen_by(oracle: Oracle, case: FaultCase) -> list[str]:
    """What the oracle saw, which belongs to the row: one that waits for a mend may break an invariant too."""
    # The way to rest, INV-1, is judged by the row's own limit, from the moment of the injection.
    excused = ("INV-1", *EXCUSED.get(case.number, ()))
    seen = [str(violation) for violation in oracle.violations if violation.invariant not in excused]
    oracle.violations.clear()
    return seen
