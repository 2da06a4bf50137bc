"""The PLC program: axis, function blocks, alarms, and the shipped `GantryProgram`.

Errors are values inside the scan: a bad input gives a refusal or an alarm, never an exception.
"""

from gantryctl.program.alarms.codes import Code, Reaction, Severity
from gantryctl.program.alarms.log import Alarm, AlarmLog, Refusal
from gantryctl.program.alarms.table import ALARMS
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.states import AxisState
from gantryctl.program.gantry import AxisProgram, GantryProgram
from gantryctl.program.power.brake_test import BrakeTestOutcome, BrakeTestPhase, BrakeTestResult
from gantryctl.program.power.phases import PowerPhase

__all__ = [
    "ALARMS",
    "Alarm",
    "AlarmLog",
    "Axis",
    "AxisProgram",
    "AxisState",
    "BrakeTestOutcome",
    "BrakeTestPhase",
    "BrakeTestResult",
    "Code",
    "GantryProgram",
    "PowerPhase",
    "Reaction",
    "Refusal",
    "Severity",
]
