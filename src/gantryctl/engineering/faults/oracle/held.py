"""A controller that stands still while a spoilt encoder or sign drives the axis on: nobody can end it meanwhile."""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.engineering.faults.oracle.limits import SILENT_MS, StopClass
from gantryctl.engineering.faults.oracle.words import Instant, TrueAxis

# Of the oracle.
_SAMPLE_MS: Final = 1.0


class HeldUp(NamedTuple):
    """The controller stands still.

    Attributes:
        begun: what was true when it began.
        held_s: for how long.
        went_on: what was true when it gave its first command after that.
    """

    begun: Instant
    held_s: float
    went_on: Instant | None = None

    def commands(self, now: Instant) -> HeldUp:
        """The same, when a command of the program is given."""
        over = now.ms >= self.begun.ms + 1e3 * self.held_s - _SAMPLE_MS
        return self._replace(went_on=now) if over and self.went_on is None else self

    def way_deg(self, true: TrueAxis, since: Instant) -> float:
        """Permitted way, deg, of a spoilt feedback at this onset: until the controller stood still, and from there.

        Once it goes on the true way until then is given, and what is permitted from there is what its monitors need.
        0 where it had stood still before, or the bounds have no machine to compute with.
        """
        bounds, begun = true.bounds, self.begun
        if bounds.held_way_deg is None or begun.ms < since.ms - SILENT_MS:
            return 0.0
        until = min(
            abs(true.deg(begun.angle - since.angle)),
            bounds.way_deg(StopClass.FEEDBACK, true.deg(since.speed)),
        )
        way = bounds.held_way_deg(true.deg(begun.speed), self.held_s)
        if self.went_on is not None:
            so_far = abs(true.deg(self.went_on.angle - begun.angle))
            way = min(way, so_far + bounds.held_way_deg(true.deg(self.went_on.speed), 0.0))
        return until + way
