"""What both ways of the power sequence share: phase, outputs, counters."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.image import DriveRequest, DriveState
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.feedback import Feedback
from gantryctl.program.power.brake_test import BrakeTestLaw, BrakeTestResult
from gantryctl.program.power.phases import OUTPUTS, PowerPhase, Proof
from gantryctl.program.settings import AxisSettings
from gantryctl.units import rad

REST_RAD_S: Final = rad(0.02)
"""Slower than this is at rest, at the motor side."""
_REST_S: Final = 0.050


class PowerState:
    """The data of `PowerSequence`; its attributes are explained there."""

    __slots__ = (
        "_alarms", "_close_scans", "_count", "_drive_owns_brake", "_feedback", "_feedback_scans",
        "_learn", "_load_nm", "_open_scans", "_over_envelope", "_parking", "_period_s", "_pos_hold",
        "_pos_rad", "_power_up_scans", "_preload_nm", "_proof_nm", "_proof_scans", "_quick_dec",
        "_rest_count", "_rest_scans", "_sag_scans", "_settings", "_settle_scans", "_slip_scans",
        "_step_scans", "_unloaded", "_vel_start", "brake_open", "brake_test", "brake_test_result", "brake_tests",
        "fault_reset", "holding_torque_nm", "phase", "proof", "request", "status", "testing", "torque_ff_nm",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings, feedback: Feedback, alarms: AlarmLog) -> None:
        power = settings.power
        self._settings = power
        self._feedback = feedback
        self._alarms = alarms
        self._period_s = settings.period_s
        self._quick_dec = settings.ramps.quick_dec_rad_s2
        self._power_up_scans = settings.scans(power.power_up_time_s)
        self._proof_scans = settings.scans(power.proof_time_s)
        self._settle_scans = settings.scans(power.settle_time_s)
        self._open_scans = settings.scans(power.brake_open_time_s)
        self._close_scans = settings.scans(power.brake_close_time_s)
        self._feedback_scans = settings.scans(power.brake_feedback_time_s)
        self._sag_scans = settings.scans(power.sag_watch_s)
        self._step_scans = settings.scans(power.unload_step_s)
        self._slip_scans = settings.scans(power.slip_watch_s)
        self._rest_scans = settings.scans(_REST_S)
        self._learn = min(1.0, settings.period_s / power.learn_time_s)
        self.phase = PowerPhase.OFF
        self.status = False
        self.proof = Proof.NOT_DONE
        self.holding_torque_nm = power.holding_torque_nm
        self.fault_reset = False
        self.request = DriveRequest.DISABLE
        self.brake_open = False
        self.torque_ff_nm = 0.0
        self._parking = self._unloaded = self._drive_owns_brake = False
        self._count = self._rest_count = self._over_envelope = 0
        self._pos_rad: float | None = None
        self._pos_hold: float | None = None
        self._load_nm = self._preload_nm = self._proof_nm = self._vel_start = 0.0
        self.brake_test = BrakeTestLaw(
            power.test_torque_nm, power.sag_max_rad, power.torque_max_nm, settings.period_s
        )
        self.brake_test_result: BrakeTestResult | None = None
        self.brake_tests = 0
        self.testing = False

    def _enter(self, phase: PowerPhase) -> None:
        """Change the phase; outputs follow from it."""
        if phase is not PowerPhase.SAG_WATCH:  # the sag counts from the release command
            self._pos_hold = self._pos_rad
        self._unloaded = self.phase is PowerPhase.DISABLING and self._unloaded
        self.phase = phase
        self._count = self._rest_count = self._over_envelope = 0
        self._vel_start = abs(self._feedback.vel_rad_s)
        request, self.brake_open = OUTPUTS[phase]
        if request is not None:
            self.request = request
        elif phase is PowerPhase.HOLDING and self.request is DriveRequest.DISABLE:
            self.request = DriveRequest.ENABLE
        if self.request is DriveRequest.DISABLE:
            self.torque_ff_nm = 0.0

    def _moved(self, pos_rad: float) -> float:
        """How far the axis has moved since this phase began (or since the position was set anew)."""
        if self._pos_hold is None:
            self._pos_hold = pos_rad
        return abs(pos_rad - self._pos_hold)

    def _at_rest(self) -> bool:
        """Slow for long enough."""
        slow = -REST_RAD_S < self._feedback.vel_rad_s < REST_RAD_S
        self._rest_count = self._feedback.lasting(self._rest_count) if slow else 0
        return self._rest_count >= self._rest_scans

    def _milliseconds(self, scans: int) -> float:
        return scans * self._period_s * 1e3

    def _limited(self, torque_nm: float) -> float:
        """Within the motor's torque; 0 for what is no number."""
        limit = self._settings.torque_max_nm
        if -limit <= torque_nm <= limit:
            return torque_nm
        return math.copysign(limit, torque_nm) if not math.isnan(torque_nm) else 0.0


STATE_WORDS: Final = {
    DriveState.UNKNOWN: "an unknown state",
    DriveState.NOT_READY_TO_SWITCH_ON: "Not ready to switch on",
    DriveState.SWITCH_ON_DISABLED: "Switch on disabled",
    DriveState.READY_TO_SWITCH_ON: "Ready to switch on",
    DriveState.SWITCHED_ON: "Switched on",
    DriveState.OPERATION_ENABLED: "Operation enabled",
    DriveState.QUICK_STOP_ACTIVE: "Quick stop active",
    DriveState.FAULT_REACTION_ACTIVE: "Fault reaction active",
    DriveState.FAULT: "Fault",
}
"""Drive states as a person reads them."""
