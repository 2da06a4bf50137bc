"""The brake test within the power sequence: enabled behind a brake that stays closed, and off again."""

from __future__ import annotations

from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.power.brake_test import BrakeTestOutcome, BrakeTestPhase
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.power_down import WayDown

_ABORTED = BrakeTestOutcome.ABORTED


class BrakeTesting(WayDown):
    """Begin, step and end of a brake test. The drive is disabled afterwards: the brake never opens on the way."""

    __slots__ = ()

    def begin_test(self) -> None:
        """Only from OFF, and where `untestable` is empty."""
        if self.phase is PowerPhase.OFF:
            self.testing = True
            self.brake_test.prepare(self._limited(self.holding_torque_nm))
            self._enter(PowerPhase.ENABLING)

    def abort_test(self, why: str) -> None:
        """Torque back to the preload, off, drive disabled."""
        if not self.testing:
            return
        self.brake_test.end(_ABORTED, why)
        if self.phase is PowerPhase.ENABLING:
            self._enter(PowerPhase.DISABLING)

    @property
    def test_phase(self) -> BrakeTestPhase:
        """Where the test is, with enabling and disabling."""
        if not self.testing:
            return BrakeTestPhase.IDLE
        if self.phase is PowerPhase.TESTING:
            return self.brake_test.phase
        return BrakeTestPhase.ENABLING if self.phase is PowerPhase.ENABLING else BrakeTestPhase.DISABLING

    def _test_enabled(self) -> None:
        """Operation enabled: begin, unless the drive has opened the brake."""
        if self._feedback.brake_open:
            self.brake_test.end(_ABORTED, "the drive opened its brake when it was enabled: not testable here")
            self._enter(PowerPhase.DISABLING)
        else:
            self.brake_test.begin()
            self._enter(PowerPhase.TESTING)

    def _test_step(self, pos_rad: float) -> None:
        law, feedback = self.brake_test, self._feedback
        if feedback.brake_open:
            law.end(BrakeTestOutcome.FAILED, "the brake's contact says that it is open")
        self.torque_ff_nm = self._limited(law.scan(feedback.torque_nm, pos_rad, feedback.periods))
        if not law.running:
            self._preload_nm = self.torque_ff_nm
            self._unload()

    def _test_stopped(self, reaction: Reaction) -> None:
        """An alarm takes over: it decides what becomes of torque and drive."""
        if reaction is Reaction.HOLD and self.brake_test.outcome is BrakeTestOutcome.PASSED:
            self.brake_test.outcome = BrakeTestOutcome.FAILED
            self.brake_test.text = "the brake slipped when the torque was taken off after the test"
        first = self._alarms.first_out
        self.brake_test.end(_ABORTED, "ended by an alarm" if first is None else f"ended by {first.code}")
        self._end_test()

    def _end_test(self) -> None:
        """Result and what follows: a failed brake lets nothing move until a test passes, or service resets."""
        self.testing = False
        self.brake_test.drop()
        result = self.brake_test_result = self.brake_test.result
        self.brake_tests += 1
        if result.outcome is BrakeTestOutcome.FAILED:
            self._alarms.raise_(Code.BRK_08, measured=result.text)
        elif result.outcome is BrakeTestOutcome.PASSED:
            self._alarms.active.pop(Code.BRK_08, None)
