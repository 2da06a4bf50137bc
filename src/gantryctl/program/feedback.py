"""The reading of this scan, at the gantry, and whether it is in doubt."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, Final

from gantryctl.image import DigitalInputs, DriveFeedback, DriveState, EncoderFlag, LinkFlag
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Said, Words, drive_error_words, foreign_words
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg

# States in which the motor has torque.
ENABLED: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
# The same, and the ramp of a drive's fault reaction.
ENERGISED: Final = (*ENABLED, DriveState.FAULT_REACTION_ACTIVE)
FAULTS: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
_NO_FLAG: Final = EncoderFlag.NONE
# Fields of `DriveFeedback` that every scan changes come first: state to overload.
_CHANGING: Final = 7
_LOST: Final = LinkFlag.BUS_DOWN | LinkFlag.RESTARTED | LinkFlag.HEARTBEAT_LOST | LinkFlag.NOT_OPERATIONAL
# In this order: the first of which every flag applies is the cause, the others follow from it.
_LINK_CODES: Final[tuple[tuple[LinkFlag, Code, Words | None], ...]] = (
    (LinkFlag.BUS_DOWN | LinkFlag.BUS_OFF, Code.CAN_08, Words.BUS_OFF),
    (LinkFlag.BUS_DOWN | LinkFlag.QUEUE_FULL, Code.CAN_08, Words.QUEUE_FULL),
    (LinkFlag.BUS_DOWN, Code.CAN_08, Words.BUS_FAILED),
    (LinkFlag.RESTARTED, Code.DRV_11, None),
    (LinkFlag.HEARTBEAT_LOST, Code.CAN_06, None),
    (LinkFlag.NOT_OPERATIONAL, Code.CAN_13, None),
    (LinkFlag.OTHER_MASTER, Code.CAN_12, None),
    (LinkFlag.TWO_SENDERS, Code.CAN_14, None),
    (LinkFlag.IO_LOST, Code.CAN_16, Words.IO_NODE),
    (LinkFlag.LOAD_ENCODER_LOST, Code.CAN_16, Words.LOAD_ENCODER_NODE),
    (LinkFlag.WRONG_MODE, Code.DRV_06, None),
    (LinkFlag.STALE_TARGET, Code.DRV_08, None),
    (LinkFlag.LOCAL_CONTROL, Code.DRV_05, Words.LOCAL_CONTROL),
    (LinkFlag.IGNORES_COMMAND, Code.DRV_05, Words.NOT_FOLLOWING),
    (LinkFlag.OVERLOADED, Code.CAN_10, None),
    (LinkFlag.WRONG_LENGTH, Code.CAN_04, None),
    (LinkFlag.SYNC_UNSEEN, Code.CAN_01, None),
)
_TOO_LATE: Final = frozenset({Code.CAN_03, Code.CAN_07})
_COMPLAINTS: Final = (
    LinkFlag.NEVER_FOLLOWED
    | LinkFlag.SYNC_JITTER
    | LinkFlag.EMERGENCY_FLOOD
    | LinkFlag.EMERGENCY
    | LinkFlag.QUEUE_FULL
    | LinkFlag.ERROR_PASSIVE
)
_BUS_WARNINGS: Final = (
    (LinkFlag.ERROR_PASSIVE, Words.ERROR_PASSIVE),
    (LinkFlag.QUEUE_FULL, Words.QUEUE_FULL),
)


# Leak of the sum of position minus integrated speed: a wrong scale of the speed by 1 % shows as 0.018 deg at 6 deg/s.
_DRIFT_TIME_S: Final = 0.3
# A reading that stands after a speed that nothing could have taken away is frozen. Measured on the reference plant, 16
# and 50 kN m, 1 to 6 deg/s, within a scan of 1 ms: a quick stop of 5.5 deg/s2 takes at most 10 deg/s2, the brake 56.
_QUICK_DEC_FACTOR: Final = 4.0
_BRAKE_DEC_SHARE: Final = 0.5
# Without torque the twisted gear alone turns the shaft round: with what the drive gave last, and what the load swings
# by: at most 97 of 385 N m in 600 sound stops. A brake takes the speed away, and turns nothing round. 1,050 other sound
# stops (150 of them over the bus; 16 and 50 kN m, plants within 20 %, up to 6 deg/s, on ramps, in cruise and in quick
# stops, 1, 4 and 10 ms) took at most 39 % of the limit. A change of less than 0.2 deg/s in a scan is not looked at.
_SWINGS_SHARE: Final = 0.4
# A twisted gear turns the shaft for so long after the torque has gone: none of 252 sound quick stops whose torque
# fell to 2 to 90 % is doubted (12 without this, all at 10 ms). Its price, of 1,300 spoilt encoders and drives that
# turn the other way (1, 4 and 10 ms, 0 to 40 ms after the fall and in sound stops): 10 such drives at a sound encoder
# are stopped by another alarm, 10 to 60 ms later and 0.29 to 0.32 deg further.
_UNTWISTS_S: Final = 0.030

_LATE_SCANS: Final = 5
# Steps of the position that are compared with each other when it begins to stand. 108 sound stops by brakes of 30 to
# 100 % with the speed lost (0.6 to 6 deg/s, 50 kN m, 1, 4 and 10 ms) raised nothing.
_STEPS: Final = 2


class Feedback:
    """Reading of the drive, and the monitors of the encoder (faults A1 to A7, A16).

    Whatever doubts the reading sets `in_doubt`, which every phase of power obeys by TORQUE OFF and brake: a quick stop
    on a wrong encoder runs away. With a frozen one it went 1205 deg in 60 s from 6 deg/s, on a rigid model with the
    paper's gains, where torque off and brake take 3.3 deg. It stays until service has compared the angle.

    Attributes:
        in_doubt: the reading may be wrong, or may have been since it was accepted last.
        age: scans since state, position and torque were sampled; 0 when they belong to this scan.
        counts: encoder count used this scan; a single bad reading is replaced by a prediction.
        vel_rad_s: the drive's speed at the gantry.
        pos_ring_rad: reading of a load-side encoder, unchecked; 0 without one.
        read_rad: an angle as people read it, for sentences.
        state_old: the state is unknown because its telegram is missing, not because the drive shows another.
        unchanged_scans: scans without a new count while a speed is commanded.
        periods: scan periods since the scan before: 1, and more where scans were missed. Every count of scans that
            stands for a time counts these (decision 5).
    """

    __slots__ = (
        "_alarms", "_bad_scans", "_battery", "_change_any", "_change_base", "_change_max", "_change_per_torque",
        "_complains", "_counts_per_rad", "_deviation_ms", "_doubtful", "_drift", "_drift_keep", "_drift_max",
        "_error_scans", "_error_texts", "_errors_max", "_frozen_scans", "_frozen_speed", "_gap_counts", "_gap_scans",
        "_gap_stands", "_gap_vel", "_gap_way", "_inputs_age", "_jump_base", "_jump_per_speed", "_late_age",
        "_late_scan", "_let_go_scan", "_look", "_old", "_old_scans", "_period_s", "_ratio", "_rest", "_rest_rad_s",
        "_rests_after", "_speed_age", "_speed_late_scan", "_speed_scan", "_spread", "_stands_from", "_step",
        "_step_before", "_swing_nm", "_torque_left_nm", "_torque_twist_nm", "_turn_base", "_turn_per_torque",
        "_turn_scan", "_turn_vel", "_twist_share", "_uneven_scan", "_vel_before", "_vel_max", "_was_energised", "age",
        "brake_contact", "brake_open", "counts", "encoder_alarm", "error_code", "in_doubt", "inputs", "motor_temp_c",
        "overload", "periods", "pos_ring_rad", "read_rad", "state", "state_old", "torque_limited", "torque_nm",
        "unchanged_scans", "vel_rad_s", "warning",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings, alarms: AlarmLog) -> None:
        law, monitors, period_s = settings.law, settings.monitors, settings.period_s
        self._alarms = alarms
        self._error_texts = settings.error_texts
        self.read_rad = settings.travel.read_rad
        self._period_s, self._rest_rad_s = period_s, settings.speed.rest_rad_s
        self._ratio = law.ratio
        self._counts_per_rad = law.counts_per_turn * law.ratio / (2.0 * math.pi)
        self._jump_per_speed = period_s * self._counts_per_rad
        # Never more than hides a jump of 0.05 deg, also where the scan is long.
        self._jump_base = (
            min(
                monitors.encoder_jump_base_rad + monitors.encoder_jump_speed_rad_s * period_s,
                monitors.encoder_drift_max_rad,
            )
            * self._counts_per_rad
        )
        self._drift_max = monitors.encoder_drift_max_rad * self._counts_per_rad
        self._drift_keep = max(0.0, 1.0 - period_s / _DRIFT_TIME_S)
        self._vel_max = monitors.speed_reading_max_rad_s
        self._deviation_ms = 1e3 * monitors.velocity_deviation_time_s
        self._change_base = monitors.speed_change_base_rad_s
        self._change_any = monitors.speed_change_max_rad_s2 * period_s
        self._change_per_torque = monitors.speed_change_per_torque * period_s
        # Of an axis that follows or stops by the drive, without torque that explains more.
        self._change_max = (
            self._change_base + settings.ramps.quick_dec_rad_s2 * period_s
            if self._change_any < math.inf
            else math.inf
        )
        # A speed that is turned round within a scan was there for half of it, at most, and is for the other half.
        self._turn_per_torque = 0.5 * self._change_per_torque
        self._turn_base = 0.0 if monitors.encoder_shows_twist else self._change_base
        self._swing_nm = _SWINGS_SHARE * settings.power.torque_max_nm
        # The torque by which the gear is still twisted, of the scans before this one.
        self._twist_share, self._torque_twist_nm = min(1.0, period_s / _UNTWISTS_S), 0.0
        self._frozen_speed = monitors.encoder_frozen_speed_rad_s
        by_brake = _BRAKE_DEC_SHARE * monitors.speed_change_max_rad_s2
        by_drive = by_brake if by_brake == math.inf else _QUICK_DEC_FACTOR * settings.ramps.quick_dec_rad_s2
        # Fastest that an axis can come to exact rest from, by the end of a scan: brake closed, brake open.
        self._stands_from = tuple(self._frozen_speed + dec * period_s for dec in (by_brake, by_drive))
        self._frozen_scans = settings.scans(monitors.encoder_frozen_time_s, least=3)
        self._error_scans = settings.scans(monitors.encoder_errors_time_s, least=monitors.encoder_errors_max)
        self._errors_max = monitors.encoder_errors_max
        self._battery = monitors.encoder_battery
        # At least three scans: one or two late telegrams are bridged (A16).
        self._old_scans = max(3, int(monitors.reading_age_s / period_s + 1e-9))
        self._bad_scans: deque[int] = deque(maxlen=self._errors_max)
        self._late_scan, self._late_age, self._let_go_scan = -10, 0, -1
        # The last in which the speed was older than the position; the last of a gap in which it was not of its scan.
        self._speed_scan = self._speed_late_scan = -10
        self._uneven_scan = -10  # the last whose step took more or less than a scan
        # The last change of the speed that was looked at without torque: in which scan, from which speed.
        self._turn_scan, self._turn_vel, self._torque_left_nm = -10, 0.0, 0.0
        # `_look`: the reading of the next scan is looked at closely, whatever it says.
        self._look = self.encoder_alarm = self.in_doubt = self._old = self._doubtful = self._complains = False
        self._rest: tuple[Any, ...] = ()
        # `_gap_way`: by the speeds that were told while positions were missing, less what has come of it, counts;
        # `_gap_scans`: how many scans.
        self._drift = self._step = self._step_before = self._vel_before = self._gap_way = self._spread = 0.0
        self.unchanged_scans, self.periods, self.error_code = 0, 1, 0
        # Count and speed before the last gap, and of its square the shortest way to rest, counts: full torque and brake
        # on the bare rotor. Scans of a gap in which the speed, which goes on to come, stands at nothing.
        self._gap_counts, self._gap_vel, self._gap_stands = math.nan, 0.0, 0
        self._rests_after = 0.5 * self._counts_per_rad / monitors.speed_change_max_rad_s2
        self.age = self._speed_age = self._inputs_age = self._gap_scans = 0
        self.brake_contact = True
        self._was_energised = self.state_old = False
        self.state = DriveState.UNKNOWN
        self.inputs = DigitalInputs()
        self.motor_temp_c: float | None = None
        self.counts: float = math.nan
        self.vel_rad_s = self.torque_nm = self.overload = self.pos_ring_rad = 0.0
        self.brake_open = self.torque_limited = self.warning = False

    @property
    def error_words(self) -> Words | Said:
        """What the error code of the drive means."""
        return drive_error_words(self.error_code, self._error_texts)

    @property
    def position_valid(self) -> bool:
        """The angle is known: the reading is neither in doubt nor too old."""
        return not (self.in_doubt or self._old)

    def scan(self, drive: DriveFeedback, vel_cmd_rad_s: float) -> None:
        """Take the reading of this scan; `vel_cmd_rad_s` is the speed command of the last scan, motor side."""
        state_before, torque_before_nm = self.state, self.torque_nm
        self._torque_twist_nm += self._twist_share * (torque_before_nm - self._torque_twist_nm)
        (
            self.state, counts, vel_motor, self.torque_nm, self.brake_open, self.torque_limited, self.overload,
        ) = drive[:_CHANGING]  # fmt: skip
        # The rest is the same in nearly every scan: a comparison costs a third of taking it apart.
        rest = drive[_CHANGING:]
        if rest != self._rest:
            self._take_rest(rest)
        if self.state is not state_before:
            self._state_changed(state_before)
            if state_before in ENERGISED:
                self._torque_left_nm = abs(torque_before_nm)
        if self._complains:
            self._complaint(drive)
        # Comparisons of every normal scan, written so that NaN fails them: the step of the position against the speed
        # of before, the change of the speed, the sum of the steps against the speed.
        step = counts - self.counts
        before, vel = self.vel_rad_s, vel_motor / self._ratio
        jump, change = step - before * self._jump_per_speed, vel - before
        way = vel * self._jump_per_speed * self.periods
        drift = self._drift = self._drift * self._drift_keep + step - way
        base, change_max, drift_max = self._jump_base, self._change_max, self._drift_max
        if (
            self._doubtful
            or self._look
            or not (-base <= jump <= base and -change_max <= change <= change_max)
            or not -drift_max <= drift <= drift_max
        ):
            counts, vel = self._look_closely(counts, vel, step, drive.encoder, drive.age_scans)
            if self._gap_scans:
                # Of several scans, or a step of 0.5 deg looked like 925 deg/s before it stood (E4).
                step /= self._gap_scans + 1.0
        if step == 0.0:
            self._unchanged(vel_cmd_rad_s, drive.age_scans)
        else:
            self.unchanged_scans = 0
            self._step_before, self._step = self._step, step / self.periods
        self.counts = counts
        self.vel_rad_s = vel

    def _take_rest(self, rest: tuple[Any, ...]) -> None:
        """Take what of the feedback hardly ever changes."""
        self._rest = rest
        (
            encoder, self.error_code, self.warning, self.age, self.inputs, self.pos_ring_rad, link, changed,
            self.motor_temp_c, self._speed_age, self._inputs_age, self.brake_contact, self._spread, _,
        ) = rest  # fmt: skip
        self._doubtful = bool(encoder is not _NO_FLAG or self.age or self._speed_age or self._spread)
        self._complains = bool(link or changed)

    def _complaint(self, drive: DriveFeedback) -> None:
        if drive.link:
            self._link(drive.link, drive.age_scans, drive.foreign_id)
        if drive.changed:
            self._alarms.raise_(Code.DRV_09, measured=drive.changed)

    def lasting(self, count: int) -> int:
        """Next count of a condition that holds in this scan: begun before missed scans, it has lasted over them."""
        return count + self.periods if count else 1

    def brake_opens(self, settles_scans: int) -> None:
        """The brake opens, and lets go what the gear was twisted by, of which no torque tells.

        Of a load that nobody has learned yet: 290 kN m of wind threw the rotor of a yaw drive with 11 deg/s2 until its
        torque came, a scan later.
        """
        self._let_go_scan = self._alarms.scan + settles_scans

    def accept_position(self) -> None:
        """Take the present reading as valid: service has compared the angle."""
        self.in_doubt = False
        self._bad_scans.clear()
        self.unchanged_scans = 0
        self._drift = 0.0

    def report_frozen(self, vel_cmd_rad_s: float) -> None:
        """Raise ENC-02: the count stands still although a speed is commanded, or was there."""
        time_ms = self.unchanged_scans * self._period_s * 1e3
        command = abs(vel_cmd_rad_s) / self._ratio
        words = Words.WHILE_COMMANDED if command >= self._vel_before else Words.WHILE_READ
        self.doubt(Code.ENC_02, measured=words(value=deg(max(command, self._vel_before))), time_ms=time_ms)

    def doubt(self, code: Code, /, **values: object) -> None:
        """Raise `code`, which puts the reading in doubt: torque off and brake, the angle is not known."""
        self.in_doubt = True
        self._alarms.raise_(code, Reaction.TORQUE_OFF, **values)

    def disobeyed(self, code: Code, /, **values: object) -> None:
        """Raise `code`, torque off: the axis does not go where it is told to.

        Its torque tells whether the drive or the sign of the reading is wrong (`Liveness.drive_against`). Where that is
        older than the speed nothing does, and the angle is not known. Telegrams that were too late in this stop may
        come late still: none carries its time.
        """
        late = self.age > 0 or not _TOO_LATE.isdisjoint(self._alarms.active)
        self.in_doubt = self.in_doubt or late
        self._alarms.raise_(code, Reaction.TORQUE_OFF, **values)

    def where(self, pos_rad: float) -> Said | Words:
        """An angle for the text of an alarm, as people read it and as far as it is known."""
        return Words.AT(value=deg(self.read_rad(pos_rad))) if self.position_valid else Words.AT_UNKNOWN

    def where_moving(self, pos_rad: float) -> Said | Words:
        """The same with the speed."""
        if not self.position_valid:
            return Words.AT_UNKNOWN
        return Words.AT_SPEED(value=deg(self.read_rad(pos_rad)), speed=deg(self.vel_rad_s))

    @property
    def slow(self) -> bool:
        """The speed of this scan is that of an axis at rest; False for NaN."""
        return -self._rest_rad_s < self.vel_rad_s < self._rest_rad_s

    @property
    def speed_known(self) -> bool:
        """The speed, told or from the position, is not older than a reading may be."""
        return min(self._speed_age, self.age) < self._old_scans

    @property
    def speed_age_s(self) -> float:
        """Age of that speed."""
        return min(self._speed_age, self.age) * self._period_s

    @property
    def silent(self) -> bool:
        """No telegram of the drive comes: a speed that is known all the same was asked for."""
        return min(self.age, self._inputs_age) >= self._old_scans

    @property
    def brake_known(self) -> bool:
        """A contact says whether the brake is open, and its telegram is not too old."""
        return self.brake_contact and self._inputs_age < self._old_scans

    @property
    def brake_off(self) -> bool:
        """The brake is open: its contact says so, or the axis has moved on freely for long against what that says.

        A contact that is believed closed then explains an encoder that freezes in the stop that follows (C6, then A3: a
        yaw drive went on by 716 N m, and nobody was told).
        """
        if self.brake_open:
            return True
        moved = self._alarms.active.get(Code.BRK_05)
        return moved is not None and moved.reaction < Reaction.TORQUE_OFF

    @property
    def energised(self) -> bool:
        """The motor has torque; of a drive that is not heard any more, whether it had."""
        return self.state in ENERGISED or (self.state is DriveState.UNKNOWN and self._was_energised)

    def _state_changed(self, before: DriveState) -> None:
        if before is not DriveState.UNKNOWN:
            self._was_energised = before in ENERGISED
        self.state_old = False

    def _link(self, link: LinkFlag, age: int, foreign_id: int) -> None:
        """Raise the alarm of the connection to the drive; the reading of a lost drive is not valid."""
        # A drive that booted again has lost its mapping: what arrives may be anything.
        if age and link & _LOST:
            self.in_doubt = True
        for flags, code, words in _LINK_CODES:
            if link & flags == flags:
                if words is not None:
                    self._alarms.raise_(code, measured=words)
                elif code is not Code.CAN_12:
                    self._alarms.raise_(code)
                break
        # It follows from whatever else is wrong, and locks.
        if link & LinkFlag.OTHER_MASTER:
            self._alarms.raise_(Code.CAN_12, measured=foreign_words(foreign_id))
        if link & LinkFlag.LATE and not link & _LOST:
            self._late(age)
        if link & _COMPLAINTS:
            self._complaints(link)

    def _complaints(self, link: LinkFlag) -> None:
        """Raise what does not doubt the connection itself: SYNC, emergency messages."""
        if link & LinkFlag.NEVER_FOLLOWED:
            self._alarms.raise_(Code.DRV_05, measured=Words.NEVER_FOLLOWED(limit=self._deviation_ms))
        if link & LinkFlag.EMERGENCY:
            self._alarms.raise_(Code.DRV_12, measured=self.error_words)
        if link & LinkFlag.EMERGENCY_FLOOD:
            self._alarms.raise_(Code.CAN_09)
        if link & LinkFlag.SYNC_JITTER:
            self._alarms.raise_(Code.CAN_02)
        for flag, disturbed in _BUS_WARNINGS:
            if link & flag and not link & LinkFlag.BUS_DOWN:
                self._alarms.raise_(Code.CAN_15, measured=disturbed)

    def _late(self, age: int) -> None:
        """Raise CAN-03 for a telegram that is missing for too long; a state that is too old is not known."""
        if age >= self._old_scans:
            self._state_changed(self.state)
            self.state, self.state_old = DriveState.UNKNOWN, True
        for words, each in ((Words.TELEGRAM_POSITION, age), (Words.TELEGRAM_INPUTS, self._inputs_age)):
            if each >= self._old_scans:
                period_ms = self._period_s * 1e3
                limit = self._old_scans * period_ms
                self._alarms.raise_(Code.CAN_03, measured=words, time_ms=each * period_ms, limit=limit)
                return

    def _look_closely(
        self, counts: float, vel_rad_s: float, step: float, encoder: EncoderFlag, age: int
    ) -> tuple[float, float]:
        """Judge a first reading, flags, an old reading, or one that does not fit the scans before.

        Returns count and speed to go on with.
        """
        self.encoder_alarm = bool(encoder & EncoderFlag.ALARM)
        if self.encoder_alarm:
            self.doubt(Code.ENC_05)
        if encoder & EncoderFlag.WARNING:
            self._alarms.raise_(Code.ENC_06)
        if encoder & EncoderFlag.BATTERY and self._battery:
            self._alarms.raise_(Code.ENC_13)
            # At the start nothing proves the turns; while the encoder has its supply, the battery counts nothing.
            if math.isnan(self.counts):
                self.in_doubt = True
        scan = self._alarms.scan
        missed = self._missed(scan, age)
        self._look = self.encoder_alarm or age > 0
        self._old = age >= self._old_scans
        if self._old and Code.CAN_03 not in self._alarms.active:
            period_ms = self._period_s * 1e3
            self._alarms.raise_(Code.CAN_07, measured=age * period_ms, limit=self._old_scans * period_ms)
        # A late telegram may have been sampled late too: one scan more.
        scans = self.periods + (missed + 1 if missed else 0) + self._spread
        # A computer that holds the controller up between its clock and SYNC moves the sample, not the axis.
        self._drift -= vel_rad_s * self._jump_per_speed * self._spread
        if self._speed_age > age and math.isfinite(step):
            # Position and speed come in telegrams of their own: what is old is no measure of what is new. A speed from
            # one step of the position is as wrong as its sample was late (a quarter for 1 ms of a scan of 4 ms), so
            # the one that was told stands until it is too old.
            if missed or self._speed_age < self._old_scans:
                vel_rad_s = self.vel_rad_s
            self._speed_scan = scan
            self._drift = 0.0
        else:
            behind = scan - self._speed_scan <= 1 + self.periods
            vel_rad_s = self._speed(vel_rad_s, step, scans + (self._old_scans if behind else 0))
        self._gap_way += vel_rad_s * self._jump_per_speed * self.periods * (age > 0)
        if age > 0:
            self._stands_in_gap(vel_rad_s)
        if not math.isfinite(counts):
            self._drift = 0.0
            self.doubt(Code.CTL_02, measured=Words.ENCODER_COUNT)
            return self.counts, vel_rad_s
        if encoder & EncoderFlag.CRC_ERROR:
            self._drift = 0.0
            return self._bad_reading(counts), vel_rad_s
        if math.isnan(self.counts):  # the first reading: nothing to compare with
            self._drift = 0.0
        else:
            self._judge_step(step, vel_rad_s, scans, late=missed > 0)
            # What has come is told no more, or a bus on which every telegram is late would hide any jump.
            self._gap_way -= step
        return counts, vel_rad_s

    def _missed(self, scan: int, age: int) -> int:
        """How many positions are missing, or were before this one; 0 for none."""
        since = scan - self._late_scan
        if age:
            if since > 1 + self.periods:
                self._gap_way, self._gap_counts, self._gap_vel = 0.0, self.counts, abs(self.vel_rad_s)
            self._late_scan, self._late_age, since = scan, age, 0
        # The first telegram after missing ones may still be an old one, so two readings are judged by their age.
        self._gap_scans = self._late_age if since <= 1 + self.periods else 0
        return self._gap_scans

    def _speed(self, vel_rad_s: float, step: float, scans: float) -> float:
        """Judge the speed; in place of an impossible one the speed of this step of the position."""
        before = self.vel_rad_s
        if not math.isfinite(vel_rad_s):
            self.doubt(Code.CTL_02, measured=Words.SPEED_READING)
            return self._speed_of(step)
        if abs(vel_rad_s) > self._vel_max:
            self.doubt(Code.ENC_14, measured=Words.SPEED(value=deg(vel_rad_s)), limit=deg(self._vel_max))
            return self._speed_of(step)
        scans = max(1.0, scans)
        change, limit = vel_rad_s - before, self._change_base + self._change_any * scans
        # Around late telegrams speeds of several scans are compared.
        if (
            scans == 1.0
            and self._alarms.scan - self._late_scan > _LATE_SCANS
            and self.state in ENABLED
            and self.brake_off
            and self._alarms.scan > self._let_go_scan
        ):
            # The torque of now that acts in the direction of the change, and what has just gone of one against it: the
            # gear that it had twisted turns the shaft (a limit that falls in a quick stop, 0.36 deg/s in 10 ms). A
            # coupling that slips, or an encoder that freezes, changes the speed against the torque that answers it,
            # and that grows.
            sign = math.copysign(1.0, change)
            # One that was absurd, or no number, has twisted nothing.
            if not abs(self._torque_twist_nm) <= self._swing_nm / _SWINGS_SHARE:
                self._torque_twist_nm = 0.0
            now_nm = sign * self.torque_nm
            torque_nm = max(0.0, now_nm) + max(0.0, min(now_nm, 0.0) - sign * self._torque_twist_nm)
            limit = min(limit, self._change_max + self._change_per_torque * torque_nm)
        # The axis may turn in the first scan: nothing to compare with.
        if abs(change) > limit and not math.isnan(self.counts):
            self.doubt(
                Code.ENC_14,
                measured=Words.SPEED_CHANGE(before=deg(before), value=deg(vel_rad_s)),
                limit=deg(limit),
            )
        elif scans == 1.0 and self._alarms.scan - self._late_scan > _LATE_SCANS and not self.energised:
            self._judge_turn(before, vel_rad_s)
        return vel_rad_s

    def _speed_of(self, step: float) -> float:
        """Speed by one step of the position; that of before where the step says nothing either.

        A load that moves is still seen by it. What was added up with an impossible speed says nothing.
        """
        self._drift = 0.0
        vel_rad_s = step / (self._jump_per_speed * self.periods)
        return vel_rad_s if abs(vel_rad_s) <= self._vel_max else self.vel_rad_s

    def _judge_turn(self, before: float, vel_rad_s: float) -> None:
        """Without torque no speed turns round within a scan, but by a reading whose sign turns.

        A sign that turns within a scan shows in two: the sum of its parts may be nothing in the first.
        """
        scan = self._alarms.scan
        limit = self._turn_base + self._turn_per_torque * (self._torque_left_nm + self._swing_nm)
        earlier = self._turn_vel if self._turn_scan == scan - 1 else 0.0
        self._turn_scan, self._turn_vel = scan, before
        for since, most in ((before, limit), (earlier, 2.0 * limit)):
            if since * vel_rad_s < 0.0 and min(abs(since), abs(vel_rad_s)) > most:
                self.doubt(
                    Code.ENC_14,
                    measured=Words.SPEED_CHANGE(before=deg(since), value=deg(vel_rad_s)),
                    limit=deg(2.0 * most),
                )
                return

    def _judge_step(self, step: float, vel_rad_s: float, scans: float, *, late: bool) -> None:
        """Compare a step of the position, over so many scans, with the speeds before and after it."""
        if scans != 1.0:
            self._uneven_scan = self._alarms.scan
        per_deg = self._counts_per_rad * math.pi / 180.0
        way, way_now = (speed * self._jump_per_speed * scans for speed in (self.vel_rad_s, vel_rad_s))
        # Over more than a scan the speed may have been any between, and a late reading may be one of the start. Speeds
        # that have come without positions tell the way: of a stop, none of these (E4 for 0.5 s in a ramp, ENC-01).
        ways = [way] if scans <= 1.0 else [way, way_now]
        if late:
            ways += [0.0, self._gap_way + self.vel_rad_s * self._jump_per_speed]
        beyond = max(step - max(ways), min(ways) - step)
        if not beyond <= self._jump_base:
            self._drift = 0.0
            self.doubt(Code.ENC_01, measured=beyond / per_deg, limit=self._jump_base / per_deg)
        elif scans > 1.0:
            # Steps and speeds of several scans cannot be added up one by one.
            self._drift = 0.0
        elif not abs(self._drift) <= self._drift_max:
            drift, self._drift = self._drift, 0.0
            # A position that stands while the speed goes on is a frozen one.
            if step == 0.0:
                self.unchanged_scans = max(1, self.unchanged_scans)
                self._vel_before = abs(vel_rad_s)
                self.report_frozen(0.0)
            else:
                away = Words.POSITION_AWAY(value=drift / per_deg, limit=self._drift_max / per_deg)
                self.doubt(Code.ENC_12, measured=away)

    def _bad_reading(self, counts: float) -> float:
        """Bridge a reading with a checksum error by a prediction; too many of them are a fault (A4, A5)."""
        scan = self._alarms.scan
        # The speed of the scan before predicts one reading to 0.001 deg (A4).
        self._bad_scans.append(scan)
        first = self._bad_scans[0]
        if len(self._bad_scans) == self._errors_max and scan - first < self._error_scans:
            time_ms = (scan - first + 1) * self._period_s * 1e3
            self.doubt(Code.ENC_04, measured=self._errors_max, limit=self._errors_max, time_ms=time_ms)
        else:
            self._alarms.raise_(Code.ENC_03, measured=1)
        if math.isnan(self.counts):
            return counts
        # Without a finite speed there is nothing to predict with, and the speed has raised its own alarm.
        if not math.isfinite(self.vel_rad_s):
            return self.counts
        return self.counts + round(self.vel_rad_s * self._jump_per_speed * self.periods)

    def _stands_in_gap(self, vel_rad_s: float) -> None:
        """Positions are missing, and a speed that comes in telegrams of its own falls to exactly nothing and stays.

        No axis comes to rest so within a scan. An encoder that froze 20 ms after its last position was called valid
        1.2 deg from the truth when positions came again (E4 or E7, then A2, at 1 deg/s).
        """
        scan, late_scan = self._alarms.scan, self._speed_late_scan
        if self._speed_age:
            self._speed_late_scan = scan
        if vel_rad_s != 0.0 or self._speed_age:
            self._gap_stands = 0
            return
        if not self._gap_stands:
            # A speed of several scans before says nothing of this one.
            even = scan - late_scan > self.periods and not self._spread
            if not (even and abs(self.vel_rad_s) > self._stands_from[self.brake_off]):
                return
            self._vel_before = abs(self.vel_rad_s)
        self._gap_stands = self.lasting(self._gap_stands)
        if self._gap_stands >= self._frozen_scans:
            self.unchanged_scans = self._gap_stands
            self.report_frozen(0.0)

    @property
    def _froze_in_gap(self) -> bool:
        """Positions that come again stand nearer to the last one, which was in motion, than any axis comes to rest.

        From 1 deg/s that takes 0.003 deg with 169 deg/s2, 39,000 counts of 2^22: an encoder that freezes in the scan of
        the first missing telegram is found, one that freezes later by its speed alone. An old telegram behind the gap
        stands for a scan.
        """
        if self._alarms.scan - self._late_scan > _LATE_SCANS + self._frozen_scans:
            return False
        least = self._rests_after * self._gap_vel * self._gap_vel
        return self._gap_vel > self._frozen_speed and abs(self.counts - self._gap_counts) < least

    def _unchanged(self, vel_cmd_rad_s: float, age: int) -> None:
        """Count scans with the same reading: frozen, when they last while a speed is commanded or was there (A2)."""
        if age:
            self.unchanged_scans = 0
            return
        if not self.unchanged_scans:
            shown = abs(self._step) / self._jump_per_speed
            before = abs(self._step_before) / self._jump_per_speed
            self._vel_before = max(abs(self.vel_rad_s), shown)
            # An encoder that froze within the last scan has shown a part of its way there: what is missing is more than
            # the brake takes, which may be closing whatever its contact says.
            even = self._alarms.scan - self._uneven_scan > _STEPS
            if before - shown > max(self._stands_from) and even:
                self._vel_before = before
            self._step = self._step_before = 0.0
        # At 0.1 deg/s the reference encoder counts 1333 in a millisecond; with 8192 increments a turn, 26 in ten.
        commanded = abs(vel_cmd_rad_s) > self._frozen_speed * self._ratio
        if self._froze_in_gap:
            self._vel_before = max(self._vel_before, self._gap_vel)
        elif not (commanded or self._vel_before > self._stands_from[self.brake_off]):
            self.unchanged_scans = 0
            return
        self.unchanged_scans = self.lasting(self.unchanged_scans)
        if self.unchanged_scans >= self._frozen_scans:
            self.report_frozen(vel_cmd_rad_s)
