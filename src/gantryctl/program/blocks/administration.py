"""PLCopen administrative blocks (Power, Reset, SetOverride, SetPosition) and the vendor block BrakeTest."""

from __future__ import annotations

import math

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.axis.axis import Axis
from gantryctl.program.blocks.base import Block
from gantryctl.program.power.brake_test import BrakeTestOutcome, BrakeTestPhase


class Power(Block):
    """Power on while Enable is TRUE: drive enable, torque proof, brake; and the same back.

    `status` is TRUE when the axis follows commands (also while the brake holds it at standstill, hold =
    brake). After an alarm or a refusal, Enable must become FALSE and TRUE again: nothing switches on by
    itself.
    """

    __slots__ = ("_enable", "_on", "status")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.status = False
        self._enable = self._on = False

    @property
    def attention(self) -> bool:
        """The outputs may change although the input does not; else a program may leave out the call."""
        axis = self.axis
        return axis.power.status is not self.status or axis.alarms.first_out is not None

    def __call__(self, *, enable: bool) -> None:
        axis = self.axis
        if enable != self._enable:
            self._enable = enable
            self._fail(None)
            self._on = enable and self._accepted(axis.power_on())
            if not enable:
                axis.power_off()
        self.status = axis.power.status
        if self._on and (first := axis.alarms.first_out) is not None:
            # Enable must fall and rise again: nothing switches on by itself after a reset.
            self._on = False
            self._fail(first.refusal)


class Reset(Block):
    """Clear alarms whose cause is gone, drive faults too. Never enables, never shortens a stop.

    From ErrorStop to Disabled when power is off. `service` TRUE: the caller has the service role and may
    clear locked alarms, which also takes the present angle as valid.
    """

    __slots__ = ("_execute", "busy", "done")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.done = self.busy = False
        self._execute = False

    def __call__(self, *, execute: bool, service: bool = False) -> None:
        if execute and not self._execute:
            self.done = False
            self.busy = self._accepted(self.axis.reset(service=service)) or self.busy
        elif not execute and not self.busy:
            self.done = False
            self._fail(None)
        self._execute = execute
        recovery = self.axis.recovery
        if self.busy and not recovery.resetting:
            self.busy = False
            self.done = self._accepted(recovery.failure)


class SetOverride(Block):
    """Speed override 0..1, for the motion under way and all later ones. 0 stops; it goes on when raised."""

    __slots__ = ("_asked", "enabled")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.enabled = False
        self._asked = axis.virtual.override

    def __call__(self, *, enable: bool = True, override: float) -> None:
        self.enabled = enable
        # NaN is not equal to itself: without the second test it would be refused in every scan.
        if not enable or override == self._asked or (math.isnan(override) and math.isnan(self._asked)):
            return
        self._asked = override
        self._accepted(self.axis.set_override(override))


class SetPosition(Block):
    """Call the present angle `position_rad`. Nothing moves.

    Only at standstill or disabled; refused outside the travel and where the encoder would wrap near it. The
    new `axis.zero_counts` is for retained memory.
    """

    __slots__ = ("_execute", "done")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.done = False
        self._execute = False

    def __call__(self, *, execute: bool, position_rad: float) -> None:
        if execute != self._execute:
            self._execute = execute
            self._fail(None)
            self.done = execute and self._accepted(self.axis.set_position(position_rad))


class BrakeTest(Block):
    """Test torque both ways against the closed brake, on the rising edge of Execute; power must be off.

    The drive is enabled, the brake stays closed, and afterwards the drive is off again. `busy` until then; then one of
    `done` (passed), `error` (failed: BRK-08, or refused), `command_aborted`, while Execute stays TRUE and for
    at least one scan. Stop, power off and every alarm of a stop class end it.

    Attributes:
        attention: the outputs may change although the inputs do not; else a program may leave out the call.
        phase: phase of the test.
        plus_nm, minus_nm, moved_rad: see `BrakeTestResult`.
    """

    __slots__ = (
        "_execute", "_final", "_tests", "attention", "busy", "command_aborted", "done", "minus_nm", "moved_rad",
        "phase", "plus_nm",
    )  # fmt: skip

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self._execute = self._final = False
        self._tests = 0
        self.attention = self.done = self.busy = self.command_aborted = False
        self.phase = BrakeTestPhase.IDLE
        self.plus_nm = self.minus_nm = math.nan
        self.moved_rad = 0.0

    def __call__(self, *, execute: bool) -> None:
        if execute and not self._execute and not self.busy:
            self._begin()
        elif self._final and not execute:
            self._clear()
        self._execute = execute
        if self.busy:
            self._show()
        self.attention = self.busy or (self._final and not execute)

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
