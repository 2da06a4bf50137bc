"""The vendor block BrakeTest (not PLCopen Part 1)."""

from __future__ import annotations

import math

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.axis.axis import Axis
from gantryctl.program.blocks.base import Block
from gantryctl.program.power.brake_test import BrakeTestOutcome, BrakeTestPhase


class BrakeTest(Block):
    """Test torque both ways against the closed brake, on the rising edge of Execute; power must be off.

    The drive is enabled, the brake stays closed, and afterwards the drive is off again. `busy` until then; then one of
    `done` (passed), `error` (failed: BRK-08, or refused), `command_aborted`, while Execute stays TRUE and for
    at least one scan. Stop, power off and every alarm of a stop class end it.

    Attributes:
        phase: phase of the test.
        plus_nm, minus_nm, moved_rad: see `BrakeTestResult`.
    """

    __slots__ = (
        "_execute", "_final", "_tests", "busy", "command_aborted", "done", "minus_nm", "moved_rad", "phase", "plus_nm",
    )  # fmt: skip

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self._execute = self._final = False
        self._tests = 0
        self.done = self.busy = self.command_aborted = False
        self.phase = BrakeTestPhase.IDLE
        self.plus_nm = self.minus_nm = math.nan
        self.moved_rad = 0.0

    @property
    def attention(self) -> bool:
        """The outputs may change although the inputs do not."""
        return self.busy or (self._final and not self._execute)

    def __call__(self, *, execute: bool) -> None:
        if execute and not self._execute and not self.busy:
            self._begin()
        elif self._final and not execute:
            self._clear()
        self._execute = execute
        if self.busy:
            self._show()

    def _begin(self) -> None:
        self._clear()
        self.busy = self._accepted(self.axis.begin_brake_test())
        self._final = not self.busy
        self._tests = self.axis.brake_test.count

    def _show(self) -> None:
        test = self.axis.brake_test
        self.phase = test.phase
        self.plus_nm, self.minus_nm, self.moved_rad = test.plus_nm, test.minus_nm, test.moved_rad
        if test.count == self._tests:
            return
        self.busy, self._final = False, True
        outcome = test.outcome
        self.done = outcome is BrakeTestOutcome.PASSED
        self.command_aborted = outcome is BrakeTestOutcome.ABORTED
        if outcome is BrakeTestOutcome.FAILED:
            self._fail(refusal(Code.BRK_08, measured=test.words))

    def _clear(self) -> None:
        self.done = self.busy = self.command_aborted = self._final = False
        self._fail(None)
