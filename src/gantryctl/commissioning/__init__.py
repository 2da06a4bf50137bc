"""Commissioning of a CAN machine: a list of steps, each with its proof, resumable, ending in a report."""

from __future__ import annotations

from gantryctl.commissioning.report import write_report
from gantryctl.commissioning.results import Figure, Outcome, Progress, StepResult
from gantryctl.commissioning.run import STEPS, Commissioning, Step, void_control_proofs

__all__ = [
    "STEPS",
    "Commissioning",
    "Figure",
    "Outcome",
    "Progress",
    "Step",
    "StepResult",
    "void_control_proofs",
    "write_report",
]
