"""PLCopen motion blocks: MoveAbsolute, MoveRelative, MoveAdditive, MoveVelocity, Halt, Stop, Home.

The ramps are the machine's, or lower ones for one motion: a block raises none. Buffer mode Aborting, or Buffered
where a block has the input.
"""

from __future__ import annotations

from gantryctl.image import BufferMode, Direction
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.motion_command import CommandStatus, Dynamics, MotionCommand
from gantryctl.program.blocks.base import ExecuteBlock


class MoveAbsolute(ExecuteBlock):
    """Move to an angle; `done` when the axis is in position there.

    `direction` is for a modulo axis, whose way is the shortest one unless it is given; a linear axis refuses it.
    """

    __slots__ = ()

    def __call__(
        self,
        *,
        execute: bool,
        position_rad: float,
        velocity_rad_s: float,
        acceleration_rad_s2: float | None = None,
        deceleration_rad_s2: float | None = None,
        jerk_rad_s3: float | None = None,
        direction: Direction | None = None,
        buffer_mode: BufferMode = BufferMode.ABORTING,
    ) -> None:
        if execute and not self._execute:
            dynamics = Dynamics(acceleration_rad_s2, deceleration_rad_s2, jerk_rad_s3)
            move = self.axis.motion.move_absolute
            self._begin(move(position_rad, velocity_rad_s, direction, dynamics, buffer_mode))
        self._show(execute)


class MoveRelative(ExecuteBlock):
    """Move by an angle from the set-point; `done` when the axis is in position there."""

    __slots__ = ()

    def __call__(
        self,
        *,
        execute: bool,
        distance_rad: float,
        velocity_rad_s: float,
        acceleration_rad_s2: float | None = None,
        deceleration_rad_s2: float | None = None,
        jerk_rad_s3: float | None = None,
        buffer_mode: BufferMode = BufferMode.ABORTING,
    ) -> None:
        if execute and not self._execute:
            dynamics = Dynamics(acceleration_rad_s2, deceleration_rad_s2, jerk_rad_s3)
            move = self.axis.motion.move_relative
            self._begin(move(distance_rad, velocity_rad_s, dynamics, buffer_mode))
        self._show(execute)


class MoveAdditive(ExecuteBlock):
    """Move by an angle on from the target of the motion under way; without one, from the set-point."""

    __slots__ = ()

    def __call__(
        self,
        *,
        execute: bool,
        distance_rad: float,
        velocity_rad_s: float,
        acceleration_rad_s2: float | None = None,
        deceleration_rad_s2: float | None = None,
        jerk_rad_s3: float | None = None,
        buffer_mode: BufferMode = BufferMode.ABORTING,
    ) -> None:
        if execute and not self._execute:
            dynamics = Dynamics(acceleration_rad_s2, deceleration_rad_s2, jerk_rad_s3)
            move = self.axis.motion.move_additive
            self._begin(move(distance_rad, velocity_rad_s, dynamics, buffer_mode))
        self._show(execute)


class MoveVelocity(ExecuteBlock):
    """Move with a speed, its sign the direction, until another block takes over.

    At the end of the travel it comes to rest by itself, with error LIM-01; a modulo axis turns on. `done` stays FALSE;
    `in_velocity` is TRUE while the set-point has the speed asked for (times override).
    """

    __slots__ = ("in_velocity",)

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.in_velocity = False

    def __call__(
        self,
        *,
        execute: bool,
        velocity_rad_s: float,
        acceleration_rad_s2: float | None = None,
        deceleration_rad_s2: float | None = None,
        jerk_rad_s3: float | None = None,
        buffer_mode: BufferMode = BufferMode.ABORTING,
    ) -> None:
        motion = self.axis.motion
        if execute and not self._execute:
            dynamics = Dynamics(acceleration_rad_s2, deceleration_rad_s2, jerk_rad_s3)
            self._begin(motion.move_velocity(velocity_rad_s, dynamics, buffer_mode))
        self._show(execute)
        command = self.command
        self.in_velocity = self.active and command is not None and motion.in_velocity(command)
        self.attention = self.attention or self.busy

    def _end(self, command: MotionCommand) -> None:
        # A motion without end has ended at the limit of the travel: that is an error of this block (LIM-01).
        if command.status is CommandStatus.DONE and command.refusal is not None:
            command.fail(command.refusal)
        super()._end(command)


class Halt(ExecuteBlock):
    """Come to rest on the normal ramp; another motion may take over before. A harder stop is not made weaker."""

    __slots__ = ()

    def __call__(self, *, execute: bool) -> None:
        if execute and not self._execute:
            self._begin(self.axis.motion.halt())
        self._show(execute)


class Stop(ExecuteBlock):
    """Come to rest on the jog-release ramp; Stopping, and no other motion, while Execute is TRUE.

    A brake test under way ends, with the drive disabled.
    """

    __slots__ = ("_held",)

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self._held: MotionCommand | None = None

    def __call__(self, *, execute: bool) -> None:
        if execute and not self._execute:
            self._held = self.axis.stop()
            self._begin(self._held)
        elif not execute and self._held is not None:
            self.axis.motion.release_stop(self._held)
            self._held = None
        self._show(execute)


class Home(ExecuteBlock):
    """Call the present angle `position_rad`: the direct form of homing only. Nothing moves.

    Only in Standstill; refused where the encoder would wrap near the travel. The new `axis.zero_counts` is
    for retained memory.
    """

    __slots__ = ()

    def __call__(self, *, execute: bool, position_rad: float) -> None:
        if execute and not self._execute:
            self._begin(self.axis.home(position_rad))
        self._show(execute)
