"""Every row of the fault catalogue, in its order."""

from __future__ import annotations

import re
from typing import Final

from gantryctl.engineering.faults.table.brake import BRAKE
from gantryctl.engineering.faults.table.bus import BUS
from gantryctl.engineering.faults.table.control import CONTROL
from gantryctl.engineering.faults.table.drive import DRIVE
from gantryctl.engineering.faults.table.encoder import ENCODER
from gantryctl.engineering.faults.table.interlocks import INTERLOCKS
from gantryctl.engineering.faults.table.nodes import NODES
from gantryctl.engineering.faults.table.people import PEOPLE
from gantryctl.engineering.faults.table.process import PROCESS
from gantryctl.engineering.faults.table.row import Row

GROUPS: Final[tuple[tuple[str, tuple[Row, ...]], ...]] = (
    ("A. Encoder and position", ENCODER),
    ("B. Control loop, command and motion", CONTROL),
    ("C. Brake and torque", BRAKE),
    ("D. Drive and CiA 402", DRIVE),
    ("E. CAN bus", (*BUS, *NODES)),
    ("F. Process, time and storage", PROCESS),
    ("G. Limits, interlocks, people and power", INTERLOCKS),
    ("H. Operators, network, files and configuration", PEOPLE),
)
ROWS: Final = {row.number: row for _, rows in GROUPS for row in rows}


def base(number: str) -> str:
    """The row to which a variant belongs: "A1b" is a variant of "A1"."""
    return re.sub(r"(?<=\d)[a-zA-Z]$", "", number)
