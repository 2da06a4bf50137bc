"""INV-7 of the angle: what is told of it against the true one, and the moves of the zero."""

from __future__ import annotations

import math
from typing import Any, Final

from gantryctl.engineering.faults.oracle.known import Effect, KnownFaults
from gantryctl.engineering.faults.oracle.limits import TOLD_WRONG_S, Bounds, StopClass
from gantryctl.engineering.faults.oracle.words import TrueAxis
from gantryctl.units import deg

# Scans by which a reading on a bus may be old: sampled, sent, and taken.
READING_SCANS: Final = 3.0


class ToldAngle:
    """The angle that the program tells.

    Attributes:
        offset: of it against the true one, rad at the motor: the zero of the machine.
        wrong: what it is off by, rad at the motor.
        moved_ms: when the axis was last moved, or its brake opened.
    """

    def __init__(self, known: KnownFaults, bounds: Bounds) -> None:
        self._known, self._bounds = known, bounds
        self.offset = self.wrong = 0.0
        self.moved_ms = 0
        self._told_rad, self._stands_ms, self._answer_ms = math.nan, 0, 0.0
        self._wrong_since: int | None = None
        self._zero_counts = math.nan
        # Replaced by `bind`; in motor units.
        self._axis: Any = None
        self._shipped = True
        self._ratio = self._deg = 1.0
        self._bound = math.inf
        self._quick_dec = 0.0

    def bind(self, axis: Any, *, shipped: bool, settles_s: float) -> None:
        """From now on the program of this axis tells it.

        Args:
            shipped: by the shipped program; another one may set its zero as it likes, at rest.
            settles_s: after the speeds that look like regulation.
        """
        settings = axis.settings
        self._axis, self._shipped = axis, shipped
        self._ratio = ratio = settings.law.ratio
        self._deg = ratio * math.pi / 180.0
        self._bound = self._bounds.told_deg * self._deg
        self._quick_dec = settings.ramps.quick_dec_rad_s2 * ratio
        # A reading is asked from where the set-point has come to rest.
        self._answer_ms = 1e3 * (axis.liveness.answer_s + settles_s)
        self._zero_counts = math.nan

    def judge(self, true: TrueAxis) -> bool:
        """Judge what is told in this scan, before the plant goes on; true when the zero has moved."""
        axis = self._axis
        told = axis.pos_act_rad
        if told != self._told_rad:
            self._told_rad, self._stands_ms = told, true.ms
        angle = told * self._ratio
        zero_moved: bool = axis.zero_counts != self._zero_counts
        if zero_moved:
            begins = math.isnan(self._zero_counts)
            self._zero_counts = axis.zero_counts
            moved = angle - true.angle - self.offset
            self.offset += moved if begins or not axis.settings.travel.endless else self._whole(true, moved)
        self.wrong = wrong = angle - true.angle - self.offset
        bound = self._bound
        late_s = self._known.reading_late_s
        if late_s:
            bound += (abs(true.speed) + self._quick_dec * late_s) * late_s
        if not -bound <= wrong <= bound:
            self._wrong_angle(true)
        elif self._wrong_since is not None:
            self._wrong_since = None
        return zero_moved

    def _whole(self, true: TrueAxis, moved: float) -> float:
        """Move of the zero of an axis that turns without end, rad at the motor, as far as it may be.

        It moves on by whole turns, and not under a motion to an angle; a new reference, by any angle, is for a program
        of somebody's own and for an axis at rest.
        """
        virtual, turn = self._axis.virtual, 360.0 * self._deg
        whole = turn * round(moved / turn)
        # What is told in motion is some scans old.
        late = 1e-3 * true.scans_ms(READING_SCANS) * abs(true.speed)
        referenced = abs(moved - whole) > self._bound + late
        moving = virtual.vel_ref_rad_s != 0.0
        if referenced and (moving or self._shipped):
            true.say("INV-7", f"the zero has moved by {true.deg(moved):.2f} deg, which is no whole turn")
        elif moving and virtual.plan.vel_end == 0.0:
            true.say("INV-7", f"the zero has moved by {true.deg(moved):.2f} deg under a motion to an angle")
        return moved if referenced else whole

    def _wrong_angle(self, true: TrueAxis) -> None:
        if not self._known.of_feedback(true.ms):
            self._known.inject(true.now(), Effect(feedback=True, at_once=True))
        if not self._axis.feedback.position_valid:
            self._wrong_since = None
        elif self._wrong_since is None:
            self._wrong_since = true.ms
        elif self._wrong_for_long(true, self._wrong_since):
            told, wrong = deg(self._axis.pos_act_rad), true.deg(self.wrong)
            true.say("INV-7", f"{told:.3f} deg are told, wrong by {wrong:.3f} deg, and called valid")

    def _wrong_for_long(self, true: TrueAxis, since_ms: int) -> bool:
        """Longer than an alarm takes; or than the reading is asked for, where it looks like that of an axis at rest."""
        little = abs(self.wrong) <= self._bounds.way_deg(StopClass.FEEDBACK, 0.0) * self._deg
        if little and self.unasked(true):
            return False
        return (true.ms - since_ms) * 1e-3 > TOLD_WRONG_S

    def unasked(self, true: TrueAxis) -> bool:
        """The reading stands, and the controller has had no time to ask it, or may not."""
        if true.ms <= self._stands_ms:
            return False
        # Behind a brake, and under torque that may not be commanded, nobody can ask: the next power-up does.
        return not true.can_ask() or true.ms - max(self._stands_ms, self.moved_ms) <= self._answer_ms
