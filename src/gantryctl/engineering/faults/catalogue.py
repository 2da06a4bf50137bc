"""The fault catalogue: every fault that is injected into an axis, and the row of the table that it belongs to."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.case import FaultCase
from gantryctl.engineering.faults.rows import (
    brake,
    bus,
    control,
    drive,
    encoder,
    interlocks,
    nodes,
    process,
)
from gantryctl.engineering.faults.table.row import Row
from gantryctl.engineering.faults.table.table import ROWS, base
from gantryctl.errors import UsageError

CATALOGUE: Final[tuple[FaultCase, ...]] = (
    *encoder.ROWS,
    *control.ROWS,
    *brake.ROWS,
    *drive.ROWS,
    *bus.ROWS,
    *nodes.ROWS,
    *process.ROWS,
    *interlocks.ROWS,
)
_BY_NUMBER: Final = {case.number.lower(): case for case in CATALOGUE}


def fault_case(number: str) -> FaultCase:
    """The case of a number, in any case of letters.

    Raises:
        UsageError: there is none, or the fault is not one that is injected into an axis.
    """
    wanted = number.strip()
    found = _BY_NUMBER.get(wanted.lower())
    if found is not None:
        return found
    row = fault_row(wanted)
    raise UsageError(f"{row.number} '{row.fault}' is no fault of the axis; its tests: {', '.join(row.tests)}")


def fault_row(number: str) -> Row:
    """The row of the table to which a number belongs.

    Raises:
        UsageError: there is none.
    """
    row = ROWS.get(base(number.strip().upper()))
    if row is None or (number.strip().lower() not in _BY_NUMBER and number.strip().upper() != row.number):
        raise UsageError(f"there is no fault '{number}'; `gantryctl faults list` names them")
    return row


def cases_of(row: Row) -> tuple[FaultCase, ...]:
    """The cases that inject the fault of a row, its variants behind it."""
    return tuple(case for case in CATALOGUE if base(case.number) == row.number)
