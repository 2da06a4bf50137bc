"""The way back from ErrorStop: the record of the stop, and Reset."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.image import DriveState
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import Alarm, AlarmLog, Refusal, refusal
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.feedback import ENABLED, FAULTS, Feedback
from gantryctl.program.monitors.site import why_site_keeps
from gantryctl.program.power.phases import TORQUE_ON, PowerPhase
from gantryctl.program.power.rest import BrakeStop
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg

# Torque goes within some scans. Behind the ramp of a quick stop, which takes a crane 5 s, brake and torque take less
# than 2 s.
_TORQUE_OFF_S: Final = 0.5
# Without a speed nobody sees a brake slow the axis. The reference gantry is at rest 0.9 s behind torque off from
# 6 deg/s, and its stop without a valid position is over after 1.5 s (power/sequence.py).
_BLIND_S: Final = 2.0
_BEHIND_RAMP_S: Final = 3.0
# What a drive that was told to enable shows while it may give torque already: one that owns its brake does so before it
# shows Operation enabled, and of one that is not heard any more nobody knows.
_PERHAPS_ENABLED: Final = (DriveState.SWITCHED_ON, DriveState.UNKNOWN)
# After these the contact of the brake is known to have been wrong about it.
_CONTACT_LIED: Final = (Code.BRK_06, Code.BRK_14)
# A contact shows a brake so long after it has caught the shaft, at most. Of a fine encoder a sound reading changes for
# 160 ms and more behind the brake, since the load swings on; of 8192 counts a turn it may stand after 8 ms, and only
# this time keeps it from ENC-02. 324 sound stops without torque (reference gantry, with 8192 counts too, rotary table,
# azimuth dish) raised nothing; a contact that is later was not tried.
_CONTACT_S: Final = 0.05
# From the last speed to a reading that stands: a scan in part, and one for the speed that is told.
_STANDS_SCANS: Final = 3
# More scans missed than the time of something that is seen may be late by.
_SEEN_SCANS: Final = 3
# One object: what shows the alarm notices a change by identity.
_UNCONFIRMED: Final = (Words.STOP_UNCONFIRMED,)


class StopRecord:
    """Follows one stop from its alarm to rest and writes `alarm.steps`."""

    __slots__ = (
        "_angle_known", "_brake_scan", "_brake_stop", "_brake_unseen", "_counts", "_log", "_period_s",
        "_ramp_s", "_read_rad_s", "_slow_scan", "_speed_known", "_stands_scan", "_start_rad_s",
        "_switching_on", "_torque_scan", "_torque_unseen", "_turned", "_turning_rad_s", "_turning_scan",
        "_was_open", "_was_torque", "alarm", "finished",
    )  # fmt: skip

    def __init__(
        self, alarm: Alarm, settings: AxisSettings, feedback: Feedback, power: PowerSequence, log: AlarmLog
    ) -> None:
        self.alarm, self._log = alarm, log
        self._period_s = settings.period_s
        self._brake_stop, self._start_rad_s = BrakeStop(settings), feedback.vel_rad_s
        # No sound axis is faster than that.
        trip, speed = settings.speed.overspeed_trip_rad_s, abs(feedback.vel_rad_s)
        self._ramp_s = (speed if speed <= trip else trip) / settings.ramps.quick_dec_rad_s2
        # A drive that left by itself shows its new state already: what was commanded was on until then.
        self._was_open = feedback.brake_open or power.brake_open
        self._switching_on = power.phase is PowerPhase.ENABLING and feedback.state in _PERHAPS_ENABLED
        self._was_torque = feedback.energised or power.phase in TORQUE_ON or self._switching_on
        self._brake_scan = self._torque_scan = self._slow_scan = -1
        self._stands_scan, self._turning_scan = 0, -1 - _STANDS_SCANS
        self._counts = math.nan
        self._angle_known = self._speed_known = True
        self._torque_unseen = self._brake_unseen = self._turned = False
        self._turning_rad_s = self._read_rad_s = 0.0
        self.finished = False

    def scan(self, scan: int, pos_rad: float, feedback: Feedback, falling: bool) -> None:
        """Record one scan; `falling`: the stop is still under way."""
        # Nobody looked while the controller stood still: what it finds then has come at any time of it.
        held_up = feedback.periods > _SEEN_SCANS
        if self._brake_scan < 0:
            # A contact that was not heard, or was wrong, in between shows that the brake is closed, not since when.
            lied = any(code in self._log.active for code in _CONTACT_LIED)
            self._brake_unseen = self._brake_unseen or lied or not feedback.brake_known
            if not feedback.brake_open and feedback.brake_known:
                self._brake_scan = scan
                self._brake_unseen = self._brake_unseen or held_up
        if self._torque_scan < 0:
            # A state that was not known in between shows that the torque is off, not since when.
            self._torque_unseen = self._torque_unseen or feedback.state is DriveState.UNKNOWN
            self._switching_on = self._switching_on and feedback.state in _PERHAPS_ENABLED
            if not (feedback.energised or self._switching_on):
                self._torque_scan = scan
                self._torque_unseen = self._torque_unseen or held_up
        turning = not feedback.slow
        self._turning_rad_s = feedback.vel_rad_s if turning and feedback.speed_known else 0.0
        self._speed_known = feedback.speed_known
        self._turned = self._turned or bool(self._turning_rad_s)
        if not feedback.speed_known or turning:
            self._slow_scan = -1
        elif self._slow_scan < 0:
            self._slow_scan = scan
        if turning:
            self._turning_scan, self._read_rad_s = scan, feedback.vel_rad_s
        if feedback.counts != self._counts:
            self._counts, self._stands_scan = feedback.counts, scan
        if not falling and feedback.position_valid and self._frozen:
            read, time_ms = abs(deg(self._read_rad_s)), (scan - self._stands_scan) * self._period_s * 1e3
            feedback.doubt(Code.ENC_02, measured=Words.WHILE_READ(value=read), time_ms=time_ms)
        # Speed and angle of a wrong or frozen encoder say nothing, nor do they where it was so for a while.
        self._angle_known = self._angle_known and not feedback.in_doubt
        if not falling:
            # An old reading says nothing either; it may have come again.
            self._angle_known = self._angle_known and feedback.position_valid
            self.finished = True
            self.alarm.steps = self._steps(feedback, pos_rad)
        elif self._overdue((scan - self.alarm.scan) * self._period_s):
            self.alarm.steps = _UNCONFIRMED

    @property
    def _frozen(self) -> bool:
        """A reading that turned came to stand long before the brake closed, and stood until the stop had ended.

        Without torque nothing holds the shaft there, and behind the brake the load swings on.
        """
        if self.alarm.reaction is not Reaction.TORQUE_OFF or self._torque_scan < 0 or self._brake_unseen:
            return False
        free_scans = self._brake_scan - max(self._stands_scan, self._torque_scan)
        return (
            self._stands_scan - self._turning_scan <= _STANDS_SCANS
            and free_scans * self._period_s > _CONTACT_S
        )

    def _overdue(self, time_s: float) -> bool:
        """The stop takes longer than a sound drive and brake do: nobody waits for its end before it is told."""
        if self.alarm.reaction is Reaction.HOLD:
            return False
        if self.alarm.reaction is Reaction.QUICK_STOP:
            return time_s > self._ramp_s + _BEHIND_RAMP_S
        if self._torque_scan < 0:
            return time_s > _TORQUE_OFF_S
        if not self._speed_known:
            return time_s > max(_BLIND_S, self._brake_stop.shown_s(0.0, 0.0))
        # A brake that slows nothing is told as soon as a sound one would have shown it.
        return time_s > self._brake_stop.shown_s(self._start_rad_s, self._turning_rad_s)

    def _steps(self, feedback: Feedback, pos_rad: float) -> tuple[Words | Said, ...]:
        alarm = self.alarm
        hold = Words.TORQUE_KEPT in alarm.steps
        # A state and a contact that say "off" and "closed" of an axis that turns on have confirmed nothing.
        off = self._torque_scan >= 0 and not self._turning_rad_s
        closed = self._brake_scan >= 0 and not self._turning_rad_s
        steps = (
            (self._slow_scan, Words.AT_REST_AFTER, self._slow_scan > alarm.scan and self._angle_known),
            (
                self._torque_scan,
                Words.TORQUE_OFF_SEEN if self._torque_unseen else Words.TORQUE_OFF_AFTER,
                off and self._was_torque and not hold,
            ),
            (
                self._brake_scan,
                Words.BRAKE_CLOSED_SEEN if self._brake_unseen else Words.BRAKE_CLOSED_AFTER,
                closed and self._was_open and not hold,
            ),
        )
        parts: list[Words | Said] = [Words.TORQUE_KEPT] if hold else []
        if alarm.reaction is Reaction.QUICK_STOP and self._was_torque:
            parts.append(Words.QUICK_STOP)
        for at, words, happened in sorted(steps, key=lambda step: step[0]):
            if happened:
                parts.append(words(time_ms=(at - alarm.scan) * self._period_s * 1e3))
        if not (parts or self._was_torque or self._was_open or self._turned):
            return (Words.NOTHING_ON,)
        if not hold:
            parts += _unconfirmed(
                self._was_torque and not off, self._was_open and not closed, self._slow_scan >= 0
            )
        # Of a load that torque holds the emergency stop would let go; one that moves all the same is BRK-13.
        if self._turning_rad_s and self._angle_known and not hold:
            parts.append(Words.STILL_TURNING(speed=abs(deg(self._turning_rad_s))))
        moved = deg(pos_rad - alarm.pos_rad)
        parts.append(
            Words.MOVED_TO(way=abs(moved), position=deg(feedback.read_rad(pos_rad)))
            if self._angle_known
            else Words.ANGLE_UNKNOWN
        )
        return tuple(parts)


def _unconfirmed(torque: bool, brake: bool, at_rest: bool) -> tuple[Words, ...]:
    """Words for what was commanded and not shown; `at_rest`: the shaft stands, whatever holds it."""
    if torque:
        return (Words.STOP_UNCONFIRMED if brake else Words.TORQUE_UNCONFIRMED,)
    if brake:
        return (Words.BRAKE_COMMANDED if at_rest else Words.STOP_UNCONFIRMED,)
    return ()


# A drive that still shows its fault after this keeps it for a cause that a reset does not clear.
_FAULT_RESET_S: Final = 1.0


class Recovery:
    """Follows a stop to its end and runs a reset, which may take the drive some scans.

    Reset never enables and never shortens a stop: while the axis is still stopping it is refused.

    Attributes:
        resetting: a reset is under way; the drive clears its fault.
        service: the reset comes from the service role.
        failure: why the last reset failed after it was accepted, or None.
    """

    __slots__ = (
        "_alarms", "_count", "_feedback", "_power", "_record", "_reset_scans", "_settings", "failure",
        "resetting", "service",
    )  # fmt: skip

    def __init__(
        self, settings: AxisSettings, feedback: Feedback, power: PowerSequence, alarms: AlarmLog
    ) -> None:
        self._feedback, self._power, self._alarms = feedback, power, alarms
        self._settings = settings
        self._reset_scans = settings.scans(_FAULT_RESET_S)
        self._record: StopRecord | None = None
        self._count = 0
        self.resetting = self.service = False
        self.failure: Refusal | None = None

    def stop_begun(self, alarm: Alarm) -> None:
        """Follow the stop that `alarm` began."""
        self._abandon_reset(None)
        if self._record is None or self._record.alarm is not alarm:
            self._record = StopRecord(alarm, self._settings, self._feedback, self._power, self._alarms)

    def scan(self, scan: int, pos_rad: float) -> None:
        """Follow the stop; every scan while an alarm is latched."""
        record = self._record
        if record is not None and not record.finished:
            record.scan(scan, pos_rad, self._feedback, self._power.falling)

    def request(self, service: bool) -> Refusal | None:
        """Begin a reset; None when it was accepted."""
        refused = self._cause(service)
        if refused is None:
            self.service, self.resetting, self.failure, self._count = service, True, None, 0
            self._power.fault_reset = self._feedback.state in FAULTS
        return refused

    def finished(self) -> bool:
        """Continue a reset under way; True once, when the drive has cleared its fault."""
        if not self.resetting:
            return False
        if self._feedback.state not in FAULTS:
            self._abandon_reset(None)
            return True
        # Also a fault that shows only when a lost drive answers again.
        self._power.fault_reset = True
        self._count += self._feedback.periods
        if self._count > self._reset_scans:
            self._abandon_reset(refusal(Code.CTL_14, reason=Words.DRIVE_KEEPS_FAULT))
        return False

    def _abandon_reset(self, failure: Refusal | None) -> None:
        self.resetting = self._power.fault_reset = False
        self.failure = failure

    def _cause(self, service: bool) -> Refusal | None:
        """Why a reset is not possible now."""
        active, feedback = self._alarms.active, self._feedback
        locked = next((alarm for alarm in active.values() if alarm.definition.lock), None)
        first = self._alarms.first_out
        # Reset never shortens a stop that is under way.
        if self._power.falling:
            reason: Words | Said = Words.STILL_STOPPING
        elif self._power.phase is PowerPhase.OFF and feedback.state in ENABLED:
            reason = Words.TORQUE_STILL_ON
        elif first is not None and first.scan == self._alarms.scan:
            # Sent before anybody could see it: what it was to acknowledge was something else.
            reason = Words.JUST_RAISED(code=first.code)
        elif locked is not None and not service:
            reason = Words.SERVICE_ONLY(code=locked.code, measured=locked.refusal)
        elif feedback.in_doubt and not service:
            reason = Words.POSITION_NOT_VALID
        elif Code.INT_03 in active and not feedback.inputs.estop_closed:
            reason = Words.ESTOP_STILL_OPEN
        elif (opened := why_site_keeps(active, feedback.inputs)) is not None:
            reason = opened
        elif Code.ENC_05 in active and feedback.encoder_alarm:
            reason = Words.ENCODER_KEEPS_ALARM
        else:
            return None
        return refusal(Code.CTL_14, reason=reason)
