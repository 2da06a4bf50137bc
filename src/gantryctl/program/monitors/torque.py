"""Whether motor torque and motion of the shaft belong together: torque lost, shaft blocked, reading wrong."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.power.holding_torque import LEARN_SHARE, HoldingTorque
from gantryctl.program.settings import AxisSettings
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import deg

# Speeds are parts of the permitted deviation of the speed (0.5 deg/s on the reference gantry), torques of the limit
# (385 N m there), so they go with the axis; the figures are that gantry's.
#
# Sound machines with +-20 % on every figure, 16 and 50 kN m, moves, keys and stops: the drive is never more than
# 0.017 deg/s from its command, 0.026 in taps of a key at the rate of the load's swing. A speed loop that has torque
# answers a twentieth of a degree per second with 78 N m.
_DEVIATION_SHARE: Final = 0.1
# A reading of nothing, as part of the rated torque. A swing of the load passes through it in less than 30 ms.
_NOTHING_SHARE: Final = 0.02
_LOST_S: Final = 0.050
# A PI loop answers a deviation. Where its torque stays at nothing for a time t, the deviation shrinks by exp(-t/Tn):
# friction brings the speed to its command, by less than a tenth within 50 ms only with Tn above 0.5 s. Or the torque
# goes on through nothing (a yaw drive that starts against the wind, 5 N m in 50 ms). Without torque the deviation stays
# or grows, and the reading stays, within a noise of three quarters of what counts as nothing.
_SHRINKS_SHARE: Final = 0.9
_MOVES_SHARE: Final = 0.75
# The load swings at 2 Hz, so a mean over 0.3 s takes part in its swing; sound torque leaves this mean by 154 N m at
# most; eight such taps drive it to the torque limit.
_MEAN_S: Final = 0.3
_RISE_SHARE: Final = 60.0 / 385.0
_EFFORT_SHARE: Final = 100.0 / 385.0
# Speed that torque above that should have made and did not, at the gantry, after the shaft was off its command. Sound
# machines: 0.044 deg/s, 0.34 in such taps, where it never is.
_MISSING_SHARE: Final = 0.3
# From one scan to the next sound torque changes by 50 N m at most; a shaft that gets or needs so much more at once
# shows it.
_LEAP_SHARE: Final = 0.8
_LEAP_S: Final = 0.020
# A brake that closes asks for all its torque within some milliseconds, and for good: half of it lies as far from that
# as from nothing, so the brake may have half of its torque, and the load may swing. The permitted ways allow for 60 ms
# of reaction: half to rise against the mean of that time, half to stay. A swing of amplitude A stays above that mean by
# at most 0.84 A (1.03 A at scans of 10 ms) at the worst frequency, 9 to 11 Hz: a slower one does not rise so fast, a
# faster one does not stay. So no load that swings with less than 0.48 of the brake's torque looks like a brake; on the
# reference gantry (2.4 Hz) none does that its motor can swing (`tests/plant/test_brake_grip.py`).
_GRIPS_SHARE: Final = 0.5
_GRIPS_S: Final = 0.030
# A shaft that is started follows within some milliseconds: against a closed brake it creeps at a thirtieth of the
# command, and in taps of a key that swing the load it passes a tenth of it in less than 5 ms.
_STANDS_SHARE: Final = 0.1
_START_SHARE: Final = 0.04
_START_S: Final = 0.010
# Mean torque at standstill, as part of the rated torque: more than LEARN_SHARE warns, more than this is a stop. What
# swings about less is not above it for half a period: a crane of 0.65 Hz swung to 69 % of rated after a jog key.
_TOO_HEAVY_SHARE: Final = 0.9
_HEAVY_PERIODS: Final = 0.5
# With the drive switched off there is no torque to read; the same share is more than any proof may be wrong by.
_OFF_SHARE: Final = 0.1
_OFF_S: Final = 0.100


class TorqueWatch:
    """Compares the reported torque with what the shaft does; for drives that report their torque.

    No figure of the plant is needed. The moment of inertia is bounded by the machine's own quick stop, which must be
    possible within the torque limit: J <= T_max / (i a_quick). Where torque and speed contradict each other,
    the drive has lost its torque (DRV-13), the shaft does not answer (BRK-14), or the reading is wrong (DRV-14).
    A motor that turns its own brake brings the shaft back to its command: then the brake shows as half of its torque
    that comes within 30 ms, holds the shaft back, and stays.
    """

    __slots__ = (
        "_alarms", "_blocked", "_blocked_scans", "_deviation_max", "_effort_nm", "_effort_share",
        "_fast_acc", "_fast_nm", "_fast_share", "_feedback", "_free_acc", "_free_nm", "_grip_nm", "_grips",
        "_grips_scans", "_heavy", "_heavy_nm",
        "_heavy_scans", "_holding", "_known", "_last_nm", "_leap", "_leap_nm", "_leap_scans", "_lost",
        "_lost_nm", "_lost_rad_s", "_lost_scans", "_mean_nm", "_mean_share", "_minus_scan", "_missing",
        "_missing_max", "_nothing_nm", "_off", "_off_nm",
        "_off_scans", "_per_acc", "_period_s", "_plus_scan", "_pos_err_rad", "_pulled", "_rated_nm",
        "_rise_nm", "_start", "_suspicious", "_swing_scans",
        "_vel_start", "_virtual",
    )  # fmt: skip

    def __init__(
        self,
        settings: AxisSettings,
        feedback: Feedback,
        virtual: VirtualAxis,
        holding: HoldingTorque,
        alarms: AlarmLog,
    ) -> None:
        power = settings.power
        self._feedback, self._virtual, self._holding, self._alarms = feedback, virtual, holding, alarms
        self._known = power.torque_preload
        self._period_s = settings.period_s
        self._mean_share = min(1.0, settings.period_s / _MEAN_S)
        self._nothing_nm = _NOTHING_SHARE * power.torque_rated_nm
        self._off_nm = _OFF_SHARE * power.torque_rated_nm
        self._rated_nm = power.torque_rated_nm
        self._heavy_nm = LEARN_SHARE * power.torque_rated_nm
        self._heavy_scans = settings.scans(_HEAVY_PERIODS * settings.monitors.swing_s)
        deviation = settings.monitors.velocity_deviation_rad_s
        self._deviation_max, self._missing_max = _DEVIATION_SHARE * deviation, _MISSING_SHARE * deviation
        self._start = _START_SHARE * deviation
        self._rise_nm, self._effort_nm = (
            share * power.torque_max_nm for share in (_RISE_SHARE, _EFFORT_SHARE)
        )
        self._leap_nm = _LEAP_SHARE * power.torque_rated_nm
        self._leap_scans = settings.scans(_LEAP_S)
        self._grip_nm, self._grips_scans = _GRIPS_SHARE * power.brake_torque_nm, settings.scans(_GRIPS_S)
        self._fast_share = min(1.0, settings.period_s / _GRIPS_S)
        self._per_acc = power.torque_max_nm / settings.ramps.quick_dec_rad_s2
        self._lost_scans = settings.scans(_LOST_S)
        self._blocked_scans = settings.scans(_START_S)
        self._off_scans = settings.scans(_OFF_S)
        # Speed at the gantry that 1 N m makes in a scan, at least.
        self._effort_share = settings.period_s * settings.ramps.quick_dec_rad_s2 / power.torque_max_nm
        self._off = 0
        self._swing_scans = settings.scans(settings.monitors.swing_s)
        self._plus_scan = self._minus_scan = -self._swing_scans
        self._pos_err_rad = 0.0
        self.begin()

    def begin(self) -> None:
        """Forget what was suspected; the axis follows from the next scan on."""
        self._mean_nm = self._last_nm = self._fast_nm = self._feedback.torque_nm
        self._fast_acc = self._virtual.acc_ref_rad_s2
        self._calm()

    def _calm(self) -> None:
        self._lost = self._blocked = self._leap = self._heavy = self._grips = 0
        self._lost_rad_s = self._lost_nm = 0.0
        self._free_nm = self._free_acc = 0.0
        self._missing = self._vel_start = 0.0
        self._pulled = self._suspicious = False

    def scan(self, deviation_rad_s: float, pos_err_rad: float) -> None:
        """Judge a scan in which the axis follows.

        Args:
            deviation_rad_s: the drive's speed minus its last command.
            pos_err_rad: following error, told beside what is found.
        """
        torque_nm = self._feedback.torque_nm
        rise_nm = torque_nm - self._mean_nm
        self._mean_nm += rise_nm * self._mean_share
        if (
            -self._deviation_max <= deviation_rad_s <= self._deviation_max
            and -self._rise_nm <= rise_nm <= self._rise_nm
            and not self._lost
            and self._holding.believed
        ):
            if self._suspicious:
                self._calm()
            self._last_nm = torque_nm
        elif self._known:
            self._pos_err_rad = pos_err_rad
            self._suspect(torque_nm, rise_nm, deviation_rad_s)
        self._fast_nm += (torque_nm - self._fast_nm) * self._fast_share
        self._fast_acc += (self._virtual.acc_ref_rad_s2 - self._fast_acc) * self._fast_share

    def standing(self) -> None:
        """Judge the torque that holds an axis in position (fault catalogue B7)."""
        if -self._heavy_nm <= self._mean_nm <= self._heavy_nm:
            self._heavy = 0
        elif self._known and self._holding.believed:
            self._heavy = self._feedback.lasting(self._heavy)
            if self._heavy >= self._heavy_scans:
                self._too_heavy()

    def _too_heavy(self) -> None:
        share = abs(self._mean_nm) / self._rated_nm
        # The drive still holds zero speed, so a quick stop is torque at rest, then the brake, then torque off in steps.
        reaction = Reaction.QUICK_STOP if share > _TOO_HEAVY_SHARE else None
        self._alarms.raise_(Code.CTL_06, reaction, measured=100.0 * share, torque=abs(self._mean_nm))

    def scan_released(self) -> None:
        """Judge a scan in which the axis does not follow: switched off there is nothing to read.

        On the ramp of its own fault reaction a drive is not off yet.
        """
        feedback = self._feedback
        if -self._off_nm <= feedback.torque_nm <= self._off_nm:
            if self._off or not self._holding.believed:
                self._sound_again()
        # What a silent drive sent last, while it still had torque, says nothing.
        elif self._known and not (feedback.energised or feedback.age):
            self._off = feedback.lasting(self._off)
            if self._off >= self._off_scans:
                self._wrong_reading(Words.TORQUE_WHILE_OFF(torque=feedback.torque_nm))

    def _sound_again(self) -> None:
        """A reading that is nothing while the drive is off is believed again."""
        self._off = 0
        if not self._feedback.energised:
            self._holding.believed = True

    def _suspect(self, torque_nm: float, rise_nm: float, deviation_rad_s: float) -> None:
        feedback, believed = self._feedback, self._holding.believed
        off_command = not -self._deviation_max <= deviation_rad_s <= self._deviation_max
        # A reading that is not believed may hide that there is nothing: then the speed alone decides.
        nothing = not believed or -self._nothing_nm <= torque_nm <= self._nothing_nm
        shown_nm = torque_nm if believed else 0.0
        self._count_lost(abs(deviation_rad_s), shown_nm, nothing=off_command and nothing)
        if self._lost >= self._lost_scans:
            time_ms = self._lost * self._period_s * 1e3
            self._alarms.raise_(
                Code.DRV_13, measured=torque_nm, deviation=deg(abs(deviation_rad_s)), time_ms=time_ms
            )
        self._pulled = self._pulled or off_command
        if not -self._leap_nm <= torque_nm - self._last_nm <= self._leap_nm:
            self._leap = 1
        self._last_nm = torque_nm
        self._suspicious = True
        if not believed:
            # Only the drive switched off can show that the reading is sound again; a reset cannot.
            self._wrong_reading(Words.TORQUE_STILL_WRONG)
            return
        vel = feedback.vel_rad_s
        command = vel - deviation_rad_s
        stands = abs(command) > self._start and abs(vel) < _STANDS_SHARE * abs(command)
        pushes = rise_nm * command > 0.0 and abs(rise_nm) > self._rise_nm
        self._blocked = feedback.lasting(self._blocked) if stands and pushes else 0
        if self._leap:
            self._leap = feedback.lasting(self._leap)
        if self._blocked >= self._blocked_scans or self._gripped(torque_nm, command):
            self._without_effect(torque_nm, vel, command)
        elif self._leap > self._leap_scans and not self._pulled:
            self._wrong_reading(Words.TORQUE_WITHOUT_EFFECT(change=rise_nm, torque=torque_nm))
        elif -self._effort_nm <= rise_nm <= self._effort_nm:
            self._missing = 0.0
        else:
            self._effort(rise_nm, vel, command)

    def _count_lost(self, off_rad_s: float, torque_nm: float, *, nothing: bool) -> None:
        """Scans without torque, since which neither the deviation has shrunk nor the reading moved on."""
        answered = (
            off_rad_s < _SHRINKS_SHARE * self._lost_rad_s
            or abs(torque_nm - self._lost_nm) > _MOVES_SHARE * self._nothing_nm
        )
        if not nothing or answered:
            self._lost = 0
        if nothing:
            if not self._lost:
                self._lost_rad_s, self._lost_nm = off_rad_s, torque_nm
            self._lost = self._feedback.lasting(self._lost)

    def _gripped(self, torque_nm: float, command: float) -> bool:
        """Half of the brake's torque more than just before, in the direction of motion, and it stays."""
        sign = math.copysign(1.0, command)
        if not self._grips:
            self._free_nm, self._free_acc = self._fast_nm, self._fast_acc
        rise_nm = sign * (torque_nm - self._free_nm)
        # At most what the set-point accelerates with: where it begins to, the torque rises.
        planned_nm = self._per_acc * sign * (self._virtual.acc_ref_rad_s2 - self._free_acc)
        holds_back = self._pulled and abs(command) > self._start
        if not (holds_back and rise_nm - max(0.0, planned_nm) >= self._grip_nm):
            self._grips = 0
            return False
        self._grips = self._feedback.lasting(self._grips)
        return self._grips >= self._grips_scans

    def _effort(self, rise_nm: float, vel: float, command: float) -> None:
        """Add up the speed that the torque should have made, and take off what it has made."""
        if self._missing == 0.0:
            self._vel_start = vel
        now = self._alarms.scan
        if rise_nm > 0.0:
            sign, self._plus_scan, opposite = 1.0, now, self._minus_scan
        else:
            sign, self._minus_scan, opposite = -1.0, now, self._plus_scan
        self._missing += (abs(rise_nm) - self._effort_nm) * self._effort_share * self._feedback.periods
        missing = self._missing - sign * (vel - self._vel_start)
        # Where the shaft was held back and the torque answered. With a load that helps, the motor turns the shaft
        # against a closed brake and is back at its command. A load that swings pulls both ways in turn.
        swings = now - opposite < self._swing_scans
        if self._pulled and missing > self._missing_max and not swings:
            self._without_effect(self._feedback.torque_nm, vel, command)

    def _without_effect(self, torque_nm: float, vel: float, command: float) -> None:
        # A shaft that is held gives way by some counts; one whose count stands is not seen at all.
        if self._feedback.unchanged_scans:
            self._feedback.report_frozen(0.0)
            return
        # A shaft held at rest that turns against its torque is read with the wrong sign.
        if abs(command) <= self._start and torque_nm * vel < 0.0:
            words = Words.GROWS_AGAINST(speed=deg(abs(vel)), torque=torque_nm)
            self._feedback.doubt(Code.ENC_12, measured=words)
            return
        # A shaft that is held and an encoder that is frozen look the same, unless the contact names the brake.
        if self._feedback.brake_open:
            self._feedback.doubt(Code.BRK_14, measured=torque_nm, speed=deg(vel), command=deg(command))
        else:
            error = deg(abs(self._pos_err_rad))
            self._alarms.raise_(Code.BRK_05, Reaction.TORQUE_OFF, measured=deg(vel), error=error)

    def _wrong_reading(self, words: object) -> None:
        self._holding.believed = False
        self._alarms.raise_(Code.DRV_14, measured=words)
