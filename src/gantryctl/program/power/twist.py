"""The turn of the shaft against the closed brake, as torque comes or goes: a proof of the reading."""

from __future__ import annotations

import math

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings


class Twist:
    """Watches the reading while torque that comes or goes turns the shaft by the elastic way of the closed brake.

    The reference brake gives way by 5e-4 rad up to its full torque, so 30 of 400 N m are 25 counts of 2^22 and 3 of
    2^19; play in the hub of a brake adds to it. A reading that shows none of it is frozen, one that turns the other way
    has the wrong sign, and the brake stays closed. A small torque may turn the shaft by less than a count: 1 N m of a
    brake of 44 does by 0.9 of 2^19, and nothing follows from it but that the reading is asked as soon as the brake is
    open (`Liveness`).
    """

    __slots__ = (
        "_against",
        "_feedback",
        "_fine",
        "_from",
        "_least_nm",
        "_period_s",
        "_scans",
        "_sign",
        "_with",
    )

    def __init__(self, settings: AxisSettings, feedback: Feedback) -> None:
        self._feedback = feedback
        self._fine = settings.monitors.encoder_shows_twist
        self._least_nm = settings.monitors.twist_least_nm
        self._period_s = settings.period_s
        self.begin(0.0)

    def begin(self, torque_nm: float) -> None:
        """The torque comes, or goes with the other sign, from the next scan on."""
        self._from, self._sign = self._feedback.counts, math.copysign(1.0, torque_nm)
        self._with = self._against = 0.0
        self._scans = 0

    def scan(self) -> None:
        """One scan with torque."""
        turned = (self._feedback.counts - self._from) * self._sign
        self._with, self._against = max(self._with, turned), max(self._against, -turned)
        self._scans += self._feedback.periods

    def expects(self, torque_nm: float) -> bool:
        """Whether so much torque turns the shaft by a step of the reading."""
        return abs(torque_nm) >= self._least_nm

    def shown(self, torque_nm: float) -> bool:
        """Whether the reading has turned with the torque; else it is in doubt."""
        if self._with >= 1.0 or not self._fine:
            return True
        if not self.expects(torque_nm):
            return True
        if not self.stood(torque_nm):
            words = Words.TURNED_AGAINST(value=self._against, torque=torque_nm)
            self._feedback.doubt(Code.ENC_12, measured=words)
        return False

    def stood(self, torque_nm: float) -> bool:
        """Whether the reading has shown nothing at all, neither the torque nor a load that swings: it is in doubt."""
        if max(self._with, self._against) >= 1.0 or not self._fine or not self.expects(torque_nm):
            return False
        words = Words.WHILE_TORQUE(value=torque_nm)
        self._feedback.doubt(Code.ENC_02, measured=words, time_ms=self._scans * self._period_s * 1e3)
        return True
