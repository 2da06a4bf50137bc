"""Interlocks of every phase: emergency stop, mains, limit switches, drive faults."""

from __future__ import annotations

from typing import Final

from gantryctl.image import DigitalInputs
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import FAULTS, Feedback
from gantryctl.program.settings import AxisSettings

# Faults with a row of their own (fault catalogue D10, E8, E10): DC link overvoltage; the drive missed its commands, or
# the controller's heartbeat.
_FAULT_CODES: Final = {0x3210: Code.DRV_10, 0x8250: Code.CAN_05, 0x8130: Code.CAN_05}


class Interlocks:
    """Checks inputs, drive faults and warnings once a scan; each acts on the first scan that shows it.

    A limit switch stops the axis when it opens. It may stay open after a reset, or be open from the start: then only
    the way back inward is open until it has closed again.

    Attributes:
        plus_open, minus_open: the way forward or back is open (its limit switch is closed).
        permitted: the room permits motion, or has no such input.
    """

    __slots__ = (
        "_alarms", "_code_known", "_feedback", "_inputs", "_some_open", "_was_minus", "_was_plus",
        "minus_open", "permitted", "plus_open",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings, feedback: Feedback, alarms: AlarmLog) -> None:
        self._feedback = feedback
        self._alarms = alarms
        self._inputs: DigitalInputs | None = None
        self._code_known = self._some_open = False
        self._was_plus = self._was_minus = True
        self.plus_open = self.minus_open = self.permitted = True

    def scan(self, pos_rad: float, powered: bool) -> bool:
        """Check the inputs, the state of the drive and its warnings.

        Returns:
            Whether an input is open or has changed.
        """
        feedback = self._feedback
        inputs = feedback.inputs
        # The same object as in the scan before, unless something has changed.
        to_check = self._some_open or inputs is not self._inputs
        if to_check:
            self._check_inputs(inputs, pos_rad, powered)
        if feedback.state in FAULTS:
            self._fault()
        elif self._code_known:
            self._code_known = False
        if feedback.warning:
            self._alarms.raise_(Code.DRV_02)
        return to_check

    def _check_inputs(self, inputs: DigitalInputs, pos_rad: float, powered: bool) -> None:
        # One switch open in the first scan is an axis that stands at it. Both are a broken common wire: LIM-04.
        if self._inputs is None and (inputs.limit_plus_ok or inputs.limit_minus_ok):
            self._was_plus, self._was_minus = inputs.limit_plus_ok, inputs.limit_minus_ok
        self._inputs, self._some_open = inputs, False in inputs
        self.permitted = inputs.motion_permit is not False
        # No filter: a hard-wired input acts on the first scan.
        if not inputs.estop_closed:
            self._alarms.raise_(Code.INT_03, measured=self._feedback.where(pos_rad))
        if powered and not inputs.mains_ready:
            self._alarms.raise_(Code.PWR_01, measured=self._feedback.where_moving(pos_rad))
        self.plus_open, self.minus_open = inputs.limit_plus_ok, inputs.limit_minus_ok
        opened_plus = self._was_plus and not self.plus_open
        opened_minus = self._was_minus and not self.minus_open
        self._was_plus, self._was_minus = self.plus_open, self.minus_open
        if (opened_plus or opened_minus) and not (self.plus_open or self.minus_open):
            self._alarms.raise_(Code.LIM_04, measured=self._feedback.where(pos_rad))
        elif opened_plus or opened_minus:
            side = Words.PLUS if opened_plus else Words.MINUS
            self._alarms.raise_(Code.LIM_03, measured=self._feedback.where(pos_rad), side=side)

    def _fault(self) -> None:
        code = self._feedback.error_code
        error = self._feedback.error_words
        active = self._alarms.active
        if Code.DRV_01 not in active:
            # A code that the drive has withdrawn adds nothing to the alarm that it made.
            if code or not any(row in active for row in _FAULT_CODES.values()):
                self._alarms.raise_(_FAULT_CODES.get(code, Code.DRV_01), measured=error)
        # Some drives show their error code some scans after the fault.
        elif code and not self._code_known:
            self._alarms.complete(Code.DRV_01, measured=error)
        self._code_known = code != 0
