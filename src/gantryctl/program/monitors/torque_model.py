"""Torque model: expected torque and eccentric moment, learned from the motor's torque while the axis moves.

T = a sin(theta) + b cos(theta) + c sign(v) + d v + e acc, and f in wind, fitted by recursive least squares with
forgetting.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import mul
from typing import Final

# It knows nothing of the simulated plant (decision 0011). A drag of the brake is judged against it (BRK-02).
# A gear whose friction grows with the load makes the load look heavier where it is lifted and lighter where it is let
# down. Motion both ways over the same angles takes most of that out; some 5 to 10 % of the moment stay.
_COUNT: Final = 5
# A steady wind takes a moment that goes with no angle and no direction of motion. Without wind nothing does, and it is
# left out: motions over a few degrees would not tell it from the load.
_COUNT_IN_WIND: Final = 6
# Variance by which a weight may wander between two samples, in variances of one reading: at 20 Hz, what is 100 s old
# counts by a third.
_DRIFT: Final = 5e-7
# Variance of what nothing is known of.
_START: Final = 100.0
# Sine and cosine do not wander beyond: hours of small motions, which teach neither, do not lose them.
_FIRM: Final = 0.01
_LIMITS: Final = (_FIRM, _FIRM, _START, _START, _START, _START)
# A weight is known when its standard deviation is below this share of the rated torque.
_KNOWN_SHARE: Final = 0.005
_SAMPLES_MIN: Final = 100
# Of retained weights: as sure as after a minute of motion, with readings that the swing spreads by 5 N m.
_KEPT: Final = 1e-3
_KEPT_VAR: Final = 25.0
# Readings that the variance of one reading is averaged over.
_SAMPLES_MAX: Final = 2000
_MOVING_RAD_S: Final = math.radians(0.05)
_VEL_RAD_S: Final = 0.1
# Units in which speed and acceleration are as large as a sine, so that all weights are some N m.
_ACC_RAD_S2: Final = 1e-3


class TorqueModel:
    """Weights, learned in motion; results are nan until load and friction can be told apart.

    Args:
        ratio: motor turns per gantry turn.
        torque_rated_nm: of the motor; weights are judged in shares of it.
        in_wind: a moment from outside is one of them.

    Attributes:
        learned: whether it has seen enough.
    """

    def __init__(self, ratio: float, torque_rated_nm: float, *, in_wind: bool = False) -> None:
        self._ratio, self._count = ratio, _COUNT_IN_WIND if in_wind else _COUNT
        self._known_nm = _KNOWN_SHARE * torque_rated_nm
        self.forget()

    def restore(self, weights: Sequence[float]) -> None:
        """Go on from what was learned before; anything but finite weights of this model changes nothing."""
        if len(weights) == self._count and all(map(math.isfinite, weights)):
            self._weights = list(weights)
            self._cov = self._spread(_KEPT)
            self._samples, self._reading_var, self.learned = _SAMPLES_MIN, _KEPT_VAR, True

    def forget(self) -> None:
        """Begin anew: the load is another one."""
        self._weights = [0.0] * self._count
        self._cov = self._spread(_START)
        self._samples = 0
        self._reading_var = 0.0
        self.learned = False

    def _spread(self, variance: float) -> list[list[float]]:
        return [[variance if i == j else 0.0 for j in range(self._count)] for i in range(self._count)]

    def turn(self, by_rad: float) -> None:
        """Call every angle `by_rad` more from now on: the moment is that of the same place.

        a sin(p) + b cos(p) with p = q - by is (a cos by + b sin by) sin(q) + (b cos by - a sin by) cos(q).
        """
        cos, sin = math.cos(by_rad), math.sin(by_rad)
        self._weights[:2] = _turned(self._weights[0], self._weights[1], cos, sin)
        # Covariance of turned weights: its rows and its columns are turned alike.
        rows = zip(*self._cov[:2], strict=True)
        self._cov[:2] = map(list, zip(*(_turned(a, b, cos, sin) for a, b in rows), strict=True))
        for row in self._cov:
            row[:2] = _turned(row[0], row[1], cos, sin)

    @property
    def weights(self) -> tuple[float, ...]:
        """What is to be retained; () until learned."""
        return tuple(self._weights) if self.learned else ()

    def add(self, pos_rad: float, vel_rad_s: float, acc_rad_s2: float, torque_nm: float) -> None:
        """Add a sample of angle, speed and acceleration at the gantry with the motor's torque; none at rest."""
        if not (
            abs(vel_rad_s) > _MOVING_RAD_S and math.isfinite(pos_rad + vel_rad_s + acc_rad_s2 + torque_nm)
        ):
            return
        x, cov = _features(pos_rad, vel_rad_s, acc_rad_s2)[: self._count], self._cov
        px = [sum(map(mul, row, x)) for row in cov]
        scale = 1.0 + sum(map(mul, x, px))
        error = torque_nm - sum(map(mul, self._weights, x))
        gain = [p / scale for p in px]
        self._weights = [w + g * error for w, g in zip(self._weights, gain, strict=True)]
        self._cov = [
            [c - g * p for c, p in zip(row, px, strict=True)] for row, g in zip(cov, gain, strict=True)
        ]
        for i, limit in enumerate(_LIMITS[: self._count]):
            self._cov[i][i] += _DRIFT if self._cov[i][i] < limit else 0.0
        self._samples = min(self._samples + 1, _SAMPLES_MAX)
        self._reading_var += (error * error / scale - self._reading_var) / self._samples
        self._judge()

    # One way over less than a quarter turn does not tell load from friction; there and back does.
    def _judge(self) -> None:
        deviation_nm = math.sqrt(self._reading_var * max(self._cov[0][0], self._cov[1][1]))
        self.learned = self._samples >= _SAMPLES_MIN and deviation_nm < self._known_nm

    def expected_nm(self, pos_rad: float, vel_rad_s: float, acc_rad_s2: float) -> float:
        """Return the expected motor torque, N m; nan until learned."""
        if not self.learned:
            return math.nan
        moving = vel_rad_s if abs(vel_rad_s) > _MOVING_RAD_S else 0.0
        features = _features(pos_rad, moving, acc_rad_s2)[: self._count]
        return sum(w * f for w, f in zip(self._weights, features, strict=True))

    def eccentric(self) -> tuple[float, float]:
        """Return the eccentric moment at the gantry, N m, and its angle of rest, rad; nan until learned.

        The angle of a moment that is too small to be measured is nan, too.
        """
        if not self.learned:
            return math.nan, math.nan
        a, b = self._weights[0], self._weights[1]
        moment_nm = math.hypot(a, b)
        return moment_nm * self._ratio, math.atan2(-b, a) if moment_nm > 2.0 * self._known_nm else math.nan


def _features(pos_rad: float, vel_rad_s: float, acc_rad_s2: float) -> tuple[float, ...]:
    sign = math.copysign(1.0, vel_rad_s) if vel_rad_s else 0.0
    return math.sin(pos_rad), math.cos(pos_rad), sign, vel_rad_s / _VEL_RAD_S, acc_rad_s2 / _ACC_RAD_S2, 1.0


def _turned(sine: float, cosine: float, cos: float, sin: float) -> tuple[float, float]:
    return sine * cos + cosine * sin, cosine * cos - sine * sin
