"""Backlash from the motor's torque: the swing that follows when the torque of the gears turns round within a ramp."""

from __future__ import annotations

import math
from typing import Final

# While the torque of the gears turns round in a ramp of jerk j, the load goes through the gap b:
#     b = v0 t + j t^3 / 6        v0 = j J/k, the speed at which the wind-up of the gears is let go
# On the other flank it lacks the speed j t^2/2 and the torque J j t, and so it swings with
#     A = hypot(J w j t^2/2, J j t)        w^2 = k/J
# From the swing of the first period A gives t, and t the gap. Damping and gaps that last longer than the jerk make A
# smaller, never larger: what is found is the least that the gap can be (half of 0.2 mm on the reference gantry).
_STEADY: Final = 1e-9  # of a change of acceleration: rounding


class FlankSwing:
    """Watches ramps of the set-point, sample by sample.

    Args:
        inertia_kg_m2: behind the mesh. windup_per_acc_s2: wind-up per acceleration, J/k = 1/w^2.
        flank_nm: torque of the gears, on either side of 0, beyond which their flank is known.
        sample_s: time between two samples.
    """

    __slots__ = (
        "_acc", "_before", "_count", "_flank", "_inertia", "_inverse", "_jerk", "_sample_s", "_shape",
        "_size", "_sums", "_torque", "_windup",
    )  # fmt: skip

    def __init__(
        self, inertia_kg_m2: float, windup_per_acc_s2: float, flank_nm: float, sample_s: float
    ) -> None:
        self._inertia, self._windup, self._flank = inertia_kg_m2, windup_per_acc_s2, flank_nm
        self._sample_s = sample_s
        period_s = 2.0 * math.pi * math.sqrt(windup_per_acc_s2)
        self._size = max(6, round(period_s / sample_s))
        # Over a whole period the line and the swing are orthogonal but for line and sine.
        angles = [2.0 * math.pi * (k + 0.5) / self._size for k in range(self._size)]
        self._shape = [(math.sin(a), math.cos(a), (k + 0.5) / self._size - 0.5) for k, a in enumerate(angles)]
        lines = sum(t * t for _, _, t in self._shape)
        mixed = sum(s * t for s, _, t in self._shape)
        self._inverse = (lines, mixed, 0.5 * self._size * lines - mixed * mixed)
        self.abandon()

    def abandon(self) -> None:
        """Forget the ramp under way: the axis rests, or is commanded anew."""
        self._acc = self._torque = math.nan
        self._before = math.nan
        self._jerk = 0.0
        self._count = -1
        self._sums = [0.0, 0.0, 0.0]

    def sample(self, acc_rad_s2: float, mesh_nm: float, left_nm: float) -> float | None:
        """Take a sample of an axis that moves one way; the gap that a swing shows, rad, at its end, else None.

        Args:
            acc_rad_s2: of the set-point. mesh_nm: planned torque of the gears.
            left_nm: torque that the plan leaves, at the axis.
        """
        change, self._acc = acc_rad_s2 - self._acc, acc_rad_s2
        before, self._torque = self._torque, mesh_nm
        jerk = change / self._sample_s
        if abs(change) > _STEADY:
            if self._jerk * jerk < 0.0 or self._count >= 0:
                # The ramp turned round: what swings now began somewhere else.
                self._before = math.nan
                self._count = -1
            elif self._jerk == 0.0:
                self._before = before
            self._jerk = jerk if abs(jerk) > abs(self._jerk) else self._jerk
            return None
        if self._jerk and self._count < 0:
            turned = self._before * mesh_nm < 0.0
            if not (turned and min(abs(self._before), abs(mesh_nm)) > self._flank):
                self._jerk = 0.0
                return None
            self._count, self._sums = 0, [0.0, 0.0, 0.0]
        if self._count < 0:
            return None
        sine, cosine, line = self._shape[self._count]
        sums = self._sums
        self._sums = [sums[0] + sine * left_nm, sums[1] + cosine * left_nm, sums[2] + line * left_nm]
        self._count += 1
        return self._gap() if self._count == self._size else None

    def _gap(self) -> float | None:
        sine_sum, cosine_sum, line_sum = self._sums
        lines, mixed, determinant = self._inverse
        sine = (lines * sine_sum - mixed * line_sum) / determinant
        cosine = cosine_sum / (0.5 * self._size)
        jerk, self._jerk, self._count = abs(self._jerk), 0.0, -1
        swing = math.hypot(sine, cosine)
        return gap_of(swing, jerk, self._inertia, self._windup) if math.isfinite(swing) else None


def gap_of(swing_nm: float, jerk_rad_s3: float, inertia_kg_m2: float, windup_per_acc_s2: float) -> float:
    """The gap, rad, after which a load swings with an amplitude of torque."""
    share = swing_nm / (inertia_kg_m2 * jerk_rad_s3)
    # A^2 = (J j)^2 (w^2 t^4/4 + t^2), solved for t^2.
    time_s = math.sqrt(2.0 * windup_per_acc_s2 * (math.sqrt(1.0 + share * share / windup_per_acc_s2) - 1.0))
    return jerk_rad_s3 * time_s * (windup_per_acc_s2 + time_s * time_s / 6.0)
