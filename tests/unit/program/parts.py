"""Parts of the program without an axis: feedback and alarms as a scan leaves them, set by a test."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from gantryctl.image import DriveState
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.feedback import Feedback
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.settings import AxisSettings
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import rad
from unit.program.rig import ZERO_COUNTS, settings

BOTH = pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
PERIODS = pytest.mark.parametrize("period_s", [0.001, 0.004, 0.010])


class Parts:
    """Settings, feedback and alarms of an axis that is held by its drive, brake open, at 0 deg."""

    def __init__(
        self, period_s: float = 0.001, *, config: AxisSettings | None = None, **arguments: object
    ) -> None:
        self.settings = config or settings(period_s=period_s, **arguments)
        self.period_s = period_s
        self.alarms = AlarmLog()
        self.feedback = Feedback(self.settings, self.alarms)
        self.feedback.state = DriveState.OPERATION_ENABLED
        self.feedback.brake_open = True
        self.feedback.counts = float(ZERO_COUNTS)
        self.virtual = VirtualAxis(self.settings)
        self.holding = HoldingTorque(self.settings)

    @property
    def codes(self) -> list[str]:
        return [str(code) for code in self.alarms.active]

    def reaction(self, code: str) -> Reaction:
        return self.alarms.active[Code(code)].reaction

    def turn(self, deg_s: float) -> None:
        """The drive reports this speed, at the gantry."""
        self.feedback.vel_rad_s = rad(deg_s)

    def after(
        self, scan: Callable[[], object], done: Callable[[], bool] | None = None, most_s: float = 10.0
    ) -> float:
        """Seconds of scans until an alarm, or until something is done; inf where that does not come."""
        found = done or (lambda: bool(self.alarms.active))
        for scans in range(1, math.ceil(most_s / self.period_s) + 1):
            self.alarms.scan += 1
            self.alarms.time_s = self.alarms.scan * self.period_s
            scan()
            if found():
                return scans * self.period_s
        return math.inf


def in_scans(time_s: float, period_s: float) -> float:
    """The end of the scan in which a time has passed."""
    return math.ceil(time_s / period_s - 1e-9) * period_s
