"""The paper's loops on a rigid axis: P with velocity feed-forward in the PLC, PI in the drive, one inertia.

Everything is on the motor shaft and continuous; the torque loop counts as 1 (eqs. (4) and (5) with Gi = 1,
and Kt = 1 because Kvp in N m s/rad already makes u a torque). Sampled loops and compliance are other models.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gantryctl.engineering.analysis.models.linear import (
    FloatArray,
    TransferFunction,
    integrator,
    inverse_laplace,
    largest,
)


@dataclass(frozen=True)
class RigidLoop:
    """Gains of eq. (4) and the inertia of eq. (5).

    Attributes:
        js_kg_m2: inertia at the motor shaft: load and rotor, or the rotor alone to see what the drive was
            tuned on.
        kvp_nm_s_per_rad, tvi_s: PI speed loop.
        kpp_per_s, kvf: position loop and velocity feed-forward.
    """

    js_kg_m2: float
    kvp_nm_s_per_rad: float
    tvi_s: float
    kpp_per_s: float
    kvf: float = 1.0

    @property
    def _pi(self) -> FloatArray:
        """Kvp (s + 1/Tvi): the PI controller without its 1/s."""
        return self.kvp_nm_s_per_rad * np.array([1.0, 1.0 / self.tvi_s])

    @property
    def _denominator(self) -> FloatArray:
        """Denominator of eq. (5): Js s^3 + Kvp s^2 + (Kvp/Tvi + Kvp Kpp) s + Kpp Kvp/Tvi."""
        return np.polyadd([self.js_kg_m2, 0.0, 0.0, 0.0], np.polymul(self._pi, [1.0, self.kpp_per_s]))

    # --- transfer functions

    @property
    def position(self) -> TransferFunction:
        """Eq. (5): y/r."""
        return TransferFunction.of(np.polymul(self._pi, [self.kvf, self.kpp_per_s]), self._denominator)

    @property
    def error(self) -> TransferFunction:
        """(r - y)/r = [Js s^3 + (1 - Kvf) Kvp s^2 + (1 - Kvf) (Kvp/Tvi) s]/den."""
        left_over = (1.0 - self.kvf) * np.polymul(self._pi, [1.0, 0.0])
        return TransferFunction.of(np.polyadd([self.js_kg_m2, 0.0, 0.0, 0.0], left_over), self._denominator)

    @property
    def velocity(self) -> TransferFunction:
        """Closed speed loop: w/w_cmd."""
        return TransferFunction.of(self._pi, np.polyadd([self.js_kg_m2, 0.0, 0.0], self._pi))

    @property
    def velocity_open(self) -> TransferFunction:
        """Speed loop cut at the speed error."""
        return TransferFunction.of(self._pi, [self.js_kg_m2, 0.0, 0.0])

    @property
    def position_open(self) -> TransferFunction:
        """Position loop cut at the speed command."""
        return self.velocity * TransferFunction.of([self.kpp_per_s], [1.0, 0.0])

    @property
    def torque_open(self) -> TransferFunction:
        """Both loops cut at the torque: a triple integrator, so it is stable above some gain only."""
        return TransferFunction.of(
            np.polymul(self._pi, [1.0, self.kpp_per_s]), [self.js_kg_m2, 0.0, 0.0, 0.0]
        )

    @property
    def compliance(self) -> TransferFunction:
        """Motor angle per disturbing torque at the motor, rad/(N m): s/den."""
        return TransferFunction.of([1.0, 0.0], self._denominator)

    # --- figures

    @property
    def velocity_wn_rad_s(self) -> float:
        """Natural frequency of the closed speed loop: sqrt(Kvp/(Tvi Js))."""
        return math.sqrt(self.kvp_nm_s_per_rad / (self.tvi_s * self.js_kg_m2))

    @property
    def velocity_zeta(self) -> float:
        """Damping ratio of the closed speed loop: sqrt(Kvp Tvi/Js)/2."""
        # 0.32 with the paper's gains on load and rotor, 35 deg of phase margin; on the rotor alone 74 deg at
        # 55 Hz: the drive was tuned on a load that it did not feel above a few Hz.
        return 0.5 * math.sqrt(self.kvp_nm_s_per_rad * self.tvi_s / self.js_kg_m2)

    @property
    def kvp_min(self) -> float:
        """Routh: stable above Kvp = Js Kpp/(1 + Kpp Tvi)."""
        return self.js_kg_m2 * self.kpp_per_s / (1.0 + self.kpp_per_s * self.tvi_s)

    @property
    def kpp_max(self) -> float:
        """Routh: stable while Kpp/(1 + Kpp Tvi) < Kvp/Js, 1/s; inf when that always holds."""
        # Routh on eq. (5): a1 a2 > a0 a3, that is Kvp (1/Tvi + Kpp) > Js Kpp/Tvi.
        limit = self.kvp_nm_s_per_rad / self.js_kg_m2
        return limit / (1.0 - limit * self.tvi_s) if limit * self.tvi_s < 1.0 else math.inf

    @property
    def gain_reduction_margin(self) -> float:
        """Factor on the torque gain below which the loop is unstable, as in torque saturation: 1/|L| < 1."""
        # 0.22 with the paper's gains: two integrators in the controllers and one in the plant make the loop
        # conditionally stable, so torque saturation can make it unstable.
        return float(self.torque_open.gain_margins()[0])

    @property
    def gain_margin(self) -> float | None:
        """Factor on Kpp that reaches the stability limit; None without a limit."""
        margins = self.position_open.gain_margins()
        rising = margins[margins > 1.0]
        return float(rising[0]) if rising.size else None

    @property
    def step_overshoot_percent(self) -> float:
        """Overshoot of y for r = 1(t), %. With Kvf > 0 the step contains the impulse of dr/dt."""
        # Rounding of the peak is no overshoot.
        _, peak = largest(self.position * integrator())
        return max(0.0, 100.0 * (peak - 1.0)) if peak > 1.0 + 1e-9 else 0.0

    @property
    def jerk_error_per_jerk(self) -> float:
        """Position error left by a constant jerk of 1 unit/s3, with Kvf = 1: Js Tvi/(Kpp Kvp), s3."""
        return self.js_kg_m2 * self.tvi_s / (self.kpp_per_s * self.kvp_nm_s_per_rad)

    def steady_speed_error(self, acceleration: float) -> float:
        """Speed error that a constant acceleration leaves: (1 - Kvf) a/Kpp."""
        return (1.0 - self.kvf) * acceleration / self.kpp_per_s

    @property
    def torque_ramp_error_rad_per_nm_s(self) -> float:
        """Motor angle left by a disturbing torque that rises by 1 N m/s, rad: Tvi/(Kpp Kvp). A constant one
        leaves 0.
        """
        return self.tvi_s / (self.kpp_per_s * self.kvp_nm_s_per_rad)

    # --- responses; the unit of the reference is the unit of the result

    def step(self, times_s: list[float]) -> FloatArray:
        """y(t) for r = 1(t)."""
        return inverse_laplace(self.position * integrator(), times_s)

    def error_behind(self, order: int, size: float, times_s: list[float]) -> FloatArray:
        """r - y from standstill for r = size t^order/order!: step 0, ramp 1, parabola 2.

        The speed error behind the same reference is that of one order less.
        """
        return inverse_laplace(self.error * integrator(order + 1, size), times_s)

    def largest_error_behind(self, order: int, size: float) -> tuple[float, float]:
        """Time and size of the largest `error_behind`."""
        return largest(self.error * integrator(order + 1, size))

    def torque_step(self, torque_nm: float, times_s: list[float]) -> FloatArray:
        """Motor angle after a step of disturbing torque at the motor, rad."""
        return inverse_laplace(self.compliance * integrator(1, torque_nm), times_s)

    def torque_step_peak_rad_per_nm(self) -> float:
        """Largest motor angle after a disturbing torque of 1 N m, rad/(N m)."""
        return largest(self.compliance * integrator())[1]
