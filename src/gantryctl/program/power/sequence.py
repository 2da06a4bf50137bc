"""The power sequence: from torque off behind a closed brake to a held load, and back."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.image import DriveRequest, DriveState
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import Alarm, AlarmLog
from gantryctl.program.alarms.words import Words, drive_state_words
from gantryctl.program.feedback import ENABLED, FAULTS, Feedback
from gantryctl.program.power.brake_test import BrakeTest, BrakeTestOutcome
from gantryctl.program.power.hold_watch import HoldWatch
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.power.phases import FALLING, OUTPUTS, RISING, TORQUE_ON, PowerPhase, Proof
from gantryctl.program.power.twist import Twist
from gantryctl.program.power.wear import BrakeWear
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg, rad

# Slower than this is at rest, on the motor side: after a stop the load swings on by up to 0.53 deg/s.
REST_RAD_S: Final = rad(0.02)
_REST_S: Final = 0.050
# A brake may catch the shaft for some 60 ms while the load swings on at 2 deg/s and then pulls it through the brake:
# 0.14 deg from 3 deg/s. So a stop by the brake is over after more than half a period of the first mode, near 2 Hz.
_BRAKE_REST_S: Final = 0.300
# The drive's quick-stop ramp is judged with 0.5 deg/s to spare for 50 ms, after the 60 ms in which a drive reacts.
_ENVELOPE_RAD_S: Final = rad(0.5)
_ENVELOPE_REACTION_S: Final = 0.060
_ENVELOPE_S: Final = 0.050
# A brake stop from the highest speed of the reference machine takes 0.9 s on the motor side.
_STOP_TIME_S: Final = 3.0
# Without a valid position the end of a brake stop is judged by time alone.
_BLIND_STOP_S: Final = 1.5
# Beyond the time of the ramp where the speed is not known: reaction of the drive, and the load that swings on.
_BLIND_RAMP_S: Final = 0.25
_UNLOAD_STEPS: Final = 3
# A drive that owns its brake may take the torque off while the brake still closes. The gear then unwinds: 0.020 deg on
# the motor side with 16 kN m and the swing of a quick stop, 0.026 deg with 50 kN m; over after 0.3 s.
_UNWIND_RAD: Final = rad(0.03)
_UNWIND_S: Final = 0.300
# After these nobody gives torque back by itself: the drive does not obey, or another master may command it.
_NO_HOLD_AFTER: Final = frozenset(
    {Code.CAN_12, Code.CAN_14, Code.CTL_05, Code.DRV_05, Code.DRV_07, Code.DRV_13}
)

_OPERATION_ENABLED: Final = DriveState.OPERATION_ENABLED
_ABLE: Final = (
    *ENABLED,
    DriveState.SWITCH_ON_DISABLED,
    DriveState.READY_TO_SWITCH_ON,
    DriveState.SWITCHED_ON,
)
_ON: Final = PowerPhase.ON
_BRAKE_OPENING: Final = (PowerPhase.RELEASING, PowerPhase.SAG_WATCH)
_BRAKE_CLOSING: Final = (PowerPhase.CLOSING, PowerPhase.UNLOADING)


class PowerSequence:
    """Drive enable, torque proof, brake, and the same back, one phase at a time (table in `PowerPhase`).

    The proof: `torque_ff_nm` is raised to the proof torque against the closed brake, and the actual torque
    must follow. Then it goes to the preload, the torque that held the load last time, and the brake opens.
    From there the preload stays as it is while power is on: the drive adds it to its own loop, whose
    integrator carries the difference, so nothing ever steps. Going down, the brake closes first; then
    `torque_ff_nm` is lowered in three steps by what the motor still gives, with a check of the angle after
    each: a brake that slips gets the torque back (HOLD).

    Attributes:
        phase: where the sequence is.
        status: Power.Status: TRUE from ON until it goes down, also while the brake holds at standstill.
        proof: whether torque was proven before the last release.
        request, brake_open, torque_ff_nm: commands to the drive.
        holding: the torque that holds the load.
        wear: stops of a turning axis by its brake.
        brake_test: the brake test, run behind the closed brake from OFF back to OFF.
        fault_reset: ask the drive to clear its fault (Reset); only while off.
    """

    __slots__ = (
        "_alarms",
        "_brake_rest_scans",
        "_close_late_scans",
        "_close_scans",
        "_count",
        "_doubted_moving",
        "_drive_owns_brake",
        "_feedback",
        "_hold_watch",
        "_load_nm",
        "_open_late_scans",
        "_over_envelope",
        "_parking",
        "_period_s",
        "_pos_hold",
        "_pos_rad",
        "_power_up_scans",
        "_proof_scans",
        "_quick_dec",
        "_rest_count",
        "_rest_scans",
        "_sag_scans",
        "_settings",
        "_settle_scans",
        "_slip_scans",
        "_step_scans",
        "_turns_back",
        "_twist",
        "_unloaded",
        "_unwinding",
        "_vel_start",
        "brake_open",
        "brake_test",
        "fault_reset",
        "holding",
        "phase",
        "proof",
        "request",
        "status",
        "torque_ff_nm",
        "wear",
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
        self._close_scans = settings.scans(power.brake_close_time_s)
        feedback_scans = settings.scans(power.brake_feedback_time_s)
        self._close_late_scans = self._close_scans + feedback_scans
        self._open_late_scans = settings.scans(power.brake_open_time_s) + feedback_scans
        self._sag_scans = settings.scans(power.sag_watch_s)
        self._step_scans = settings.scans(power.unload_step_s)
        self._slip_scans = settings.scans(power.slip_watch_s)
        self._rest_scans = settings.scans(_REST_S)
        self._brake_rest_scans = settings.scans(_BRAKE_REST_S)
        self.phase = PowerPhase.OFF
        self.status = False
        self.proof = Proof.NOT_DONE
        self.holding = HoldingTorque(settings)
        self._twist = Twist(settings, feedback)
        self._hold_watch = HoldWatch(settings, feedback, alarms)
        self.brake_test = BrakeTest(
            power.test_torque_nm, power.sag_max_rad, power.torque_max_nm, settings.period_s
        )
        self.wear = BrakeWear(settings, feedback, alarms)
        self.fault_reset = False
        self.request = DriveRequest.DISABLE
        self.brake_open = False
        self.torque_ff_nm = 0.0
        self._parking = self._unloaded = self._unwinding = self._drive_owns_brake = False
        self._turns_back = False
        self._count = self._rest_count = self._over_envelope = self._doubted_moving = 0
        self._pos_rad: float | None = None
        self._pos_hold: float | None = None
        self._load_nm = self._vel_start = 0.0

    # --- asked for by the axis --------------------------------------------------------------------

    def switch_on(self) -> None:
        """Begin the way up; only from OFF."""
        if self.phase is PowerPhase.OFF:
            self._enter(PowerPhase.ENABLING)

    def switch_off(self) -> None:
        """Begin the way down; only at rest."""
        self._parking = False
        self.status = False
        if self._opens_by_drive:
            # Disabled now a drive that owns its brake takes the torque off before it holds: on to the end, then back.
            self._turns_back = True
        elif self.phase is _ON or self.phase in _BRAKE_OPENING:
            self._enter(PowerPhase.CLOSING)
        elif self.phase in RISING:
            self._enter(PowerPhase.DISABLING)
        elif self.phase is PowerPhase.PARKED:
            self._enter(PowerPhase.OFF)

    def park(self) -> None:
        """Let the brake hold; `status` stays TRUE."""
        if self.phase is _ON:
            self._parking = True
            self._enter(PowerPhase.CLOSING)

    def wake(self) -> None:
        """Open the brake again for a motion, through the same proof."""
        if self.phase is PowerPhase.PARKED:
            self._enter(PowerPhase.ENABLING)

    def begin_test(self) -> None:
        """Begin a brake test; only from OFF, and where `untestable` is empty."""
        if self.phase is PowerPhase.OFF:
            self.brake_test.prepare(self.holding.limited(self.holding.mean_nm))
            self._enter(PowerPhase.ENABLING)

    def abort_test(self, why: Words) -> None:
        """End a brake test: torque back to the preload, off, drive disabled."""
        if not self.brake_test.under_way:
            return
        self.brake_test.end(BrakeTestOutcome.ABORTED, why)
        if self.phase is PowerPhase.ENABLING:
            self._enter(PowerPhase.DISABLING)

    def react(self, reaction: Reaction) -> None:
        """Do what an alarm of class QUICK_STOP, TORQUE_OFF or HOLD asks for."""
        self.status = False
        self._parking = False
        if self.brake_test.under_way:
            self._stop_test(reaction)
        # A stop is never made weaker: TORQUE OFF stays, and HOLD yields to TORQUE OFF alone.
        if self.phase is PowerPhase.TORQUE_HOLD and reaction is not Reaction.TORQUE_OFF:
            return
        if self.phase is PowerPhase.TORQUE_OFF:
            self._alarms.torque_not_kept()
            return
        if reaction is Reaction.HOLD and self._can_hold():
            self._enter(PowerPhase.TORQUE_HOLD)
            return
        self._alarms.torque_not_kept()
        if self.phase is PowerPhase.TORQUE_HOLD:
            self._enter(PowerPhase.TORQUE_OFF)
        elif self.phase in (PowerPhase.OFF, PowerPhase.PARKED):
            self._enter(PowerPhase.OFF)
        elif reaction is not Reaction.QUICK_STOP:
            self._enter(PowerPhase.TORQUE_OFF)
        elif self.phase is _ON or self.phase in _BRAKE_OPENING:
            self._enter(PowerPhase.QUICK_STOPPING)
        elif self.phase in RISING:
            self._enter(PowerPhase.DISABLING)
        elif self.phase in _BRAKE_CLOSING:
            # The way down goes on, at rest as the drive's own ramp ends, and no longer as an enabled axis.
            self.request = DriveRequest.QUICK_STOP

    def release_hold(self) -> None:
        """Try the brake again: service has reset HOLD."""
        if self.phase is PowerPhase.TORQUE_HOLD:
            self._enter(PowerPhase.CLOSING)

    def rebase(self) -> None:
        """Move the reference of the slip watch along with a position that was set anew."""
        self._pos_hold = self._pos_rad = None

    @property
    def _opens_by_drive(self) -> bool:
        """A drive that may own its brake is opening it, or has done so without a command yet."""
        begun = self.phase is PowerPhase.SAG_WATCH and self._drive_owns_brake and self._count == 0
        return begun or (self.phase is PowerPhase.ENABLING and self._feedback.state is DriveState.SWITCHED_ON)

    @property
    def parked(self) -> bool:
        """`status` is TRUE, but the brake holds the axis, or is being opened or closed."""
        return self.status and self.phase is not _ON

    @property
    def falling(self) -> bool:
        """A stop or the way down is under way; nothing may shorten it."""
        return self.phase in FALLING or self._turns_back

    # --- one scan ---------------------------------------------------------------------------------

    def step(self, pos_rad: float) -> None:
        """One scan, at most one change of phase."""
        self._pos_rad = pos_rad
        phase = self.phase
        if phase is _ON:
            # At once: waiting for the following error took 850 ms on a rigid model (D1).
            if self._feedback.state is not _OPERATION_ENABLED and not self._feedback.state_old:
                self._lost()
            return
        self._count += self._feedback.periods
        # A state that is too old has an alarm of its own, and the stop that it asked for goes on.
        if phase in TORQUE_ON and self._feedback.state not in ENABLED and not self._feedback.state_old:
            if self._quick_stop_ended():
                self._enter(PowerPhase.DISABLING)
            else:
                self._lost()
            return
        _STEPS[phase](self, pos_rad)

    def _enter(self, phase: PowerPhase) -> None:
        """Change the phase; outputs follow from it."""
        if phase is not PowerPhase.SAG_WATCH:  # the sag counts from the release command
            self._pos_hold = self._pos_rad
            self._turns_back = False
        disabled = self.phase is PowerPhase.DISABLING
        self._unloaded = disabled and self._unloaded
        self._unwinding = disabled and self._drive_owns_brake
        self.phase = phase
        self._count = self._rest_count = self._over_envelope = self._doubted_moving = 0
        self._hold_watch.begin()
        self._vel_start = abs(self._feedback.vel_rad_s)
        outputs = OUTPUTS[phase]
        if phase is PowerPhase.TORQUE_OFF and self._feedback.brake_open:
            self.wear.begin(self._vel_start)
        self.brake_open = outputs.brake_open
        if outputs.request is not None:
            self.request = outputs.request
        elif phase is PowerPhase.TORQUE_HOLD and self.request is DriveRequest.DISABLE:
            self.request = DriveRequest.ENABLE
        if self.request is DriveRequest.DISABLE:
            self.torque_ff_nm = 0.0
        # Torque is off and the drive disabled: only now the result counts.
        if phase is PowerPhase.OFF and self.brake_test.under_way:
            self._finish_test()

    # --- the way up -------------------------------------------------------------------------------

    def _enabling(self, _pos_rad: float) -> None:
        feedback, holding = self._feedback, self.holding
        if feedback.state is not _OPERATION_ENABLED:
            if self._count > self._power_up_scans:
                self._stuck(_OPERATION_ENABLED)
            return
        # The torque of the last standstill: the drive adds it to its own loop, so nothing steps at release.
        holding.preload()
        self._drive_owns_brake = feedback.brake_open
        if self._turns_back and not feedback.brake_open:
            self._enter(PowerPhase.DISABLING)
            return
        if self.brake_test.under_way:
            self._test_enabled()
        # A drive that opened the brake owns it: its own sequence is accepted, and the sag is watched.
        elif feedback.brake_open:
            self.proof = Proof.NOT_POSSIBLE
            self._enter(PowerPhase.SAG_WATCH)
        elif not self._settings.torque_preload:
            self.proof = Proof.NOT_POSSIBLE
            self._enter(PowerPhase.RELEASING)
        else:
            self.proof = Proof.NOT_DONE
            self._enter(PowerPhase.PROVING)
            self.torque_ff_nm = holding.proof_nm
            self._twist.begin(holding.proof_nm)

    def _proving(self, pos_rad: float) -> None:
        """Give torque against the closed brake: the motor must give it, the brake must take it.

        At zero speed a PI speed loop builds no torque against a closed brake: a drive that is enabled may still drop
        the load, so the torque is asked for beside the speed (60B2).
        """
        if self._slipped(pos_rad, Code.BRK_03):
            return
        self._twist.scan()
        proof_nm = self.holding.proof_nm
        wanted = self._settings.proof_share * abs(proof_nm)
        given = self._feedback.torque_nm * math.copysign(1.0, proof_nm)
        if not abs(given) <= abs(proof_nm) + self._settings.proof_excess_nm:
            self.holding.believed = False
            reading = Words.TORQUE_AGAINST_BRAKE(torque=self._feedback.torque_nm, wanted=proof_nm)
            self._alarms.raise_(Code.DRV_14, Reaction.QUICK_STOP, measured=reading)
        elif given >= wanted:
            self.proof = Proof.PROVEN
            self._enter(PowerPhase.SETTLING)
        elif self._count > self._proof_scans:
            time_ms = self._milliseconds(self._count)
            self._alarms.raise_(Code.BRK_07, measured=given, limit=wanted, time_ms=time_ms)

    def _settling(self, _pos_rad: float) -> None:
        """Ramp from the proof torque to the preload, then wait as long again for it to settle."""
        self._twist.scan()
        share = min(1.0, self._count / self._settle_scans)
        proof_nm = self.holding.proof_nm
        self.torque_ff_nm = proof_nm + (self.holding.preload_nm - proof_nm) * share
        if self._count >= 2 * self._settle_scans and self._twist.shown(proof_nm):
            self._enter(PowerPhase.RELEASING)

    def _releasing(self, pos_rad: float) -> None:
        if self._slipped(pos_rad, Code.BRK_10):
            return
        limit = self._open_late_scans
        if self._feedback.brake_open:
            self._enter(PowerPhase.SAG_WATCH)
        elif self._count > limit:
            milliseconds = self._milliseconds
            self._alarms.raise_(Code.BRK_01, time_ms=milliseconds(self._count), limit=milliseconds(limit))

    def _sag_watch(self, pos_rad: float) -> None:
        if self._turns_back:
            self._enter(PowerPhase.CLOSING)
        elif not self._slipped(pos_rad, Code.BRK_10) and self._count >= self._sag_scans:
            self.status = True
            self._enter(PowerPhase.ON)

    # --- the way down -----------------------------------------------------------------------------

    def _closing(self, _pos_rad: float) -> None:
        """Hold zero speed while the brake closes."""
        # A drive that owns the brake closes it itself: when it is disabled, or at the end of its quick stop.
        if self._drive_owns_brake and self.request is not DriveRequest.QUICK_STOP:
            self._enter(PowerPhase.DISABLING)
        # Torque goes off only after the brake holds; TORQUE OFF is the one exception.
        elif self._count >= self._close_scans and not self._feedback.brake_open:
            self._unload()
        elif self._count > self._close_late_scans:
            self._brake_still_open()
            # Only unloading shows whether a brake without its contact holds.
            self._unload()

    def _quick_stop_ended(self) -> bool:
        """A drive that owns its brake has ended a quick stop by itself: ramp, brake, torque off."""
        feedback = self._feedback
        return (
            self._drive_owns_brake
            and self.request is DriveRequest.QUICK_STOP
            and feedback.state is DriveState.SWITCH_ON_DISABLED
            and -REST_RAD_S < feedback.vel_rad_s < REST_RAD_S
        )

    def _unload(self) -> None:
        # A reading that is not believed would load the brake with what it is wrong by.
        if self._drive_owns_brake or not (self._settings.torque_preload and self.holding.believed):
            self._enter(PowerPhase.DISABLING)
            return
        self._enter(PowerPhase.UNLOADING)
        self._load_nm = self._feedback.torque_nm

    def _unloading(self, pos_rad: float) -> None:
        """Lower the torque by what the motor still gives, in three steps; a brake that slips gets it back."""
        if self._slipped(pos_rad, Code.BRK_03):
            return
        step = self._count // self._step_scans + 1
        if step <= _UNLOAD_STEPS:
            preload_nm = self.holding.preload_nm
            # The angle is checked after each step, so a weak brake shows while the motor still holds most of the load.
            self.torque_ff_nm = self.holding.limited(preload_nm - self._load_nm * step / _UNLOAD_STEPS)
        elif step > _UNLOAD_STEPS + 1:
            self._enter(PowerPhase.DISABLING)
            self._unloaded = True

    def _disabling(self, _pos_rad: float) -> None:
        if self._feedback.state not in ENABLED:
            self._enter(PowerPhase.PARKED if self._parking else PowerPhase.OFF)
        elif self._count > self._power_up_scans:
            self._stuck(DriveState.SWITCH_ON_DISABLED)

    def _off(self, pos_rad: float) -> None:
        """Watch the closed brake with torque off; clear drive faults when asked."""
        self.request = DriveRequest.FAULT_RESET if self.fault_reset else DriveRequest.DISABLE
        moved = self._moved(pos_rad)
        limit = self._settings.sag_max_rad
        if self._unwinding:
            limit += _UNWIND_RAD
            if moved <= limit and self._count * self._period_s > _UNWIND_S:
                self._unwinding, self._pos_hold = False, pos_rad
        if not moved <= limit and self._believed(pos_rad):
            # Within the watch after unloading it is the brake that did not hold (C3), later one that gave way (C4).
            late = not self._unloaded or self._count > self._slip_scans
            self._raise_slip(Code.BRK_04 if late else Code.BRK_03, moved)
            self._hold_watch.tell_if_moved(moved)
        if self._feedback.brake_open and self._count > self._close_late_scans:
            self._brake_still_open()

    # --- stops ------------------------------------------------------------------------------------

    def _quick_stopping(self, _pos_rad: float) -> None:
        """Follow the ramp of the drive; a drive slower than its ramp does not obey."""
        if not self._feedback.speed_known:
            self._quick_stopping_blind()
            return
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

    def _quick_stopping_blind(self) -> None:
        """Without a speed give the drive the time of its ramp; then the torque goes off."""
        first = self._alarms.first_out
        if (
            first is not None
            and self._count * self._period_s > self._vel_start / self._quick_dec + _BLIND_RAMP_S
        ):
            self._alarms.raise_(first.code, Reaction.TORQUE_OFF)

    def _torque_off(self, _pos_rad: float) -> None:
        self.wear.scan()
        elapsed_s = self._count * self._period_s
        if not (self._feedback.position_valid and self._feedback.speed_known):
            if elapsed_s > _BLIND_STOP_S:
                self._enter(PowerPhase.OFF)
            return
        brake_time_over = self._count > self._close_late_scans
        # At rest is judged on the motor side; the load goes on swinging for some seconds.
        rests = self._at_rest() and self._rest_count >= self._brake_rest_scans
        if rests and (not self._feedback.brake_open or brake_time_over):
            self._enter(PowerPhase.OFF)
        elif elapsed_s > _STOP_TIME_S:
            speed = deg(abs(self._feedback.vel_rad_s))
            self._alarms.raise_(Code.BRK_11, measured=speed, time_s=elapsed_s)

    def _torque_hold(self, pos_rad: float) -> None:
        """Give the preload back, at zero speed, once the drive is enabled; judge whether that holds the load."""
        if self._feedback.state in ENABLED:
            self.torque_ff_nm = self.holding.preload_nm
        elif self._hold_watch.has_held:
            self._lost()
        elif self._count > self._power_up_scans:
            self._stuck(_OPERATION_ENABLED, Reaction.TORQUE_OFF)
        self._hold_watch.scan(self._moved(pos_rad))

    def _can_hold(self) -> bool:
        """Whether the drive can be asked for torque at zero speed."""
        feedback = self._feedback
        # Torque is never given back by itself with the emergency stop open, also when the brake slips (C4).
        inputs = feedback.inputs
        ready = inputs.estop_closed and inputs.mains_ready and feedback.position_valid
        if not ready or feedback.state not in _ABLE:
            return False
        return not any(map(_forbids_hold, self._alarms.active.values()))

    # --- the brake test ---------------------------------------------------------------------------

    def _test_enabled(self) -> None:
        """Begin to give torque, unless the drive has opened the brake."""
        if self._feedback.brake_open:
            why = Words.BRAKE_OPENED_BY_DRIVE
            self.brake_test.end(BrakeTestOutcome.ABORTED, why)
            self._enter(PowerPhase.DISABLING)
        else:
            self.brake_test.begin()
            self._enter(PowerPhase.TESTING)

    def _testing(self, pos_rad: float) -> None:
        test, feedback = self.brake_test, self._feedback
        if feedback.brake_open:
            test.end(BrakeTestOutcome.FAILED, Words.BRAKE_CONTACT_OPEN)
        torque_nm = test.scan(feedback.torque_nm, pos_rad, feedback.periods)
        self.torque_ff_nm = self.holding.limited(torque_nm)
        if not test.running:
            self.holding.preload_nm = self.torque_ff_nm
            self._unload()

    def _stop_test(self, reaction: Reaction) -> None:
        """End the test by an alarm, which decides what becomes of torque and drive."""
        if reaction is Reaction.HOLD:
            self.brake_test.slipped_afterwards()
        first = self._alarms.first_out
        why = Words.ENDED_BY_ALARM if first is None else Words.ENDED_BY(code=first.code)
        self.brake_test.end(BrakeTestOutcome.ABORTED, why)
        self._finish_test()

    def _finish_test(self) -> None:
        """Raise or clear BRK-08: a failed brake lets nothing move until a test passes, or service resets."""
        result = self.brake_test.finish()
        if result.outcome is BrakeTestOutcome.FAILED:
            self._alarms.raise_(Code.BRK_08, measured=result.words)
        elif result.outcome is BrakeTestOutcome.PASSED:
            self._alarms.active.pop(Code.BRK_08, None)

    # --- measured ---------------------------------------------------------------------------------

    def _moved(self, pos_rad: float) -> float:
        """Angle since this phase began (or since the position was set anew)."""
        if self._pos_hold is None:
            self._pos_hold = pos_rad
        return abs(pos_rad - self._pos_hold)

    def _slipped(self, pos_rad: float, code: Code) -> bool:
        """Raise `code` for more motion than the brake, or the torque, may allow."""
        moved = self._moved(pos_rad)
        if moved <= self._settings.sag_max_rad:
            return False
        self._raise_slip(code, moved)
        return True

    def _believed(self, pos_rad: float) -> bool:
        """Whether a closed brake slips, or only a doubted reading jumps: then its speed must show it too."""
        if self._feedback.position_valid:
            return True
        if -REST_RAD_S < self._feedback.vel_rad_s < REST_RAD_S:
            self._pos_hold, self._doubted_moving = pos_rad, 0
            return False
        self._doubted_moving = self._feedback.lasting(self._doubted_moving)
        return self._doubted_moving >= self._rest_scans

    def _at_rest(self) -> bool:
        """Whether the axis has been slow for long enough."""
        slow = -REST_RAD_S < self._feedback.vel_rad_s < REST_RAD_S and self._feedback.speed_known
        self._rest_count = self._feedback.lasting(self._rest_count) if slow else 0
        return self._rest_count >= self._rest_scans

    def _milliseconds(self, scans: int) -> float:
        return scans * self._period_s * 1e3

    # --- alarms -----------------------------------------------------------------------------------

    def _raise_slip(self, code: Code, moved_rad: float) -> None:
        self._alarms.raise_(code, measured=deg(moved_rad), limit=deg(self._settings.sag_max_rad))

    def _lost(self) -> None:
        """Raise DRV-04: the drive is not enabled where it must be. Its own fault is DRV-01, from the interlocks."""
        if self._feedback.state not in FAULTS:
            self._alarms.raise_(Code.DRV_04, measured=drive_state_words(self._feedback.state))

    def _stuck(self, wanted: DriveState, reaction: Reaction | None = None) -> None:
        time_ms = self._milliseconds(self._count)
        state = drive_state_words(self._feedback.state)
        self._alarms.raise_(
            Code.DRV_03, reaction, measured=state, time_ms=time_ms, command=drive_state_words(wanted)
        )

    def _brake_still_open(self) -> None:
        # Without a contact, or with a reading of it that is too old, nothing contradicts.
        if not self._feedback.brake_known:
            return
        time_ms = self._milliseconds(self._count)
        self._alarms.raise_(Code.BRK_06, measured=Words.OPEN, command=Words.CLOSED, time_ms=time_ms)


def _forbids_hold(alarm: Alarm) -> bool:
    """Whether torque may not come back by itself: feedback or drive are in doubt, or it drove the load."""
    if alarm.code in _NO_HOLD_AFTER:
        return True
    doubt = alarm.code is Code.BRK_13 or alarm.code.startswith("ENC-")
    return doubt and alarm.reaction >= Reaction.TORQUE_OFF


# One row per phase but ON, which has no step of its own.
_STEPS: Final = {
    PowerPhase.OFF: PowerSequence._off,
    PowerPhase.PARKED: PowerSequence._off,
    PowerPhase.ENABLING: PowerSequence._enabling,
    PowerPhase.PROVING: PowerSequence._proving,
    PowerPhase.SETTLING: PowerSequence._settling,
    PowerPhase.RELEASING: PowerSequence._releasing,
    PowerPhase.SAG_WATCH: PowerSequence._sag_watch,
    PowerPhase.CLOSING: PowerSequence._closing,
    PowerPhase.UNLOADING: PowerSequence._unloading,
    PowerPhase.DISABLING: PowerSequence._disabling,
    PowerPhase.QUICK_STOPPING: PowerSequence._quick_stopping,
    PowerPhase.TORQUE_OFF: PowerSequence._torque_off,
    PowerPhase.TORQUE_HOLD: PowerSequence._torque_hold,
    PowerPhase.TESTING: PowerSequence._testing,
}
