"""The reference of the angle: the encoder count at 0 deg, and when it may be set anew. Nothing moves."""

from __future__ import annotations

import math

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import check_destination
from gantryctl.program.axis.load_side import LoadSide
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg


class Reference:
    """Sets the present angle by a new encoder count at 0 deg.

    There is no homing motion: the encoder is absolute, so only the direct form of PLCopen's homing exists.
    """

    __slots__ = ("_creep_rad_s", "_feedback", "_law", "_load_side", "_travel")

    def __init__(self, settings: AxisSettings, feedback: Feedback, load_side: LoadSide | None) -> None:
        self._travel, self._law = settings.travel, settings.law
        self._creep_rad_s = settings.speed.creep_rad_s
        self._feedback, self._load_side = feedback, load_side

    def check(self, position_rad: float, standing: bool) -> Refusal | None:
        """Refuse an angle outside the travel, or from which the encoder would wrap near the travel.

        A modulo axis takes any angle of its turn, and its encoder may wrap anywhere.

        Args:
            standing: the axis is in Standstill or Disabled, and nothing is under way.
        """
        travel = self._travel
        if travel.endless:
            refused = check_destination(0.0, position_rad, None, travel)
            return refused or self._check_now(standing)
        if not travel.pos_min_rad <= position_rad <= travel.pos_max_rad:
            allowed = Words.WITHIN_TRAVEL(low=deg(travel.pos_min_rad), high=deg(travel.pos_max_rad))
            measured = Words.ANGLE(value=deg(position_rad))
            return refusal(Code.CTL_01, name=Words.NAME_POSITION, allowed=allowed, measured=measured)
        return self._check_now(standing) or self._check_wrap(position_rad)

    def _check_now(self, standing: bool) -> Refusal | None:
        # Before the first reading, and with one in doubt, there is no count to give an angle to.
        if not self._feedback.position_valid or math.isnan(self._feedback.counts):
            return refusal(Code.CTL_14, reason=Words.POSITION_NOT_VALID)
        if not (standing and abs(self._feedback.vel_rad_s) <= self._creep_rad_s):
            return refusal(Code.CTL_14, reason=Words.REFERENCE_AT_REST)
        return None

    def _check_wrap(self, position_rad: float) -> Refusal | None:
        travel, law = self._travel, self._law
        turn_rad = 2.0 * math.pi / law.ratio  # one motor turn at the gantry
        raw_rad = self._feedback.counts / law.counts_per_turn * turn_rad
        low = raw_rad - position_rad + travel.pos_min_rad
        high = raw_rad - position_rad + travel.pos_max_rad
        margin = min(low, law.turns * turn_rad - high)
        # A wrap inside the travel is a jump of the angle by the whole range at some later move.
        if not margin >= law.wrap_margin_rad:
            wrap = Words.ENCODER_WOULD_WRAP(margin=deg(margin), limit=deg(law.wrap_margin_rad))
            return refusal(Code.CTL_14, reason=wrap)
        return None

    def zero_counts(self, position_rad: float) -> float:
        """Encoder count at 0 deg, when the gantry stands at `position_rad` now."""
        counts_per_rad = self._law.counts_per_turn * self._law.ratio / (2.0 * math.pi)
        motor_rad = position_rad if self._load_side is None else self._load_side.new_reference(position_rad)
        return self._feedback.counts - motor_rad * counts_per_rad
