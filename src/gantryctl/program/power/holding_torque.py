"""The motor torque that holds the load: learned at standstill, given back before the brake opens."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.program.settings import AxisSettings

# Of the rated torque: from here on the holding torque is too high (fault catalogue B7).
LEARN_SHARE: Final = 0.6


class HoldingTorque:
    """Learned holding torque, and the preload and proof level that follow from it. All at the motor.

    Attributes:
        mean_nm: mean torque in position at standstill: retained memory, and the next preload.
        preload_nm: torque that the drive adds to its speed loop while power is on.
        proof_nm: torque that the motor must give against the closed brake before it opens.
        believed: the reported torque agrees with what the shaft does (DRV-14 when not).
    """

    __slots__ = (
        "_learn", "_learn_max_nm", "_proof_least_nm", "_torque_max_nm", "believed", "mean_nm", "preload_nm", "proof_nm",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings) -> None:
        power = settings.power
        self._learn = min(1.0, settings.period_s / power.learn_time_s)
        self._torque_max_nm = power.torque_max_nm
        self._proof_least_nm = power.proof_torque_nm
        # More is a load that is too heavy, or a wrong reading: neither may be given at the next power-up.
        self._learn_max_nm = LEARN_SHARE * power.torque_rated_nm
        self.believed = True
        self.mean_nm = power.holding_torque_nm
        self.preload_nm = self.proof_nm = 0.0

    def learn(self, torque_nm: float) -> None:
        """Follow the torque of an axis in position, with the time constant of the settings."""
        # Only in position at standstill: there the torque is load and static friction, without acceleration.
        if not (self.believed and -self._learn_max_nm <= torque_nm <= self._learn_max_nm):
            return
        mean_nm = self.mean_nm
        self.mean_nm = self.limited(mean_nm + (torque_nm - mean_nm) * self._learn)

    def preload(self) -> None:
        """Fix the preload of this power cycle, and the proof torque in its direction.

        A load above the proof torque is proven with its own: what holds it must be there before the brake opens.
        """
        self.preload_nm = self.limited(self.mean_nm)
        level_nm = max(self._proof_least_nm, abs(self.preload_nm))
        self.proof_nm = self.limited(math.copysign(level_nm, self.preload_nm))

    def limited(self, torque_nm: float) -> float:
        """`torque_nm` within the motor's limit; 0 for NaN."""
        limit_nm = self._torque_max_nm
        if -limit_nm <= torque_nm <= limit_nm:
            return torque_nm
        # min and max would let NaN through as full torque (`max(-8, min(8, nan))` is 8).
        return math.copysign(limit_nm, torque_nm) if not math.isnan(torque_nm) else 0.0
