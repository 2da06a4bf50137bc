"""The table of all codes. `docs/reference/alarms.md` and the page's table are written from it."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.bus import BUS
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.control import CONTROL
from gantryctl.program.alarms.definition import Definition
from gantryctl.program.alarms.encoder import ENCODER
from gantryctl.program.alarms.power import POWER
from gantryctl.program.alarms.refusals import REFUSALS
from gantryctl.program.alarms.service import SERVICE
from gantryctl.program.alarms.start import START

ALARMS: Final[dict[Code, Definition]] = {
    row.code: row for row in (*ENCODER, *BUS, *CONTROL, *POWER, *REFUSALS, *SERVICE, *START)
}
