"""Faults in tests: on what they act, and what the oracle sees in a run of a row of the catalogue."""

from __future__ import annotations

from gantryctl.drives.simulated import SimDrive
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.group import Neighbours
from gantryctl.engineering.faults.case import FaultCase
from gantryctl.engineering.faults.oracle.excused import EXCUSED
from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.engineering.faults.target import StallingClock, Target
from gantryctl.machine import Machine
from gantryctl.runtime import Engine, FixedOperator


def target_of(
    machine: Machine, device: SimDrive | DriveNode, engine: Engine, neighbours: Neighbours | None = None
) -> Target:
    """The axis of a test, for every fault but those of the clock."""
    assert isinstance(engine.operator, FixedOperator)
    clock = StallingClock(engine.period_s)
    return Target(machine, device, engine, engine.operator, clock, neighbours or Neighbours())


def seen_by(oracle: Oracle, case: FaultCase) -> list[str]:
    """What the oracle saw, which belongs to the row: one that waits for a mend may break an invariant too."""
    # The way to rest, INV-1, is judged by the row's own limit, from the moment of the injection.
    excused = ("INV-1", *EXCUSED.get(case.number, ()))
    seen = [str(violation) for violation in oracle.violations if violation.invariant not in excused]
    oracle.violations.clear()
    return seen
