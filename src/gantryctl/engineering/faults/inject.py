"""The way in of every fault, in runs and in tests."""

from __future__ import annotations

from gantryctl.engineering.faults.injection import Injection
from gantryctl.engineering.faults.kinds.kind import Undo
from gantryctl.engineering.faults.oracle.taps import watched
from gantryctl.engineering.faults.oracle.tell import tell
from gantryctl.engineering.faults.target import Target


def inject(target: Target, each: Injection) -> Undo | None:
    """Let an injection act; the oracle that watches the axis, if any, is told just before."""
    axis = watched(target.plant)
    if axis is not None:
        tell(axis, each, target)
    return each.row.act(target, **each.values)
