"""The reading of this scan, at the gantry, and the plausibility checks of the encoder."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from gantryctl.image import DigitalInputs, DriveFeedback, DriveState, EncoderFlag, LinkFlag
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Words
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg

# States in which the motor has torque.
ENABLED: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
FAULTS: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
_NO_FLAG: Final = EncoderFlag.NONE
_LOST: Final = LinkFlag.BUS_DOWN | LinkFlag.RESTARTED | LinkFlag.HEARTBEAT_LOST | LinkFlag.NOT_OPERATIONAL
# In this order: the first that applies is the cause, the others follow from it.
_LINK_CODES: Final = (
    (LinkFlag.BUS_DOWN, Code.CAN_08),
    (LinkFlag.RESTARTED, Code.DRV_11),
    (LinkFlag.HEARTBEAT_LOST, Code.CAN_06),
    (LinkFlag.NOT_OPERATIONAL, Code.CAN_13),
    (LinkFlag.OTHER_MASTER, Code.CAN_12),
    (LinkFlag.IGNORES_COMMAND, Code.DRV_05),
)


class Feedback:
    """Reading of the drive, and the monitors of the encoder (faults A1 to A7, A16).

    Every alarm that doubts the position is TORQUE OFF, and the position is not valid until service resets: a quick
    stop on a wrong encoder runs away. With a frozen one it went 1205 deg in 60 s from 6 deg/s, on a rigid model with
    the paper's gains, where torque off and brake take 3.3 deg.

    Attributes:
        counts: encoder count used this scan; a single bad reading is replaced by a prediction.
        vel_rad_s: the drive's speed at the gantry.
        pos_ring_rad: reading of a load-side encoder, unchecked; 0 without one.
        position_valid: False after a fault of the encoder.
        unchanged_scans: scans without a new count while a speed is commanded.
        periods: scan periods since the scan before: 1, and more where scans were missed. Every count of scans that
            stands for a time counts these (decision 5).
    """

    __slots__ = (
        "_alarms", "_bad_scans", "_battery", "_counts_per_rad", "_doubt", "_error_scans", "_errors_max",
        "_frozen_scans", "_frozen_speed", "_jump_base", "_jump_per_speed", "_late_age", "_late_scan", "_old_scans",
        "_period_s", "_ratio", "brake_open", "counts", "encoder_alarm", "error_code", "inputs", "motor_temp_c",
        "overload", "periods", "pos_ring_rad", "position_valid", "state", "torque_limited", "torque_nm",
        "unchanged_scans", "vel_rad_s", "warning",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings, alarms: AlarmLog) -> None:
        law, monitors, period_s = settings.law, settings.monitors, settings.period_s
        self._alarms = alarms
        self._period_s = period_s
        self._ratio = law.ratio
        self._counts_per_rad = law.counts_per_turn * law.ratio / (2.0 * math.pi)
        self._jump_per_speed = period_s * self._counts_per_rad
        self._jump_base = (
            monitors.encoder_jump_base_rad * self._counts_per_rad
            + monitors.encoder_jump_speed_rad_s * self._jump_per_speed
        )
        self._frozen_speed = monitors.encoder_frozen_speed_rad_s * law.ratio
        self._frozen_scans = settings.scans(monitors.encoder_frozen_time_s, least=3)
        self._error_scans = settings.scans(monitors.encoder_errors_time_s, least=monitors.encoder_errors_max)
        self._errors_max = monitors.encoder_errors_max
        self._battery = monitors.encoder_battery
        # At least three scans: one or two late telegrams are bridged (A16).
        self._old_scans = max(3, int(monitors.reading_age_s / period_s + 1e-9))
        self._bad_scans: deque[int] = deque(maxlen=self._errors_max)
        self._late_scan, self._late_age = -10, 0
        self._doubt = self.encoder_alarm = False
        self.position_valid = True
        self.unchanged_scans, self.periods, self.error_code = 0, 1, 0
        self.state = DriveState.UNKNOWN
        self.inputs = DigitalInputs()
        self.motor_temp_c: float | None = None
        self.counts: float = math.nan
        self.vel_rad_s = self.torque_nm = self.overload = self.pos_ring_rad = 0.0
        self.brake_open = self.torque_limited = self.warning = False

    def scan(self, drive: DriveFeedback, vel_cmd_rad_s: float) -> None:
        """Take the reading of this scan; `vel_cmd_rad_s` is the speed command of the last scan, motor side."""
        (
            self.state, counts, vel_motor, self.torque_nm, self.brake_open, self.torque_limited, self.overload,
            encoder, self.error_code, self.warning, age, self.inputs, self.pos_ring_rad, link, changed,
            self.motor_temp_c,
        ) = drive  # fmt: skip
        if link:
            self._link(link, age)
        if changed:
            self._alarms.raise_(Code.DRV_09, measured=changed)
        # One comparison for every normal scan; it is written so that NaN fails it.
        step = counts - self.counts
        vel = self.vel_rad_s
        allowed = self._jump_base + (vel if vel >= 0.0 else -vel) * self._jump_per_speed
        if encoder is not _NO_FLAG or age or self._doubt or not -allowed <= step <= allowed:
            counts = self._doubtful(counts, step, encoder, age)
        if step == 0.0:
            self._unchanged(vel_cmd_rad_s, age)
        else:
            self.unchanged_scans = 0
        self.counts = counts
        self.vel_rad_s = vel_motor / self._ratio

    def lasting(self, count: int) -> int:
        """Next count of a condition that holds in this scan: begun before missed scans, it has lasted over them."""
        return count + self.periods if count else 1

    def accept_position(self) -> None:
        """Take the present reading as valid: service has compared the angle."""
        self.position_valid = True
        self._bad_scans.clear()
        self.unchanged_scans = 0

    def report_frozen(self, vel_cmd_rad_s: float) -> None:
        """Raise ENC-02: the count stands still although a speed is commanded."""
        time_ms = self.unchanged_scans * self._period_s * 1e3
        self._raise(Code.ENC_02, measured=deg(abs(vel_cmd_rad_s) / self._ratio), time_ms=time_ms)

    def _link(self, link: LinkFlag, age: int) -> None:
        """Raise the alarm of the connection to the drive; the reading of a lost drive is not valid."""
        # A drive that booted again has lost its mapping: what arrives may be anything.
        if age and link & _LOST:
            self.position_valid = False
        for flag, code in _LINK_CODES:
            if link & flag:
                self._alarms.raise_(code)
                return

    def _doubtful(self, counts: float, step: float, encoder: EncoderFlag, age: int) -> float:
        """Judge a first reading, flags, an old reading, or a step that is too large."""
        self.encoder_alarm = bool(encoder & EncoderFlag.ALARM)
        if self.encoder_alarm:
            self._raise(Code.ENC_05)
        if encoder & EncoderFlag.WARNING:
            self._alarms.raise_(Code.ENC_06)
        if encoder & EncoderFlag.BATTERY and self._battery:
            self._alarms.raise_(Code.ENC_13)
            # At the start nothing proves the turns; while the encoder has its supply, the battery counts nothing.
            if math.isnan(self.counts):
                self.position_valid = False
        scan = self._alarms.scan
        if age:
            self._late_scan, self._late_age = scan, age
        # The first telegram after missing ones may still be an old one, so two readings are judged by their age.
        missed = self._late_age if scan - self._late_scan <= 1 + self.periods else 0
        self._doubt = self.encoder_alarm or age > 0
        if age >= self._old_scans:
            period_ms = self._period_s * 1e3
            self._alarms.raise_(Code.CAN_07, measured=age * period_ms, limit=self._old_scans * period_ms)
        if not math.isfinite(counts):
            self.position_valid = False
            self._alarms.raise_(Code.CTL_02, Reaction.TORQUE_OFF, measured=Words.ENCODER_COUNT)
            return self.counts
        if encoder & EncoderFlag.CRC_ERROR:
            return self._bad_reading(counts)
        if math.isnan(self.counts):  # the first reading: nothing to compare with
            return counts
        # A late telegram may have been sampled late too: one scan more.
        scans = self.periods + (missed + 1 if missed else 0)
        allowed = (self._jump_base + abs(self.vel_rad_s) * self._jump_per_speed) * scans
        if not -allowed <= step <= allowed:
            per_deg = self._counts_per_rad * math.pi / 180.0
            self._raise(Code.ENC_01, measured=abs(step) / per_deg, limit=allowed / per_deg)
        return counts

    def _bad_reading(self, counts: float) -> float:
        """Bridge a reading with a checksum error by a prediction; too many of them are a fault (A4, A5)."""
        scan = self._alarms.scan
        # The speed of the scan before predicts one reading to 0.001 deg (A4).
        self._bad_scans.append(scan)
        first = self._bad_scans[0]
        if len(self._bad_scans) == self._errors_max and scan - first < self._error_scans:
            time_ms = (scan - first + 1) * self._period_s * 1e3
            self._raise(Code.ENC_04, measured=self._errors_max, limit=self._errors_max, time_ms=time_ms)
        else:
            self._alarms.raise_(Code.ENC_03, measured=1)
        if math.isnan(self.counts):
            return counts
        # Without a finite speed there is nothing to predict with, and the speed has raised its own alarm.
        if not math.isfinite(self.vel_rad_s):
            return self.counts
        return self.counts + round(self.vel_rad_s * self._jump_per_speed * self.periods)

    def _unchanged(self, vel_cmd_rad_s: float, age: int) -> None:
        """Count scans with the same reading: frozen, when they last while a speed is commanded (A2)."""
        # At 0.1 deg/s the reference encoder counts 1333 in a millisecond; with 8192 increments a turn, 26 in ten.
        if age or not abs(vel_cmd_rad_s) > self._frozen_speed:
            self.unchanged_scans = 0
            return
        self.unchanged_scans = self.lasting(self.unchanged_scans)
        if self.unchanged_scans >= self._frozen_scans:
            self.report_frozen(vel_cmd_rad_s)

    def _raise(self, code: Code, /, **values: object) -> None:
        self.position_valid = False
        self._alarms.raise_(code, None, **values)
