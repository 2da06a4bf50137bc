"""One motion command and what becomes of it."""

from __future__ import annotations

from enum import Enum

from gantryctl.program.alarms.log import Refusal
from gantryctl.program.axis.states import AxisState


class CommandStatus(Enum):
    """What has become of a command."""

    WAITING = 0
    """Accepted; the brake is being opened first."""
    ACTIVE = 1
    DONE = 2
    ABORTED = 3
    """Another command, a stop or power-off took over."""
    ERROR = 4
    """Refused, or ended by an alarm; `refusal` says why."""


class MotionCommand:
    """One command and what became of it. Blocks keep it; the axis moves its status on."""

    __slots__ = ("endless", "refusal", "settles", "speed_rad_s", "state", "status", "target_rad")

    def __init__(
        self, state: AxisState, target_rad: float, speed_rad_s: float, *, settles: bool, endless: bool = False
    ) -> None:
        self.state = state
        self.target_rad = target_rad
        self.speed_rad_s = speed_rad_s
        self.settles = settles
        """Done only when the axis is in position, not when the set-point has arrived."""
        self.endless = endless
        """A motion with a speed only; it ends at the end of the travel or by a stop."""
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
