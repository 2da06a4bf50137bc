"""Process, time and storage (F)."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.case import FaultCase, ReactionClass
from gantryctl.engineering.faults.injection import injection
from gantryctl.program.alarms.codes import Code

ROWS: Final = (
    FaultCase(
        number="F1",
        title="one scan 12 ms late",
        detected_by="lateness of the scan",
        reaction=ReactionClass.WARNING,
        reads="counted",
        injections=(injection("clock", "stall", late_s=0.012),),
        position_valid=True,
    ),
    FaultCase(
        number="F2",
        title="a scan 40 ms late",
        detected_by="lateness of the scan, 30 ms",
        reaction=ReactionClass.QUICK_STOP,
        codes=(Code.SYS_02,),
        reads="the controller was late; quick stop",
        injections=(injection("clock", "stall", late_s=0.040),),
        position_valid=True,
    ),
    FaultCase(
        number="F3",
        title="controller stalls for 2 s",
        detected_by="deadlines of the drive; on waking the own lateness, 50 ms",
        reaction=ReactionClass.DRIVE_DEADLINE,
        codes=(Code.SYS_03,),
        reads="the controller was frozen; the drive stopped by itself",
        injections=(injection("clock", "stall", late_s=2.0),),
        buses=("bus",),
    ),
)
