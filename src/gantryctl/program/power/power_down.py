"""The way down and the stops: close the brake, take the torque off, watch that nothing slips."""

from __future__ import annotations

from typing import Final

from gantryctl.image import DriveRequest, DriveState
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.power_state import STATE_WORDS, PowerState
from gantryctl.units import deg, rad

_ENABLED: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
_ABLE: Final = (
    *_ENABLED,
    DriveState.SWITCH_ON_DISABLED,
    DriveState.READY_TO_SWITCH_ON,
    DriveState.SWITCHED_ON,
)
_FAULTS: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
_ENVELOPE_RAD_S: Final = rad(0.5)
"""A quick stop may be this much faster than its ramp."""
_ENVELOPE_REACTION_S: Final = 0.060
_ENVELOPE_S: Final = 0.050
_STOP_TIME_S: Final = 3.0
"""A brake stop from the highest speed takes 0.9 s."""
_BLIND_STOP_S: Final = 1.5
"""Without a valid position the end of a brake stop is judged by time."""


class WayDown(PowerState):
    """One method per phase of the way down."""

    __slots__ = ()

    def _off(self, pos_rad: float) -> None:
        """Torque off, brake closed: clear drive faults when asked, watch the brake."""
        self.request = DriveRequest.FAULT_RESET if self.fault_reset else DriveRequest.DISABLE
        moved = self._moved(pos_rad)
        if not moved <= self._settings.sag_max_rad and self._feedback.position_valid:
            late = not self._unloaded or self._count > self._slip_scans
            code = Code.BRK_04 if late else Code.BRK_03
            self._alarms.raise_(code, measured=deg(moved), limit=deg(self._settings.sag_max_rad))
        if self._feedback.brake_open and self._count > self._close_scans + self._feedback_scans:
            self._brake_still_open()

    def _closing(self) -> None:
        """Zero speed is held while the brake closes."""
        if self._drive_owns_brake:  # it closes the brake itself, when it is disabled
            self._enter(PowerPhase.DISABLING)
        elif self._count >= self._close_scans and not self._feedback.brake_open:
            self._unload()
        elif self._count > self._close_scans + self._feedback_scans:
            self._brake_still_open()
            self._unload()  # whether the brake holds is seen there

    def _unload(self) -> None:
        if not self._settings.torque_preload:
            self._enter(PowerPhase.DISABLING)
            return
        self._enter(PowerPhase.UNLOADING)
        self._load_nm = self._feedback.torque_nm

    def _unloading(self, pos_rad: float) -> None:
        """Lower the torque by what the motor still gives, in three steps; a brake that slips gets it back."""
        moved = self._moved(pos_rad)
        if moved > self._settings.sag_max_rad:
            self._alarms.raise_(Code.BRK_03, measured=deg(moved), limit=deg(self._settings.sag_max_rad))
            return
        step = self._count // self._step_scans + 1
        if step <= 3:
            self.torque_ff_nm = self._limited(self._preload_nm - self._load_nm * step / 3.0)
        elif step > 4:
            self._enter(PowerPhase.DISABLING)
            self._unloaded = True

    def _disabling(self) -> None:
        if self._feedback.state not in _ENABLED:
            self._enter(PowerPhase.PARKED if self._parking else PowerPhase.OFF)
        elif self._count > self._power_up_scans:
            self._stuck_enabled()

    def _quick_stopping(self) -> None:
        """The drive ramps down; slower than its ramp allows is not obeying."""
        speed = abs(self._feedback.vel_rad_s)
        elapsed_s = self._count * self._period_s
        ramp = max(0.0, self._vel_start - self._quick_dec * max(0.0, elapsed_s - _ENVELOPE_REACTION_S))
        allowed = ramp + _ENVELOPE_RAD_S
        self._over_envelope = 0 if speed <= allowed else self._feedback.lasting(self._over_envelope)
        overdue = elapsed_s > self._vel_start / self._quick_dec + _STOP_TIME_S
        if self._over_envelope * self._period_s >= _ENVELOPE_S or overdue:
            self._alarms.raise_(Code.DRV_07, measured=deg(speed), limit=deg(allowed))
        elif self._at_rest():
            self._enter(PowerPhase.CLOSING)

    def _torque_off(self) -> None:
        elapsed_s = self._count * self._period_s
        if not self._feedback.position_valid:
            if elapsed_s > _BLIND_STOP_S:
                self._enter(PowerPhase.OFF)
            return
        brake_time_over = self._count > self._close_scans + self._feedback_scans
        if self._at_rest() and (not self._feedback.brake_open or brake_time_over):
            self._enter(PowerPhase.OFF)
        elif elapsed_s > _STOP_TIME_S:
            speed = deg(abs(self._feedback.vel_rad_s))
            self._alarms.raise_(Code.BRK_11, measured=speed, time_s=elapsed_s)

    def _holding(self) -> None:
        """Torque at zero speed; the preload comes back once the drive is enabled."""
        if self._feedback.state in _ENABLED:
            self.torque_ff_nm = self._preload_nm
        elif self._count > self._power_up_scans:
            self._stuck_disabled()

    def _can_hold(self) -> bool:
        """Whether the drive can be asked for torque at zero speed."""
        feedback = self._feedback
        inputs = feedback.inputs
        return inputs.estop_ok and inputs.mains_ready and feedback.position_valid and feedback.state in _ABLE

    def _lost(self) -> None:
        """The drive is not enabled where it must be; a fault of its own is DRV-01, raised by the interlocks."""
        if self._feedback.state in _FAULTS:
            return
        self._alarms.raise_(Code.DRV_04, measured=STATE_WORDS[self._feedback.state])

    def _stuck_enabled(self) -> None:
        self._stuck(STATE_WORDS[DriveState.SWITCH_ON_DISABLED])

    def _stuck_disabled(self) -> None:
        self._stuck(STATE_WORDS[DriveState.OPERATION_ENABLED], Reaction.TORQUE_OFF)

    def _stuck(self, wanted: str, reaction: Reaction | None = None) -> None:
        time_ms = self._milliseconds(self._count)
        state = STATE_WORDS[self._feedback.state]
        self._alarms.raise_(Code.DRV_03, reaction, measured=state, time_ms=time_ms, command=wanted)

    def _brake_still_open(self) -> None:
        time_ms = self._milliseconds(self._count)
        self._alarms.raise_(Code.BRK_06, measured="open", command="closed", time_ms=time_ms)
