"""The torque proof: the motor gives torque against the closed brake before it opens."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.power.twist import Twist
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg

# Of the torque that is wanted: less turns the shaft by nothing that counts.
_LITTLE: Final = 0.1


class TorqueProof:
    """Judges the torque that the motor gives, and the turn of the shaft under it.

    At zero speed a PI speed loop builds no torque against a closed brake: a drive that is enabled may still drop the
    load, so the torque is asked for beside the speed (60B2).

    Args:
        holding: proof torque and preload of this power cycle.
    """

    __slots__ = (
        "_alarms",
        "_begin",
        "_feedback",
        "_holding",
        "_little",
        "_period_s",
        "_power",
        "_proof_scans",
        "_settle_scans",
        "_turned",
        "_twist",
    )

    def __init__(
        self, settings: AxisSettings, feedback: Feedback, alarms: AlarmLog, holding: HoldingTorque
    ) -> None:
        self._feedback, self._alarms, self._holding = feedback, alarms, holding
        self._power, self._period_s = settings.power, settings.period_s
        self._proof_scans = settings.scans(settings.power.proof_time_s)
        self._settle_scans = settings.scans(settings.power.settle_time_s)
        self._twist = Twist(settings, feedback)
        # Count where the proof began; count and scan of the last little torque; turn by the torque as it came.
        self._begin, self._little, self._turned = 0.0, (0.0, 0), 0.0

    def begin(self) -> float:
        """The torque to ask for from the next scan on, N m."""
        counts, proof_nm = self._feedback.counts, self._holding.proof_nm
        self._twist.begin(proof_nm)
        self._begin, self._little, self._turned = counts, (counts, 0), 0.0
        return proof_nm

    @property
    def turns_shaft(self) -> bool:
        """The proof torque turns the shaft of the closed brake by a step of the reading."""
        return self._twist.expects(self._holding.proof_nm)

    def given(self, scans: int) -> bool:
        """Judge one scan under the proof torque; an alarm where the motor gives too much, or too little for too long.

        Args:
            scans: since the torque was asked for.
        """
        self._twist.scan()
        proof_nm = self._holding.proof_nm
        wanted = self._power.proof_share * abs(proof_nm)
        given = self._feedback.torque_nm * math.copysign(1.0, proof_nm)
        if not abs(given) <= abs(proof_nm) + self._power.proof_excess_nm:
            # A torque that turns the shaft is no wrong reading: the brake slips, and a drive that pushes where it means
            # to brake reads the shaft with the wrong sign.
            if not self._feedback.slow and self._feedback.torque_nm * self._feedback.vel_rad_s < 0.0:
                words = Words.GROWS_AGAINST(
                    speed=deg(abs(self._feedback.vel_rad_s)), torque=self._feedback.torque_nm
                )
                self._feedback.doubt(Code.ENC_12, measured=words)
                return False
            self._holding.believed = False
            reading = Words.TORQUE_AGAINST_BRAKE(torque=self._feedback.torque_nm, wanted=proof_nm)
            self._alarms.raise_(Code.DRV_14, Reaction.QUICK_STOP, measured=reading)
        elif given >= wanted:
            self._turned = math.copysign(1.0, proof_nm) * self._turn_at_once(scans)
            return True
        else:
            if given < _LITTLE * wanted:
                self._little = self._feedback.counts, scans
            if scans > self._proof_scans:
                time_ms = scans * self._period_s * 1e3
                self._alarms.raise_(Code.BRK_07, measured=given, limit=wanted, time_ms=time_ms)
        return False

    def _turn_at_once(self, scans: int) -> float:
        """Counts that the shaft has turned while the torque came, beside what it has turned on as before."""
        counts, at = self._little
        per_scan = (counts - self._begin) / max(1, at)
        return self._feedback.counts - counts - per_scan * (scans - at)

    def settling_torque_nm(self, scans: int) -> float:
        """Torque on the ramp from the proof torque to the preload, N m.

        Args:
            scans: since the torque was proven.
        """
        self._twist.scan()
        share = min(1.0, scans / self._settle_scans)
        proof_nm = self._holding.proof_nm
        return proof_nm + (self._holding.preload_nm - proof_nm) * share

    def settled(self, scans: int) -> bool:
        """Whether the torque has stood at the preload as long as its ramp took, and the shaft has shown it."""
        # Soon after a stop the load still swings behind the closed brake and turns the shaft against the torque, by up
        # to 36 counts of 2^22, but slowly: the torque turns it at once (4 counts where the plant is 20 % off). 612
        # power-ups 1.2 to 2.2 s after a stop by the brake (three plants, 1, 4 and 10 ms), half with a wrong sign: every
        # wrong one was told, and no sound one.
        if scans < 2 * self._settle_scans:
            return False
        return self._turned >= 1.0 or self._twist.shown(self._holding.proof_nm)
