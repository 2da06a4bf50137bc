"""The PLC program: axis, function blocks, alarms, and the shipped `GantryProgram`.

Errors are values inside the scan: a bad input gives a refusal or an alarm, never an exception.
"""

from gantryctl.program.alarm_rows import Definition
from gantryctl.program.alarm_table import ALARMS
from gantryctl.program.alarms import Alarm, AlarmLog, Refusal, all_codes, explain
from gantryctl.program.axis import Axis
from gantryctl.program.brake_test import BrakeTestLaw, BrakeTestOutcome, BrakeTestPhase, BrakeTestResult
from gantryctl.program.codes import Code, Reaction, Severity
from gantryctl.program.command import CommandStatus, MotionCommand
from gantryctl.program.gantry import GantryProgram
from gantryctl.program.power_phases import PowerPhase, Proof
from gantryctl.program.program import AxisProgram
from gantryctl.program.settings import (
    AxisSettings,
    CompensationSettings,
    Hold,
    LawSettings,
    MonitorSettings,
    PowerSettings,
    RampSettings,
    SpeedSettings,
    TravelSettings,
    scans,
)
from gantryctl.program.states import AxisEvents, AxisState, next_state

__all__ = [
    "ALARMS",
    "Alarm",
    "AlarmLog",
    "Axis",
    "AxisEvents",
    "AxisProgram",
    "AxisSettings",
    "AxisState",
    "BrakeTestLaw",
    "BrakeTestOutcome",
    "BrakeTestPhase",
    "BrakeTestResult",
    "Code",
    "CommandStatus",
    "CompensationSettings",
    "Definition",
    "GantryProgram",
    "Hold",
    "LawSettings",
    "MonitorSettings",
    "MotionCommand",
    "PowerPhase",
    "PowerSettings",
    "Proof",
    "RampSettings",
    "Reaction",
    "Refusal",
    "Severity",
    "SpeedSettings",
    "TravelSettings",
    "all_codes",
    "explain",
    "next_state",
    "scans",
]
