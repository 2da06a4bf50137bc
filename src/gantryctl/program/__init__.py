"""The PLC program: axis, function blocks, alarms, and the shipped `GantryProgram`.

Errors are values inside the scan: a bad input gives a refusal or an alarm, never an exception.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gantryctl.lazy import importer

if TYPE_CHECKING:
    from gantryctl.program.alarms.codes import Code as Code
    from gantryctl.program.alarms.codes import Reaction as Reaction
    from gantryctl.program.alarms.codes import Severity as Severity
    from gantryctl.program.alarms.log import Alarm as Alarm
    from gantryctl.program.alarms.log import AlarmLog as AlarmLog
    from gantryctl.program.alarms.log import Refusal as Refusal
    from gantryctl.program.alarms.table import ALARMS as ALARMS
    from gantryctl.program.axis.axis import Axis as Axis
    from gantryctl.program.axis.states import AxisState as AxisState
    from gantryctl.program.gantry import AxisProgram as AxisProgram
    from gantryctl.program.gantry import GantryProgram as GantryProgram
    from gantryctl.program.power.brake_test import BrakeTestOutcome as BrakeTestOutcome
    from gantryctl.program.power.brake_test import BrakeTestPhase as BrakeTestPhase
    from gantryctl.program.power.brake_test import BrakeTestResult as BrakeTestResult
    from gantryctl.program.power.phases import PowerPhase as PowerPhase

# Every process of the service tells alarms; one of them runs the program.
_HOME = {
    "ALARMS": "gantryctl.program.alarms.table",
    "Alarm": "gantryctl.program.alarms.log",
    "AlarmLog": "gantryctl.program.alarms.log",
    "Axis": "gantryctl.program.axis.axis",
    "AxisProgram": "gantryctl.program.gantry",
    "AxisState": "gantryctl.program.axis.states",
    "BrakeTestOutcome": "gantryctl.program.power.brake_test",
    "BrakeTestPhase": "gantryctl.program.power.brake_test",
    "BrakeTestResult": "gantryctl.program.power.brake_test",
    "Code": "gantryctl.program.alarms.codes",
    "GantryProgram": "gantryctl.program.gantry",
    "PowerPhase": "gantryctl.program.power.phases",
    "Reaction": "gantryctl.program.alarms.codes",
    "Refusal": "gantryctl.program.alarms.log",
    "Severity": "gantryctl.program.alarms.codes",
}

__all__ = list(_HOME)
if not TYPE_CHECKING:  # so that mypy refuses other names
    __getattr__ = importer(globals(), _HOME)


def __dir__() -> list[str]:
    return sorted(_HOME)
