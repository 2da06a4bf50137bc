"""Whether the reading belongs to the shaft: a reading that stands still, or moves against the torque, is tried."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg, rad

# The shaft is moved to and fro by so many counts. A sound encoder of 2^22 counts shows the first; one whose steps are
# coarser than its counts (8192 steps of 512 counts), or a drive with a coarse speed command, needs the last.
_DITHER_COUNTS: Final = (8, 64, 512, 4096)
# Forth and back take this each: a little more than a speed loop needs to follow (5 to 7 ms on the reference machine).
_DITHER_HALF_S: Final = 0.008
# A command acts one scan later and shows one more after that, on a bus.
_DITHER_SHOWS_SCANS: Final = 3
# Where no torque proof has shown the reading, the axis trusts it only this long.
_UNPROVEN_STILL_S: Final = 0.050
_STILL_UNDER_TORQUE_S: Final = 0.030
# Held so long by the drive at rest, and with a reading that lives, the load hangs on the torque of then, whatever has
# been learned by then: what a ramp leaves has gone, and a frozen reading does not live.
_HANGS_S: Final = 0.2
# Speed that a sound axis never gains against the torque of its drive: 0.08 deg/s with 8192 steps. None of 252 sound
# quick stops with a torque limit of 2 to 90 % came to be judged so. Of 180 in which the sign turned 0.2 s before to
# 0.1 s after the end of the ramp (1 and 3 deg/s, 1, 4 and 10 ms) 174 tell no angle; the brake held the other 6.
_GROWTH_RAD_S: Final = rad(0.15)
_FULL_SHARE: Final = 0.8
_SLOW_RAD_S: Final = rad(0.1)


class Liveness:
    """Tries a reading that proves nothing by itself, in every phase with torque.

    A sound fine encoder hardly ever stands still to the count: at most 90 ms on the reference machine with the servo
    holding a load. Where it does, without a load, the shaft is moved to and fro by some counts, which a frozen one
    does not show. A frozen reading behind an eccentric moment is a load that begins to fall.

    Attributes:
        vel_rad_s: speed to be added to the command of this scan, motor side.
        dithers: how often the shaft was moved.
    """

    __slots__ = (
        "_after", "_alarms", "_at", "_back", "_counts", "_counts_per_rad", "_feedback", "_half", "_hangs_nm",
        "_hangs_scans", "_held", "_holding", "_jumped", "_patience", "_period_s", "_scan", "_slowest", "_still",
        "_stood_nm", "_torque_against_nm", "_torque_full_nm", "_torque_nm", "_torque_scan", "_torque_scans",
        "_torque_still_nm", "_tries", "_unproven", "_vel", "dithers", "vel_rad_s",
    )  # fmt: skip

    def __init__(
        self, settings: AxisSettings, feedback: Feedback, holding: HoldingTorque, alarms: AlarmLog
    ) -> None:
        monitors = settings.monitors
        self._feedback, self._holding, self._alarms = feedback, holding, alarms
        self._period_s = settings.period_s
        self._counts_per_rad = settings.law.counts_per_turn / math.tau
        self._half = max(1, round(_DITHER_HALF_S / settings.period_s))
        # Forth, a scan of nothing so that no command reverses at once, back.
        self._back = self._half + 2
        self._after = self._back + self._half + _DITHER_SHOWS_SCANS
        dithers = math.isfinite(monitors.encoder_still_time_s)
        self._patience = settings.scans(monitors.encoder_still_time_s) if dithers else math.inf
        self._unproven = settings.scans(_UNPROVEN_STILL_S) if dithers else math.inf
        self._torque_scans = settings.scans(_STILL_UNDER_TORQUE_S, least=3)
        self._torque_still_nm = monitors.torque_still_max_nm
        # No load needs more than the brake is tested with; more of it against a motion brakes the motion.
        self._torque_against_nm = settings.power.test_torque_nm
        self._torque_full_nm = _FULL_SHARE * settings.power.torque_max_nm
        self._hangs_scans = settings.scans(_HANGS_S)
        self._counts = self._slowest = self._stood_nm = self._torque_nm = self._hangs_nm = math.nan
        self._scan = self._torque_scan = -2
        self._still = self._at = self._tries = self._held = self.dithers = 0
        self.vel_rad_s = self._vel = 0.0
        self._jumped = False

    @property
    def answer_s(self) -> float:
        """Longest time for which a frozen reading of an axis held at rest is believed; inf where none is asked."""
        tries = len(_DITHER_COUNTS) * (self._after + 1)
        return (self._patience + tries) * self._period_s

    @property
    def asking(self) -> bool:
        """The shaft is being moved to and fro, and what stands through it is frozen."""
        return self._at > 0

    # --- standing ---------------------------------------------------------------------------------

    def stand(self, *, proven: bool) -> None:
        """One scan of an axis that the drive holds at rest by speed commands; `proven`: by a torque proof."""
        self._watch_still()
        self._held += self._feedback.periods
        if self._held > self._hangs_scans and not self._still:
            self._hangs_nm = self._feedback.torque_nm
        if self._at:
            self._go_on()
        elif self._torque_leaves() or self._still >= (self._patience if proven else self._unproven):
            self._begin()

    def move(self) -> None:
        """One scan of an axis in motion: nobody asks, but a reading that froze near its end is asked at rest.

        A crane of 0.84 Hz ends its ramp in 0.18 s below 0.1 deg/s; 87 N m had left by then (axes 1062).
        """
        self._held, self._hangs_nm = 0, math.nan
        self._at, self.vel_rad_s = 0, 0.0
        self._watch_still()

    def stop(self) -> None:
        """One scan of a drive that comes to rest, or holds, without the controller's speed commands."""
        self._watch_still()
        if self._still < self._torque_scans:
            return
        # Half a second after the first power-up nobody had learned the 56 N m of wind on a telescope that parked.
        if abs(self._feedback.torque_nm - self._hangs_nm) <= self._torque_still_nm:
            return
        torque_nm = self._feedback.torque_nm - self._holding.mean_nm
        if not abs(torque_nm) <= self._torque_still_nm:
            self._frozen(Words.WHILE_TORQUE(value=torque_nm))

    def _watch_still(self) -> None:
        """Count how long the reading has stood to the count."""
        feedback, scan = self._feedback, self._alarms.scan
        # An old count stands because nothing newer came.
        if scan - self._scan > feedback.periods or feedback.age:
            self._counts, self._at, self.vel_rad_s = math.nan, 0, 0.0
            self._held, self._hangs_nm = 0, math.nan
        self._scan = scan
        if feedback.counts == self._counts:
            self._still += feedback.periods
            # One jump is a torque reading that has gone wrong (DRV-14). A speed loop that adds up goes on.
            change_nm = feedback.torque_nm - self._torque_nm
            jumps = abs(change_nm) > self._torque_still_nm
            if jumps and not self._jumped:
                self._stood_nm += change_nm
            self._jumped = jumps
        else:
            self._counts, self._still, self._tries = feedback.counts, 0, 0
            self._stood_nm, self._jumped = feedback.torque_nm, False
        self._torque_nm = feedback.torque_nm

    def _torque_leaves(self) -> bool:
        """The torque goes away from what it was when the reading began to stand.

        A speed loop that sees a standing shaft adds up what is left of its command: 0.5 N m each millisecond from
        0.0003 deg, 1.3 deg/s of the true shaft after 0.4 s (seed 4462). A sound load that swings may do the same for
        some hundredths of a second, so this is a reason to ask, and no answer.
        """
        if self._still < self._torque_scans:
            return False
        return not abs(self._feedback.torque_nm - self._stood_nm) <= self._torque_still_nm

    def _begin(self) -> None:
        self.dithers += 1
        self._at = 1
        if self._torque_leaves():
            # There is no time for small questions: 390 ms at scans of 10 ms, where they took 530 (seed 20040).
            self._tries = len(_DITHER_COUNTS) - 1
        way_rad = _DITHER_COUNTS[self._tries] / self._counts_per_rad
        self.vel_rad_s = way_rad / (self._half * self._period_s)

    def _go_on(self) -> None:
        """Forth, back, and wait for the answer; what stands through all of it is tried harder, and then frozen."""
        self._at += 1
        if self._at == self._half + 1 or self._at == self._back + self._half:
            self._vel, self.vel_rad_s = self.vel_rad_s, 0.0
        elif self._at == self._back:
            self.vel_rad_s = -self._vel
        elif self._at > self._after:
            self._at = 0
            if self._still < self._after:
                return
            self._tries += 1
            if self._tries < len(_DITHER_COUNTS):
                self._begin()
            else:
                self._tries = 0
                self._frozen(Words.WHILE_DITHERED(value=_DITHER_COUNTS[-1]))

    def _frozen(self, what: Said) -> None:
        self._feedback.doubt(Code.ENC_02, measured=what, time_ms=self._still * self._period_s * 1e3)

    # --- torque against the motion ----------------------------------------------------------------

    @property
    def against(self) -> float:
        """Product of torque (N m) and speed (rad/s, gantry) below which `drive_against` is asked."""
        return -self._torque_against_nm * _SLOW_RAD_S

    def drive_against(self) -> None:
        """A speed that grows against a large torque is a reading of the wrong sign: the drive pushes it on."""
        # A drive that swings about its command meets the resonance of the load, with less than all of its torque.
        if self._feedback.torque_limited or abs(self._feedback.torque_nm) > self._torque_full_nm:
            self._judge_growth(told=True)

    def ramp_against(self, *, left: bool) -> None:
        """The same in a quick stop. A drive whose torque is limited leaves its ramp with a load that swings.

        Args:
            left: the drive is above its ramp; else the speed is only watched.
        """
        if abs(self._feedback.torque_nm) > self._torque_full_nm:
            self._judge_growth(told=left)

    def _judge_growth(self, *, told: bool) -> None:
        feedback, scan = self._feedback, self._alarms.scan
        speed = abs(feedback.vel_rad_s)
        if scan - self._torque_scan > feedback.periods:
            self._slowest = speed
        self._torque_scan = scan
        self._slowest = min(self._slowest, speed)
        if told and speed > self._slowest + _GROWTH_RAD_S:
            words = Words.GROWS_AGAINST(speed=deg(speed), torque=feedback.torque_nm)
            feedback.doubt(Code.ENC_12, measured=words)
