"""A controller that stands still while a spoilt encoder or sign drives the axis on: nobody can end it meanwhile."""

from __future__ import annotations

from typing import NamedTuple

from gantryctl.engineering.faults.oracle.limits import SILENT_MS, StopClass
from gantryctl.engineering.faults.oracle.words import Instant, TrueAxis


class HeldUp(NamedTuple):
    """The controller stands still.

    Attributes:
        begun: what was true when it began.
        held_s: for how long.
    """

    begun: Instant
    held_s: float

    def way_deg(self, true: TrueAxis, since: Instant) -> float:
        """Permitted way, deg, of a spoilt feedback at this onset: until the controller stood still, and from there.

        0 where it had stood still before, or the bounds have no machine to compute with.
        """
        bounds, begun = true.bounds, self.begun
        if bounds.held_way_deg is None or begun.ms < since.ms - SILENT_MS:
            return 0.0
        until = min(
            abs(true.deg(begun.angle - since.angle)),
            bounds.way_deg(StopClass.FEEDBACK, true.deg(since.speed)),
        )
        return until + bounds.held_way_deg(true.deg(begun.speed), self.held_s)
