"""Expected torque and eccentric moment, learned from the motor's torque while the axis moves: for showing only.

The model is linear in what is learned, T = a sin(theta) + b cos(theta) + c sign(v) + d acc, fitted by recursive least
squares with forgetting. Nothing of the simulated plant is known here, and no command depends on it.
"""

from __future__ import annotations

import math
from typing import Final

_FORGET: Final = 0.9995
"""Per sample at 20 Hz: what is 100 s old counts by a third."""
_START: Final = 1e6
_MOVING_RAD_S: Final = math.radians(0.05)
_WAY_RAD: Final = math.radians(60.0)
"""Two of the four cannot be told apart before the axis has turned this far."""
_WANDER_NM: Final = 1e4
"""The covariance is held below this: directions that are not excited must not blow up."""


class TorqueModel:
    """Learns four numbers; None for everything until the axis has turned by 60 deg.

    Args:
        ratio: motor turns per gantry turn.
    """

    def __init__(self, ratio: float) -> None:
        self._ratio = ratio
        self._weights = [0.0] * 4
        self._cov = [[_START if i == j else 0.0 for j in range(4)] for i in range(4)]
        self._low = self._high = math.nan

    def add(self, pos_rad: float, vel_rad_s: float, acc_rad_s2: float, torque_nm: float) -> None:
        """One sample of angle, speed and acceleration at the gantry with the motor's torque."""
        if not (abs(vel_rad_s) > _MOVING_RAD_S and math.isfinite(torque_nm) and math.isfinite(pos_rad)):
            return
        self._low = min(pos_rad, self._low) if self._low == self._low else pos_rad
        self._high = max(pos_rad, self._high) if self._high == self._high else pos_rad
        x = _features(pos_rad, vel_rad_s, acc_rad_s2)
        px = [sum(row[j] * x[j] for j in range(4)) for row in self._cov]
        scale = _FORGET + sum(x[i] * px[i] for i in range(4))
        error = torque_nm - sum(w * f for w, f in zip(self._weights, x, strict=True))
        self._weights = [w + p / scale * error for w, p in zip(self._weights, px, strict=True)]
        forget = _FORGET if max(self._cov[i][i] for i in range(4)) < _WANDER_NM else 1.0
        self._cov = [[(self._cov[i][j] - px[i] * px[j] / scale) / forget for j in range(4)] for i in range(4)]

    @property
    def learned(self) -> bool:
        """Whether it has seen enough."""
        return self._high - self._low >= _WAY_RAD

    def expected_nm(self, pos_rad: float, vel_rad_s: float, acc_rad_s2: float) -> float:
        """Motor torque expected now, N m; nan until learned."""
        if not self.learned:
            return math.nan
        moving = vel_rad_s if abs(vel_rad_s) > _MOVING_RAD_S else 0.0
        return sum(w * f for w, f in zip(self._weights, _features(pos_rad, moving, acc_rad_s2), strict=True))

    def eccentric(self) -> tuple[float, float]:
        """Eccentric moment at the gantry, N m, and the angle where it would come to rest, rad; nan until learned."""
        if not self.learned:
            return math.nan, math.nan
        a, b = self._weights[0], self._weights[1]
        return math.hypot(a, b) * self._ratio, math.atan2(-b, a)


def _features(pos_rad: float, vel_rad_s: float, acc_rad_s2: float) -> tuple[float, float, float, float]:
    sign = math.copysign(1.0, vel_rad_s) if vel_rad_s else 0.0
    return math.sin(pos_rad), math.cos(pos_rad), sign, acc_rad_s2 * 1e3
