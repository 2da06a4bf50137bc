"""Power that nobody has control of: switched off after a time at rest that the machine file sets."""

from __future__ import annotations

import math

from gantryctl.program import Axis, AxisState
from gantryctl.service.command.authority import Authority


class UnheldPower:
    """Counts how long the axis has stood with power on while nobody had control.

    It counts at rest only: not during a motion, also one that goes on without its holder, not in a stop, not while
    power goes on or off. Whoever takes control ends it, and so does every motion; it begins anew afterwards.

    Args:
        limit_s: `[monitors] unheld_power_time_s`.
    """

    def __init__(self, axis: Axis, authority: Authority, limit_s: float) -> None:
        self._axis, self._authority, self.limit_s = axis, authority, limit_s
        self._since_s = math.nan

    def due(self, now_s: float, *, power: bool) -> bool:
        """Whether power is to be switched off; called once a scan.

        Args:
            power: the operator's level of this scan. What the operator did not switch on is not switched off here.
        """
        axis = self._axis
        rests = axis.at_rest and axis.state is AxisState.STANDSTILL
        if not (power and rests) or self._authority.holder is not None:
            self._since_s = math.nan
            return False
        if math.isnan(self._since_s):
            self._since_s = now_s
        return not now_s - self._since_s < self.limit_s

    def left_s(self, now_s: float) -> float:
        """Time until power is switched off, s; nan while it does not count."""
        # The next scan switches off at the end: nobody sees a time below zero.
        return max(0.0, self._since_s + self.limit_s - now_s) if not math.isnan(self._since_s) else math.nan
