"""Where the axis was last seen by a controller that has not shut down: what SYS-05 tells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal
from gantryctl.program.alarms.words import Said, Words
from gantryctl.units import Dial


class LastSeen(NamedTuple):
    """Angle as people read it and speed; None where they were not known, or not vouched for."""

    pos_deg: float | None
    vel_deg_s: float | None

    @classmethod
    def of(cls, tags: Mapping[str, Any], dial: Dial) -> LastSeen:
        """Read them from the tags of the last snapshot."""
        # A number that the controller did not vouch for is not told after it either.
        pos_deg, vel_deg_s = tags["pos_act_deg"], tags["vel_act_deg_s"]
        if pos_deg is None or vel_deg_s is None or not tags["position_valid"]:
            return cls(None, None)
        return cls(dial.read_deg(pos_deg), vel_deg_s)

    def told(self, when: Said) -> Refusal:
        """SYS-05 about a run that ended so."""
        known = self.pos_deg is not None and self.vel_deg_s is not None
        where = Words.AT_SPEED(value=self.pos_deg, speed=self.vel_deg_s) if known else Words.AT_UNKNOWN
        return Refusal(Code.SYS_05, {"when": when, "where": where})
