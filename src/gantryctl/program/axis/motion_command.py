"""One motion command: what it was asked for, and its status."""

from __future__ import annotations

from enum import Enum, auto
from typing import Final, NamedTuple, Protocol

from gantryctl.image import Direction
from gantryctl.program.alarms.log import Refusal
from gantryctl.program.axis.states import AxisState


class CommandStatus(Enum):
    """Status of a command.

    WAITING: accepted; the brake opens first, or the motion before ends first. ABORTED: another command, a stop or
    power-off took over. ERROR: refused, or ended by an alarm; `refusal` has the reason.
    """

    WAITING = auto()
    ACTIVE = auto()
    DONE = auto()
    ABORTED = auto()
    ERROR = auto()


class Goal(Enum):
    """What the value of an aim is."""

    ANGLE = auto()
    """An angle of the axis."""
    WAY = auto()
    """A way from the set-point."""
    WAY_ON = auto()
    """A way on from the target of the motion under way; without one, from the set-point."""
    SPEED = auto()
    """A speed, its sign the direction, without an end."""


class Aim(NamedTuple):
    """Where a motion goes, as it was asked for.

    Attributes:
        value: rad, or rad/s for a speed.
        direction: way of a modulo axis to an angle.
    """

    goal: Goal
    value: float
    direction: Direction | None = None


class Dynamics(NamedTuple):
    """Ramps of one motion, each at most that of the machine; None is that of the machine."""

    acc_rad_s2: float | None = None
    dec_rad_s2: float | None = None
    jerk_rad_s3: float | None = None


MACHINE_DYNAMICS: Final = Dynamics()


class Follower(Protocol):
    """Whoever shows the status of a command.

    Attributes:
        attention: there is something new to show.
    """

    attention: bool


class MotionCommand:
    """One command and its status. A block keeps it; the axis changes the status.

    Attributes:
        aim: where it goes; None for a command that comes to rest, or moves nothing.
        target_rad: where the set-point will come to rest: from the aim, when the command begins.
        dynamics: ramps below the machine's.
        settles: done only when the axis is in position, not when the set-point has arrived.
        endless: a motion with a speed only; it ends at the end of the travel or by a stop.
        held: it lasts while a key is held; nothing waits behind it.
        refusal: the reason of an error, or of an end at the travel limit.
        follower: gets `attention` when the status changes.
    """

    __slots__ = (
        "_status", "aim", "dynamics", "endless", "follower", "held", "refusal", "settles", "speed_rad_s", "state",
        "target_rad",
    )  # fmt: skip

    def __init__(
        self,
        state: AxisState,
        aim: Aim | None = None,
        speed_rad_s: float = 0.0,
        dynamics: Dynamics = MACHINE_DYNAMICS,
        *,
        held: bool = False,
    ) -> None:
        self.state, self.aim, self.speed_rad_s, self.dynamics = state, aim, speed_rad_s, dynamics
        self.endless = aim is not None and aim.goal is Goal.SPEED
        self.settles = aim is not None and not self.endless
        self.held = held
        self.target_rad = 0.0
        self._status = CommandStatus.ACTIVE
        self.refusal: Refusal | None = None
        self.follower: Follower | None = None

    @property
    def status(self) -> CommandStatus:
        """Where it is between accepted and ended."""
        return self._status

    @status.setter
    def status(self, status: CommandStatus) -> None:
        self._status = status
        if self.follower is not None:
            self.follower.attention = True

    @property
    def alive(self) -> bool:
        """Waiting or active."""
        return self.status in (CommandStatus.WAITING, CommandStatus.ACTIVE)

    def fail(self, reason: Refusal) -> MotionCommand:
        """End it with an error."""
        self.status, self.refusal = CommandStatus.ERROR, reason
        return self
