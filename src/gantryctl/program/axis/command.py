"""A motion command and its status."""

from __future__ import annotations

from enum import Enum

from gantryctl.program.alarms.log import Refusal
from gantryctl.program.axis.states import AxisState


class CommandStatus(Enum):
    """Status of a command.

    WAITING: accepted, and the brake opens first. ABORTED: another command, a stop or power-off took over.
    ERROR: refused, or ended by an alarm; `refusal` has the reason.
    """

    WAITING = 0
    ACTIVE = 1
    DONE = 2
    ABORTED = 3
    ERROR = 4


class MotionCommand:
    """One command and its status. A block keeps it; the axis changes the status.

    Attributes:
        settles: done only when the axis is in position, not when the set-point has arrived.
        endless: a motion with a speed only; it ends at the end of the travel or by a stop.
        refusal: the reason of an error, or of an end at the travel limit.
    """

    __slots__ = ("endless", "refusal", "settles", "speed_rad_s", "state", "status", "target_rad")

    def __init__(
        self, state: AxisState, target_rad: float, speed_rad_s: float, *, settles: bool, endless: bool = False
    ) -> None:
        self.state = state
        self.target_rad = target_rad
        self.speed_rad_s = speed_rad_s
        self.settles = settles
        self.endless = endless
        self.status = CommandStatus.ACTIVE
        self.refusal: Refusal | None = None

    @property
    def alive(self) -> bool:
        """Waiting or active."""
        return self.status in (CommandStatus.WAITING, CommandStatus.ACTIVE)

    def fail(self, reason: Refusal) -> MotionCommand:
        """End it with an error."""
        self.status, self.refusal = CommandStatus.ERROR, reason
        return self
