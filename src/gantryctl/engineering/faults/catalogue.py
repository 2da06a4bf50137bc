"""The fault catalogue: every row as data."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.case import FaultCase
from gantryctl.engineering.faults.rows import brake, bus, control, drive, encoder, interlocks, process
from gantryctl.errors import UsageError

CATALOGUE: Final[tuple[FaultCase, ...]] = (
    *encoder.ROWS,
    *control.ROWS,
    *brake.ROWS,
    *drive.ROWS,
    *bus.ROWS,
    *process.ROWS,
    *interlocks.ROWS,
)
_BY_NUMBER: Final = {case.number.lower(): case for case in CATALOGUE}


def fault_case(number: str) -> FaultCase:
    """The row of a number, in any case of letters.

    Raises:
        UsageError: there is none.
    """
    found = _BY_NUMBER.get(number.strip().lower())
    if found is None:
        raise UsageError(f"there is no fault '{number}'; `gantryctl faults list` names them")
    return found
