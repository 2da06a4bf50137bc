"""The PLC program: axis, function blocks, alarms, and the shipped `GantryProgram`.

Errors are values inside the scan: a bad input gives a refusal or an alarm, never an exception.
"""

from gantryctl.program.alarms.codes import Code, Reaction, Severity
from gantryctl.program.alarms.definition import Definition
from gantryctl.program.alarms.explain import all_codes, explain
from gantryctl.program.alarms.log import Alarm, AlarmLog, Refusal
from gantryctl.program.alarms.table import ALARMS
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.command import CommandStatus, MotionCommand
from gantryctl.program.axis.states import AxisEvents, AxisState, next_state
from gantryctl.program.gantry import GantryProgram
from gantryctl.program.power.brake_test import BrakeTestOutcome, BrakeTestPhase, BrakeTestResult
from gantryctl.program.power.phases import PowerPhase, Proof
from gantryctl.program.program import AxisProgram
from gantryctl.program.settings import (
    AxisSettings,
    CompensationSettings,
    LawSettings,
    MonitorSettings,
    PowerSettings,
    RampSettings,
    SpeedSettings,
    StandstillPolicy,
    TravelSettings,
    scans,
)

__all__ = [
    "ALARMS",
    "Alarm",
    "AlarmLog",
    "Axis",
    "AxisEvents",
    "AxisProgram",
    "AxisSettings",
    "AxisState",
    "BrakeTestOutcome",
    "BrakeTestPhase",
    "BrakeTestResult",
    "Code",
    "CommandStatus",
    "CompensationSettings",
    "Definition",
    "GantryProgram",
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
    "StandstillPolicy",
    "TravelSettings",
    "all_codes",
    "explain",
    "next_state",
    "scans",
]
