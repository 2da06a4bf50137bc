"""The way up: enable, torque proof, release, sag watch."""

from __future__ import annotations

import math

from gantryctl.image import DriveState
from gantryctl.program.alarms.codes import Code
from gantryctl.program.power.phases import PowerPhase, Proof
from gantryctl.program.power.power_state import STATE_WORDS
from gantryctl.program.power.power_test import BrakeTesting
from gantryctl.units import deg


class WayUp(BrakeTesting):
    """One method per phase of the way up."""

    __slots__ = ()

    def _enabling(self) -> None:
        feedback = self._feedback
        if feedback.state is DriveState.OPERATION_ENABLED:
            self._preload_nm = self._limited(self.holding_torque_nm)
            self._drive_owns_brake = feedback.brake_open
            if self.testing:
                self._test_enabled()
            elif feedback.brake_open:
                self.proof = Proof.NOT_POSSIBLE
                self._enter(PowerPhase.SAG_WATCH)
            elif not self._settings.torque_preload:
                self.proof = Proof.NOT_POSSIBLE
                self._enter(PowerPhase.RELEASING)
            else:
                self.proof = Proof.NOT_DONE
                level = max(self._settings.proof_torque_nm, abs(self._preload_nm))
                self._proof_nm = self._limited(math.copysign(level, self._preload_nm))
                self._enter(PowerPhase.PROVING)
                self.torque_ff_nm = self._proof_nm
        elif self._count > self._power_up_scans:
            self._alarms.raise_(
                Code.DRV_03,
                measured=STATE_WORDS[feedback.state],
                time_ms=self._milliseconds(self._count),
                command=STATE_WORDS[DriveState.OPERATION_ENABLED],
            )

    def _proving(self, pos_rad: float) -> None:
        """Torque against the closed brake: the motor must give it, the brake must take it."""
        moved = self._moved(pos_rad)
        if moved > self._settings.sag_max_rad:
            self._alarms.raise_(Code.BRK_03, measured=deg(moved), limit=deg(self._settings.sag_max_rad))
            return
        wanted = self._settings.proof_share * abs(self._proof_nm)
        given = self._feedback.torque_nm * math.copysign(1.0, self._proof_nm)
        if given >= wanted:
            self.proof = Proof.PROVEN
            self._enter(PowerPhase.SETTLING)
        elif self._count > self._proof_scans:
            time_ms = self._milliseconds(self._count)
            self._alarms.raise_(Code.BRK_07, measured=given, limit=wanted, time_ms=time_ms)

    def _settling(self) -> None:
        """From the proof torque to the preload on a ramp, then as long again for it to settle."""
        share = min(1.0, self._count / self._settle_scans)
        self.torque_ff_nm = self._proof_nm + (self._preload_nm - self._proof_nm) * share
        if self._count >= 2 * self._settle_scans:
            self._enter(PowerPhase.RELEASING)

    def _releasing(self, pos_rad: float) -> None:
        if self._sagged(pos_rad):
            return
        limit = self._open_scans + self._feedback_scans
        if self._feedback.brake_open:
            self._enter(PowerPhase.SAG_WATCH)
        elif self._count > limit:
            milliseconds = self._milliseconds
            self._alarms.raise_(Code.BRK_01, time_ms=milliseconds(self._count), limit=milliseconds(limit))

    def _sag_watch(self, pos_rad: float) -> None:
        if not self._sagged(pos_rad) and self._count >= self._sag_scans:
            self.status = True
            self._enter(PowerPhase.ON)

    def _sagged(self, pos_rad: float) -> bool:
        moved = self._moved(pos_rad)
        if moved <= self._settings.sag_max_rad:
            return False
        self._alarms.raise_(Code.BRK_10, measured=deg(moved), limit=deg(self._settings.sag_max_rad))
        return True
