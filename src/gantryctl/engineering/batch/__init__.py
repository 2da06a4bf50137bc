"""The closed loop without Python in the scan: one plant logged in full, or many plants with a few figures each.

The same compiled laws and physics as the scan engine runs one by one, so the same bits while no monitor acts.
"""

from gantryctl.engineering.batch.base_motion import base_motion_rad
from gantryctl.engineering.batch.lockstep import Runner, alone, expected, grouped, in_lockstep, outcome
from gantryctl.engineering.batch.loop import ClosedLoop, Leg, LegStatistics, Log, log_legs, run_legs, scans
from gantryctl.engineering.batch.settling import settling_s

__all__ = [
    "ClosedLoop",
    "Leg",
    "LegStatistics",
    "Log",
    "Runner",
    "alone",
    "base_motion_rad",
    "expected",
    "grouped",
    "in_lockstep",
    "log_legs",
    "outcome",
    "run_legs",
    "scans",
    "settling_s",
]
