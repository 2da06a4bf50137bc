"""The power sequence: from torque off behind a closed brake to a held load, and back."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.image import DriveRequest, DriveState
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Words, drive_state_words
from gantryctl.program.feedback import ENABLED, FAULTS, Feedback
from gantryctl.program.power.brake_test import BrakeTest, BrakeTestOutcome
from gantryctl.program.power.hold_watch import HoldWatch
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.power.phases import FALLING, OUTPUTS, RISING, TORQUE_ON, PowerPhase, Proof
from gantryctl.program.power.ramp_watch import STOP_TIME_S, RampWatch
from gantryctl.program.power.rest import BrakeStop, RestWatch
from gantryctl.program.power.slip_watch import SlipWatch
from gantryctl.program.power.torque_proof import TorqueProof
from gantryctl.program.power.twist import Twist
from gantryctl.program.power.wear import BrakeWear
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg

# Without a valid position the end of a brake stop is judged by time alone: no sooner than this.
_BLIND_STOP_S: Final = 1.5
# A ramp of which nobody has seen the speed for so long is ended by the brake, where that takes no longer.
_UNSEEN_S: Final = 0.1
_UNLOAD_STEPS: Final = 3
# A sound drive shows after two or three scans that its torque is off. One that owns its brake has the closing time of
# that more on an orderly way down: then it is told to take the torque off at once, whether it has closed the brake or
# not (`drives.canopen.brake`), so people are told in the same scan. Of fault D3: 0.4 s in all.
_DISABLED_S: Final = 0.2
# What a drive does at a SYNC is shown so much later, at most.
_SHOWN_SCANS: Final = 3
# Two motors that their drive braces against each other turn the shaft against the closed brake as they come on, as far
# as the torque proof does: by 29 counts of 2^22 within 3 ms (35 N m each, seed 80262 at 1 ms). The proof counts from
# where the shaft stands then.
_BRACED_S: Final = 0.004
_OPERATION_ENABLED: Final = DriveState.OPERATION_ENABLED
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
        "_braced_scans",
        "_brake_stop",
        "_close_late_scans",
        "_close_scans",
        "_count",
        "_disabled_scans",
        "_disabling_scans",
        "_drive_owns_brake",
        "_enabled_scans",
        "_feedback",
        "_hold_watch",
        "_load_nm",
        "_off_s",
        "_open_late_scans",
        "_parking",
        "_period_s",
        "_pos_rad",
        "_power_up_scans",
        "_ramp",
        "_rest",
        "_sag_scans",
        "_settings",
        "_slip",
        "_slip_scans",
        "_step_scans",
        "_stood",
        "_torque_proof",
        "_turns_back",
        "_turns_rad_s",
        "_twist",
        "_unloaded",
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
        self._power_up_scans = settings.scans(power.power_up_time_s)
        self._braced_scans = settings.scans(_BRACED_S)
        self._close_scans = settings.scans(power.brake_close_time_s)
        self._disabled_scans = settings.scans(_DISABLED_S)
        # CLOSING has taken a scan of it where the drive owns the brake.
        self._disabling_scans = (
            settings.scans(power.brake_close_time_s + _DISABLED_S) - 1
            if power.brake_by_drive
            else self._disabled_scans
        )
        feedback_scans = settings.scans(power.brake_feedback_time_s)
        self._close_late_scans = self._close_scans + feedback_scans
        self._open_late_scans = settings.scans(power.brake_open_time_s) + feedback_scans
        self._sag_scans = settings.scans(power.sag_watch_s)
        self._step_scans = settings.scans(power.unload_step_s)
        self._slip_scans = settings.scans(power.slip_watch_s)
        self.phase = PowerPhase.OFF
        self.status = False
        self.proof = Proof.NOT_DONE
        self.holding = HoldingTorque(settings)
        self._torque_proof = TorqueProof(settings, feedback, alarms, self.holding)
        self._twist = Twist(settings, feedback)
        self._rest = RestWatch(settings, feedback)
        self._slip = SlipWatch(settings, feedback, alarms)
        self._ramp = RampWatch(settings, feedback)
        self._brake_stop = BrakeStop(settings)
        self._hold_watch = HoldWatch(settings, feedback, alarms)
        self.brake_test = BrakeTest(
            power.test_torque_nm, power.sag_max_rad, power.torque_max_nm, settings.period_s
        )
        self.wear = BrakeWear(settings, feedback, alarms)
        self.fault_reset = False
        self.request = DriveRequest.DISABLE
        self.brake_open = False
        self.torque_ff_nm = 0.0
        self._drive_owns_brake = power.brake_by_drive
        self._parking = self._unloaded = self._turns_back = False
        # A stop began behind a brake that had not been opened yet: nothing has to come to rest.
        self._stood = False
        self._off_s = self._turns_rad_s = 0.0
        self._count = self._enabled_scans = 0
        self._pos_rad: float | None = None
        self._load_nm = 0.0

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
        if reaction is Reaction.HOLD and self._hold_watch.possible():
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
            self._stop_on_ramp()
        elif self.phase in RISING:
            opens = self._opens_by_drive
            self._enter(PowerPhase.DISABLING)
            # Enabled by now it closes its brake first and then takes the torque off; told to disable, it would not.
            if opens:
                self.request = DriveRequest.QUICK_STOP
        elif self.phase in _BRAKE_CLOSING:
            # The way down goes on, at rest as the drive's own ramp ends, and no longer as an enabled axis.
            self.request = DriveRequest.QUICK_STOP

    def _stop_on_ramp(self) -> None:
        """Leave the stop to the drive; the brake follows at rest, or at once where nobody may hold the load.

        Behind its deadline the drive has stopped by itself, and at rest that takes no time: its torque is off. A
        watchdog relay that has fallen takes torque and brake supply, and the first edge gives the supply back: a brake
        that is told open then stops to close, until telegrams tell (20 ms and more; random seed 158517).
        """
        self._enter(PowerPhase.QUICK_STOPPING)
        unseen_s = self._feedback.periods * self._period_s
        stopped = self._feedback.slow and unseen_s > self._ramp.ends_s
        if stopped or unseen_s >= self._settings.watchdog_falls_s:
            self.brake_open = False

    def release_hold(self) -> None:
        """Try the brake again: service has reset HOLD."""
        if self.phase is PowerPhase.TORQUE_HOLD:
            self._enter(PowerPhase.CLOSING)

    def rebase(self) -> None:
        """Move the reference of the slip watch along with a position that was set anew."""
        self._pos_rad = None
        self._slip.rebase()

    @property
    def _opens_by_drive(self) -> bool:
        """A drive that owns its brake is opening it, or has done so without a command yet."""
        # One whose telegrams are missing may have gone on to that meanwhile.
        feedback = self._feedback
        may_open = feedback.state is DriveState.SWITCHED_ON or feedback.state_old
        opening = self.phase is PowerPhase.ENABLING and may_open
        begun = self.phase in _BRAKE_OPENING and self._count == 0
        return self._drive_owns_brake and (opening or begun)

    @property
    def reading_shown(self) -> bool:
        """The proof before the brake opened has shown the torque, and the shaft turned enough for the reading."""
        return self.proof is Proof.PROVEN and self._torque_proof.turns_shaft

    @property
    def ramp_left(self) -> bool:
        """In a quick stop: the drive is faster than its ramp."""
        return self._ramp.left

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
        disabled = self.phase is PowerPhase.DISABLING
        unwinds = disabled and self._drive_owns_brake
        if phase is not PowerPhase.SAG_WATCH:  # the sag counts from the release command
            self._slip.begin(self._pos_rad, unwinds=unwinds)
        self._turns_back = self._turns_back and phase in _BRAKE_OPENING
        self._unloaded = disabled and self._unloaded
        closed = self._feedback.brake_known and not (self._feedback.brake_open or self.brake_open)
        self._stood = self.phase in RISING and closed
        # Read in ENABLING alone: the time in OFF or PARKED.
        self._off_s = self._count * self._period_s
        self.phase = phase
        self._turns_rad_s = 0.0
        self._count = self._enabled_scans = 0
        self._rest.begin()
        self._ramp.begin()
        self._hold_watch.begin()
        outputs = OUTPUTS[phase]
        if phase is PowerPhase.TORQUE_OFF:
            self._load_goes()
            if self._feedback.brake_open:
                self.wear.begin(abs(self._feedback.vel_rad_s))
        self.brake_open = outputs.brake_open
        if outputs.request is not None:
            self.request = outputs.request
        elif self.request is not DriveRequest.QUICK_STOP:  # HOLD of a drive that was off, or in its reset
            self.request = DriveRequest.ENABLE
        if self.request is DriveRequest.DISABLE:
            self.torque_ff_nm = 0.0
        # Torque is off and the drive disabled: only now the result counts.
        if phase is PowerPhase.OFF and self.brake_test.under_way:
            self._finish_test()

    # --- the way up -------------------------------------------------------------------------------

    def _enabling(self, _pos_rad: float) -> None:
        feedback, holding = self._feedback, self.holding
        if self._drive_owns_brake:
            # The telegram that shows it open shows already what its gear has let go (seed 9288 of axes on the bus).
            feedback.brake_opens(self._sag_scans)
        if feedback.state is not _OPERATION_ENABLED:
            self._enabled_scans = 0
            self._turns_rad_s = 0.0 if feedback.slow or not feedback.speed_known else abs(feedback.vel_rad_s)
            if self._count > self._power_up_scans:
                self._stuck(_OPERATION_ENABLED)
            return
        # A drive that owns its brake has opened it, or is about to, whatever the contact says: its own sequence is
        # accepted, and the sag is watched. A torque proof would act on an open brake.
        if self._drive_owns_brake:
            self.proof = Proof.NOT_POSSIBLE
            self._enter(PowerPhase.SAG_WATCH if feedback.brake_open else PowerPhase.RELEASING)
            return
        # Only the controller opens this brake, so a contact that says open is late, or lies.
        if feedback.brake_open:
            if self._count > self._close_late_scans:
                self._brake_still_open(Reaction.QUICK_STOP)
            return
        # A shaft that turned until the torque came shows that the brake does not hold the load: torque does, from here
        # on. The proof would take that torque for a reading with the wrong sign, and let the load go.
        if self._turns_rad_s:
            off_s = self._off_s + self._count * self._period_s
            self._alarms.raise_(Code.BRK_11, measured=deg(self._turns_rad_s), time_s=off_s)
            return
        self._enabled_scans += feedback.periods
        if self._enabled_scans < self._braced_scans:
            return
        # The torque of the last standstill: the drive adds it to its own loop, so nothing steps at release.
        holding.preload()
        if self.brake_test.under_way:
            self.brake_test.begin()
            self._enter(PowerPhase.TESTING)
        elif not self._settings.torque_preload:
            self.proof = Proof.NOT_POSSIBLE
            self._enter(PowerPhase.RELEASING)
        else:
            self.proof = Proof.NOT_DONE
            self._enter(PowerPhase.PROVING)
            self.torque_ff_nm = self._torque_proof.begin()

    def _proving(self, pos_rad: float) -> None:
        """Give torque against the closed brake: the motor must give it, the brake must take it."""
        if not self._slip.slipped(pos_rad, Code.BRK_03) and self._torque_proof.given(self._count):
            self.proof = Proof.PROVEN
            self._enter(PowerPhase.SETTLING)

    def _settling(self, _pos_rad: float) -> None:
        """Ramp from the proof torque to the preload, then wait as long again for it to settle."""
        self.torque_ff_nm = self._torque_proof.settling_torque_nm(self._count)
        if self._torque_proof.settled(self._count):
            self._enter(PowerPhase.RELEASING)

    def _releasing(self, pos_rad: float) -> None:
        if self._turns_back:
            self._enter(PowerPhase.CLOSING)
            return
        self._feedback.brake_opens(self._sag_scans)
        if self._slip.slipped(pos_rad, Code.BRK_10):
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
        elif not self._slip.slipped(pos_rad, Code.BRK_10) and self._count >= self._sag_scans:
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
            if self._drive_owns_brake and not self._feedback.brake_known:
                # It has not ended its quick stop, and nobody sees whether it has closed its brake.
                self._tell_torque_off()
            # Only unloading shows whether a brake without its contact holds.
            self._unload()

    def _quick_stop_ended(self) -> bool:
        """A drive that owns its brake has ended a quick stop by itself: ramp, brake, torque off."""
        feedback = self._feedback
        return (
            self._drive_owns_brake
            and self.request is DriveRequest.QUICK_STOP
            and feedback.state is DriveState.SWITCH_ON_DISABLED
            and feedback.slow
        )

    def _unload(self) -> None:
        # A reading that is not believed would load the brake with what it is wrong by.
        if self._drive_owns_brake or not (self._settings.torque_preload and self.holding.believed):
            self._enter(PowerPhase.DISABLING)
            return
        self._enter(PowerPhase.UNLOADING)
        self._load_goes()

    def _unloading(self, pos_rad: float) -> None:
        """Lower the torque by what the motor still gives, in three steps; a brake that slips gets it back."""
        if self._slip.slipped(pos_rad, Code.BRK_03):
            return
        self._twist.scan()
        step = self._count // self._step_scans + 1
        if step <= _UNLOAD_STEPS:
            preload_nm = self.holding.preload_nm
            # The angle is checked after each step, so a weak brake shows while the motor still holds most of the load.
            self.torque_ff_nm = self.holding.limited(preload_nm - self._load_nm * step / _UNLOAD_STEPS)
        elif step > _UNLOAD_STEPS + 1 and not self._stood_as_torque_went():
            self._enter(PowerPhase.DISABLING)
            self._unloaded = True

    def _load_goes(self) -> None:
        """The torque of this scan goes from now on: the reading must show it (`_stood_as_torque_went`)."""
        self._load_nm = self._feedback.torque_nm
        self._twist.begin(-self._load_nm)

    def _stood_as_torque_went(self) -> bool:
        """As much torque has gone as the proof at power-up gives, and the reading has not shown it as it does there.

        An encoder that froze at rest before it was asked is found so: behind the brake nobody can ask any more. A sound
        one showed 20 counts of 2^22 and more in 182 ways down, and in the 1,188 of 2,340 stops that asked it (1, 4 and
        10 ms).
        """
        gone_nm = self._feedback.torque_nm - self._load_nm
        enough = abs(gone_nm) >= self._settings.proof_torque_nm and self._feedback.position_valid
        return enough and self._twist.stood(gone_nm)

    def _disabling(self, _pos_rad: float) -> None:
        if self._feedback.state in ENABLED:
            self._torque_kept(self._disabling_scans)
        elif self.request is DriveRequest.DISABLE or self._count > (
            self._disabling_scans if self._feedback.state_old else _SHOWN_SCANS
        ):
            if self._drive_owns_brake and self._feedback.brake_known and self._feedback.brake_open:
                # Stopped while it opened its brake it took its torque off at once: before Operation enabled it has no
                # ramp at whose end it would close the brake first (seed 10339 of axes on the bus, 2 ms before that).
                self._tell_torque_off()
            self._enter(PowerPhase.PARKED if self._parking else PowerPhase.OFF)

    def _tell_torque_off(self) -> None:
        """Tell of a stop that its torque has gone, or goes, before the brake holds."""
        first = self._alarms.first_out
        if first is not None:
            self._alarms.raise_(first.code, reaction=Reaction.TORQUE_OFF)

    def _torque_kept(self, limit: int) -> None:
        """Raise DRV-03 for a drive that shows after so many scans that it has not taken its torque off."""
        if self._feedback.state in ENABLED and self._count >= limit:
            self._stuck(DriveState.SWITCH_ON_DISABLED)

    def _off(self, pos_rad: float) -> None:
        """Watch the closed brake with torque off; clear drive faults when asked."""
        self._torque_kept(self._disabled_scans)
        self.request = DriveRequest.FAULT_RESET if self.fault_reset else DriveRequest.DISABLE
        # Within the watch after unloading it is the brake that did not hold (C3), later one that gave way (C4).
        late = not self._unloaded or self._count > self._slip_scans
        code = Code.BRK_04 if late else Code.BRK_03
        if self._slip.slipped_without_torque(pos_rad, self._count * self._period_s, code):
            self._hold_watch.tell_if_moved(self._slip.moved(pos_rad))
        if self._feedback.brake_open and self._count > self._close_late_scans:
            self._brake_still_open()

    # --- stops ------------------------------------------------------------------------------------

    def _quick_stopping(self, _pos_rad: float) -> None:
        """Follow the ramp of the drive until it stands."""
        elapsed_s = self._count * self._period_s
        if self._feedback.speed_known and not self._ramp.obeyed(elapsed_s):
            return
        if not self._feedback.speed_known or self._feedback.silent:
            self._stop_unseen(elapsed_s)
        elif self._rest.scan():
            self._enter(PowerPhase.CLOSING)

    def _stop_unseen(self, elapsed_s: float) -> None:
        """Without a speed the brake closes for the end of the ramp, and then the torque goes off.

        Nobody sees whether the drive still holds the load: off the bus it takes its torque off by itself behind its
        deadline and ramp, at standstill 60 ms after its last command. A brake that waited for the heartbeat closed
        214 ms after that (scan 4 ms).
        """
        close_s, ends_s = self._settings.brake_close_time_s, self._ramp.ends_s
        # A drive that owns its brake closes it at the end of its ramp, or as it takes its torque off.
        begins_s = ends_s - (0.0 if self._drive_owns_brake else close_s)
        unseen_s = self._ramp.unseen_s(elapsed_s) - _UNSEEN_S
        if ends_s - elapsed_s <= self._settings.unseen_ramp_s:
            unseen_s = -math.inf
        if elapsed_s >= begins_s or unseen_s >= 0.0:
            self.brake_open = False
        off = elapsed_s > max(0.0, begins_s) + close_s
        if off or unseen_s >= (0.0 if self._drive_owns_brake else close_s):
            self._tell_torque_off()

    def _torque_off(self, _pos_rad: float) -> None:
        self.wear.scan()
        self._twist.scan()
        self._torque_kept(self._disabled_scans)
        elapsed_s = self._count * self._period_s
        if not self._feedback.position_valid:
            if elapsed_s > max(_BLIND_STOP_S, self._brake_stop.ends_s):
                self._enter(PowerPhase.OFF)
            return
        # Behind an open brake the load turns the shaft on: what it turned before the torque was off proves nothing.
        if self._count <= _SHOWN_SCANS and self._feedback.brake_open:
            self._twist.begin(-self._load_nm)
        if self._count >= 2 * _SHOWN_SCANS and self._stood_as_torque_went():
            return
        # Behind a brake without torque the load may sink as the torque goes off again. From OFF on a slip is told and
        # held by torque; waiting here for rest, people were told after 3 s.
        if self._stood and not (self._feedback.energised or self._feedback.brake_open):
            self._enter(PowerPhase.OFF)
            return
        brake_time_over = self._count > self._close_late_scans
        # At rest is judged on the motor side; the load goes on swinging for some seconds.
        rests = self._rest.scan() and self._rest.after_brake_stop
        if rests and (not self._feedback.brake_open or brake_time_over):
            self._enter(PowerPhase.OFF)
        elif elapsed_s > STOP_TIME_S:
            speed = abs(self._feedback.vel_rad_s)
            # A slow axis whose brake slows it is not caught by torque.
            if elapsed_s > self._brake_stop.shown_s(self._ramp.began_rad_s, speed):
                self._alarms.raise_(Code.BRK_11, measured=deg(speed), time_s=elapsed_s)

    def _torque_hold(self, pos_rad: float) -> None:
        """Give the preload back, at zero speed, once the drive is enabled; judge whether that holds the load."""
        if self._feedback.state in ENABLED:
            self.torque_ff_nm = self.holding.preload_nm
        elif self._hold_watch.has_held:
            # Telegrams that are missing are no word of the drive: it holds the load, and the brake does not (E4).
            if not self._feedback.state_old:
                self._lost()
        elif self._count > self._power_up_scans:
            self._stuck(_OPERATION_ENABLED)
        self._hold_watch.scan(self._slip.moved(pos_rad))

    # --- the brake test ---------------------------------------------------------------------------

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

    # --- alarms -----------------------------------------------------------------------------------

    def _milliseconds(self, scans: int) -> float:
        return scans * self._period_s * 1e3

    def _lost(self) -> None:
        """Raise DRV-04: the drive is not enabled where it must be. Its own fault is DRV-01, from the interlocks."""
        if self._feedback.state not in FAULTS:
            self._alarms.raise_(Code.DRV_04, measured=drive_state_words(self._feedback.state))

    def _stuck(self, wanted: DriveState) -> None:
        """Raise DRV-03, torque off: the drive does not come to a state."""
        time_ms = self._milliseconds(self._count)
        state = drive_state_words(self._feedback.state)
        self._alarms.raise_(Code.DRV_03, measured=state, time_ms=time_ms, command=drive_state_words(wanted))

    def _brake_still_open(self, reaction: Reaction | None = None) -> None:
        # Without a contact, or with a reading of it that is too old, nothing contradicts.
        if not self._feedback.brake_known:
            return
        time_ms = self._milliseconds(self._count)
        self._alarms.raise_(Code.BRK_06, reaction, measured=Words.OPEN, command=Words.CLOSED, time_ms=time_ms)


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
