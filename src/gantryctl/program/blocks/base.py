"""PLCopen Part 1: the rules for Execute and the outputs, for all blocks."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.motion_command import CommandStatus, MotionCommand

# Looked up once: an attribute of an enumeration costs 90 ns in Python 3.11.
_ACTIVE: Final = CommandStatus.ACTIVE


class Block:
    """A function block on one axis, called once per scan.

    Attributes:
        error: the last call was refused, or failed on the way.
        error_id: code of the alarm or refusal, None without an error.
        error_text: the reason in words.
    """

    __slots__ = ("axis", "error", "error_id", "error_text")

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.error = False
        self.error_id: Code | None = None
        self.error_text = ""

    def _fail(self, reason: Refusal | None) -> None:
        self.error = reason is not None
        self.error_id, self.error_text = (None, "") if reason is None else (reason.code, reason.text)

    def _accepted(self, refused: Refusal | None) -> bool:
        """Show a refusal at once; True when there is none."""
        self._fail(refused)
        if refused is not None:
            self.axis.report_refusal(refused)
        return refused is None


class ExecuteBlock(Block):
    """A block that begins on the rising edge of Execute.

    Inputs count at that edge only. `busy` until the command has ended, `active` while it has the axis; then
    exactly one of `done`, `command_aborted`, `error`, for as long as Execute stays TRUE, and for at least one
    scan. A falling edge of Execute does not end the motion.

    Attributes:
        attention: the outputs change although the inputs do not; else a program may leave out the call.
        command: the command under way, or None.
    """

    __slots__ = ("_execute", "_final", "active", "attention", "busy", "command", "command_aborted", "done")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.attention = False
        self.done = self.busy = self.active = self.command_aborted = False
        self._execute = self._final = False
        self.command: MotionCommand | None = None

    def _begin(self, command: MotionCommand) -> None:
        """Follow `command` from now on."""
        self._clear()
        self.command, command.follower = command, self
        if command.status is CommandStatus.ERROR and command.refusal is not None:
            self.axis.report_refusal(command.refusal)

    def _show(self, execute: bool) -> None:
        """Set the outputs of this scan; every call ends with this."""
        self._execute = execute
        command = self.command
        # PLCopen Part 1: the end of a command shows for at least one scan, also when Execute fell before.
        if command is None:
            if self._final and not execute:
                self._clear()
            self.attention = False
            return
        status = command.status
        self.active = status is _ACTIVE
        self.busy = self.active or status is CommandStatus.WAITING
        if not self.busy:
            self._end(command)
        # A command under way tells when its status changes.
        self.attention = not (self.busy or execute)

    def _end(self, command: MotionCommand) -> None:
        self.done = command.status is CommandStatus.DONE
        self.command_aborted = command.status is CommandStatus.ABORTED
        if command.status is CommandStatus.ERROR:
            self._fail(command.refusal)
        self.command = None
        self._final = True

    def _clear(self) -> None:
        self.done = self.busy = self.active = self.command_aborted = self._final = False
        self._fail(None)
