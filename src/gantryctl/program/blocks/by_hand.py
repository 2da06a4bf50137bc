"""Jog and Inch. Vendor blocks, as in TwinCAT and CODESYS: they are not part of PLCopen Part 1."""

from __future__ import annotations

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.motion_command import CommandStatus, MotionCommand
from gantryctl.program.blocks.base import ExecuteBlock
from gantryctl.units import deg


class Jog(ExecuteBlock):
    """Vendor block (not PLCopen Part 1): hold-to-run with a key for each direction.

    Moves while exactly one key is TRUE. Released, or both pressed: the jog-release ramp; after both, both
    must be released before the next start. A key starts on its rising edge: from standstill either way,
    while the axis still comes to rest the same way only. At the end of the travel it comes to rest by
    itself (`at_limit`).
    """

    __slots__ = ("_backward", "_direction", "_forward", "_released", "_speed", "at_limit")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self._forward = self._backward = False
        self._released = True
        self._direction = 0
        self._speed = 0.0
        self.at_limit = False

    def __call__(self, *, forward: bool, backward: bool, velocity_rad_s: float) -> None:
        if forward != self._forward or backward != self._backward:
            self._keys(forward, backward, velocity_rad_s)
            self._forward, self._backward = forward, backward
        # A speed that changes while the key is held is taken on the way.
        elif self.command is not None and not self._released and velocity_rad_s != self._speed:
            self._change_speed(self.command, velocity_rad_s)
        self._show(forward or backward)

    def _keys(self, forward: bool, backward: bool, velocity_rad_s: float) -> None:
        """Release what runs, then begin when a key was pressed alone."""
        command = self.command
        if command is not None and not self._released:
            self._released = True
            self.axis.motion.release(command)
        # Of two keys, the one that stays when the other is released begins nothing.
        if forward != backward and (not self._forward if forward else not self._backward):
            self._start(1 if forward else -1, velocity_rad_s)

    def _start(self, direction: int, velocity_rad_s: float) -> None:
        axis = self.axis
        still_moving = self.command is not None and self.command.alive
        # Judged here, because the keys give the sign: a negative speed is not the other direction.
        refused = axis.motion.check_speed(velocity_rad_s)
        if still_moving and direction != self._direction:
            refused = refusal(Code.CTL_14, reason=Words.REVERSAL_FROM_REST)
        elif not still_moving and axis.motion.current is not None:
            refused = refusal(Code.CTL_14, reason=Words.JOG_FROM_REST)
        if self._accepted(refused):
            self.at_limit = False
            self._direction, self._speed, self._released = direction, velocity_rad_s, False
            self._begin(axis.motion.move_velocity(direction * velocity_rad_s, held=True))

    def _end(self, command: MotionCommand) -> None:
        self.at_limit = command.status is CommandStatus.DONE and command.refusal is not None
        super()._end(command)

    def _change_speed(self, command: MotionCommand, velocity_rad_s: float) -> None:
        self._speed = velocity_rad_s
        refused = self.axis.motion.change_speed(command, velocity_rad_s)
        if refused is not None:
            self.axis.report_refusal(refused)


class Inch(ExecuteBlock):
    """Vendor block (not PLCopen Part 1): one rising edge of a key moves one increment, to its end.

    From the set-point, the direction by the key. While the axis moves a key is refused, not queued; an
    increment past the travel is refused whole.
    """

    __slots__ = ("_backward", "_forward")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self._forward = self._backward = False

    def __call__(self, *, forward: bool, backward: bool, distance_rad: float, velocity_rad_s: float) -> None:
        if (forward and not self._forward) or (backward and not self._backward):
            self._step(forward, backward, distance_rad, velocity_rad_s)
        self._forward, self._backward = forward, backward
        self._show(forward or backward)

    def _step(self, forward: bool, backward: bool, distance_rad: float, velocity_rad_s: float) -> None:
        axis = self.axis
        travel = axis.settings.travel
        length = travel.pos_max_rad - travel.pos_min_rad
        if forward and backward:
            self._accepted(refusal(Code.CTL_14, reason=Words.BOTH_KEYS))
        # Not queued: a key must not act later than it was pressed.
        elif axis.motion.current is not None:
            self._accepted(refusal(Code.CTL_14, reason=Words.INCREMENT_FROM_REST))
        # A whole increment or none: a shortened one would end at an unexpected angle.
        elif not 0.0 < distance_rad <= length:
            allowed = Words.ABOVE_ZERO if travel.endless else Words.AT_MOST_ANGLE(high=deg(length))
            measured = Words.ANGLE(value=deg(distance_rad))
            self._accepted(
                refusal(Code.CTL_01, name=Words.NAME_INCREMENT, allowed=allowed, measured=measured)
            )
        else:
            way = distance_rad if forward else -distance_rad
            self._begin(axis.motion.move_relative(way, velocity_rad_s))
