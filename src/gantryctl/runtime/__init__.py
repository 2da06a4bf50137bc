"""The scan engine with its clocks, operators, recorders and retained memory; it knows ports only."""

from gantryctl.runtime.clocks import RealClock, VirtualClock
from gantryctl.runtime.engine import NOTHING_READ, Engine, ScanFailure, trace_columns
from gantryctl.runtime.lock import StateLock
from gantryctl.runtime.operators import FixedOperator, ScriptedOperator
from gantryctl.runtime.overrun import OverrunLimits, OverrunPolicy
from gantryctl.runtime.priority import keeps_time
from gantryctl.runtime.retained import AlarmEntry, Retained
from gantryctl.runtime.retained_store import RetainedMemory
from gantryctl.runtime.statistics import Histogram, ScanStatistics

__all__ = [
    "NOTHING_READ",
    "AlarmEntry",
    "Engine",
    "FixedOperator",
    "Histogram",
    "OverrunLimits",
    "OverrunPolicy",
    "RealClock",
    "Retained",
    "RetainedMemory",
    "ScanFailure",
    "ScanStatistics",
    "ScriptedOperator",
    "StateLock",
    "VirtualClock",
    "keeps_time",
    "trace_columns",
]
