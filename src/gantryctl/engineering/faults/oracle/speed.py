"""The speed on the wire: it changes no faster than the ramps (INV-3), and a person asks for it (INV-2)."""

from __future__ import annotations

import math

from gantryctl.engineering.faults.oracle.asked import Asked
from gantryctl.engineering.faults.oracle.known import KnownFaults
from gantryctl.engineering.faults.oracle.limits import Bounds
from gantryctl.engineering.faults.oracle.told import READING_SCANS
from gantryctl.engineering.faults.oracle.words import TrueAxis
from gantryctl.program.settings import AxisSettings


class SpeedOnWire:
    """The speed command of one axis, motor side.

    Attributes:
        vel: the last, rad/s.
        settled: a slower command is regulation, rad/s.
    """

    def __init__(self, known: KnownFaults, bounds: Bounds) -> None:
        self._known, self._bounds = known, bounds
        self.vel = 0.0
        self._ms = -1
        self._step, self._step_rad = "", 0.0
        self._stray = 0.0
        self._rest_angle = self._rest_wrong = self._wrong = 0.0
        # Replaced by `bind`.
        self._shipped = True
        self._program: object = None
        self.settled = self._dither = self._sag = self._slope = math.inf
        self._kpp = self._apart = 0.0

    def bind(self, settings: AxisSettings, program: object, *, shipped: bool) -> None:
        """From now on a program with these settings commands it; one of somebody's own moves by its own logic."""
        self._program = program
        ratio, ramps = settings.law.ratio, settings.ramps
        motor_deg = ratio * math.pi / 180.0
        self._shipped = shipped
        self._kpp = settings.law.kpp_per_s
        compensation = settings.compensation
        if compensation is not None and compensation.load_encoder:
            self._apart = ratio * compensation.disagreement_rad
        self.settled = self._bounds.regulation_deg_s * motor_deg
        self._dither = self._bounds.dither_deg * motor_deg
        self._sag = self._bounds.sag_deg * motor_deg
        # Correction of the position loop: Kpp times the speed that the deviation monitor lets pass.
        correction = settings.law.kpp_per_s * settings.monitors.velocity_deviation_rad_s
        steepest = max(ramps.dec_rad_s2, ramps.jog_release_dec_rad_s2, ramps.acc_rad_s2)
        self._slope = (steepest + correction) * ratio * 1e-3

    def zero(self, true: TrueAxis, wrong: float) -> None:
        """No speed is commanded; `wrong` as in `command`."""
        self.vel, self._ms, self._step = 0.0, true.ms, ""
        self._rest_angle, self._rest_wrong = true.angle, wrong

    def command(self, true: TrueAxis, vel: float, wrong: float, asked: Asked | None) -> bool:
        """Judge a speed; true when it is more than regulation.

        Args:
            wrong: what the told angle is off by, rad at the motor.
            asked: what people ask for.
        """
        now, before = true.ms, self.vel
        passed = now - self._ms or 1
        # Nearly every command changes by less than the ramps of one millisecond.
        if self._step or not -self._slope <= vel - before <= self._slope:
            # A reading that is wrong by less than can be told is answered by Kpp times the error all the same.
            slope = self._slope * passed + self.settled + self._kpp * abs(wrong)
            # The signal of an experiment is asked for, and added to what the ramps command.
            slope += getattr(self._program, "signal_step_rad_s", 0.0)
            if self._step or not -slope <= vel - before <= slope:
                self._stepped(true, before, vel, passed)
        self.vel, self._ms = vel, now
        if -self.settled < vel < self.settled:
            # What was asked forth and back has ended: the next question is another one.
            self._stray = 0.0
            self._rest_angle, self._rest_wrong = true.angle, wrong
            return False
        self._wrong = wrong
        if asked is not None:
            asked.at_target_ms = now
            if self._shipped and asked.leads_away(true.angle + true.offset, vel):
                self._leads_away(true, asked, vel)
            if now > asked.until_ms:
                self._stray += abs(vel) * passed * 1e-3
                self._check_origin(true, asked, vel)
        return True

    def _stepped(self, true: TrueAxis, before: float, vel: float, passed: int) -> None:
        """Judge a speed that changes too fast: from rest, and back at rest within the way of a dither, it is one."""
        if self._step and -self.settled < vel < self.settled:
            self._step = ""
            return
        if not self._step:
            if self._known.of_feedback(true.ms):
                return
            self._step = f"speed command {true.deg(before):.3f} to {true.deg(vel):.3f} deg/s in {passed} ms"
            self._step_rad = 0.0 if -self.settled < before < self.settled else math.inf
        # What moves no further is no motion: 4096 counts forth or back are 0.0025 deg of the reference gantry.
        self._step_rad += abs(vel) * passed * 1e-3
        if self._step_rad > self._dither:
            true.say("INV-3", self._step)
            self._step = ""

    def _leads_away(self, true: TrueAxis, asked: Asked, vel: float) -> None:
        """A speed that leads on from outside of the way of the move or key behind it."""
        if true.ms <= asked.until_ms and not self._known.of_feedback(true.ms):
            low, high = (true.deg(end) for end in asked.way)
            true.say(
                "INV-2",
                f"{true.deg(vel):.3f} deg/s commanded at {true.deg(true.angle + true.offset):.3f} deg, and what was "
                f"asked for leads from {low:.3f} to {high:.3f} deg",
            )

    def _check_origin(self, true: TrueAxis, asked: Asked, vel: float) -> None:
        """A speed without a person behind it, over more than a dither. Other programs move by their own logic."""
        if self._stray <= self._dither:
            return
        if not self._shipped:
            asked.until_ms = math.inf
            return
        if self._known.of_feedback(true.ms):
            # The position loop answers what a spoilt reading or a drive that turns the other way shows; the true way of
            # that is judged by INV-1.
            return
        if self._known.pulls_away and self._brings_back(true, vel):
            return
        if not asked.held(true.ms, vel):
            true.say("INV-2", f"{true.deg(vel):.3f} deg/s commanded, and nobody asks for it")

    def _brings_back(self, true: TrueAxis, vel: float) -> bool:
        """The position loop answers the true way from where the command was last that of an axis at rest.

        So it does long after a drive began to turn the other way, or where a load has become too much for the torque,
        and nobody has to ask for it, no further than may be moved without a reason. The command of rest may be off by
        the regulation, a reading on a bus is some scans old. A loop through an encoder on the ring answers what
        that has corrected of the angle that is told, at most by what both may differ (B8: friction holds a motor
        without torque, and 0.0004 deg of correction ask for 0.052 deg/s); the angle itself is judged by INV-7. On a
        bus it is told a scan before, when there may have been half of it.
        """
        way = true.angle - self._rest_angle
        late = 1e-3 * true.scans_ms(READING_SCANS) * abs(true.speed)
        apart = min(self._apart, 2.0 * abs(self._wrong - self._rest_wrong))
        answers = abs(vel + self._kpp * way) <= self.settled + self._kpp * (late + apart)
        return answers and abs(way) <= self._sag
