"""The paper's loops on two masses: rotor, spring and damper of the transmission, load. Continuous, ideal
torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray, roots
from gantryctl.engineering.analysis.models.rigid import RigidLoop


@dataclass(frozen=True)
class TwoMass:
    """Motor and load with a spring between them; stiffness and damping at the gantry.

    Attributes:
        load_inertia_kg_m2: at the gantry.
        motor_inertia_kg_m2: at the motor shaft.
        ratio: motor turns per gantry turn.
        stiffness_nm_per_rad: k, at the gantry.
        damping_ratio: of the load on this spring with the motor held.
    """

    load_inertia_kg_m2: float
    motor_inertia_kg_m2: float
    ratio: float
    stiffness_nm_per_rad: float
    damping_ratio: float

    @property
    def damping_nm_s_per_rad(self) -> float:
        """c = 2 zeta sqrt(k J), at the gantry."""
        return 2.0 * self.damping_ratio * math.sqrt(self.stiffness_nm_per_rad * self.load_inertia_kg_m2)

    @property
    def antiresonance_hz(self) -> float:
        """The load on its spring with the motor held."""
        return math.sqrt(self.stiffness_nm_per_rad / self.load_inertia_kg_m2) / (2.0 * math.pi)

    @property
    def resonance_hz(self) -> float:
        """Motor against load, both free."""
        compliance = 1.0 / self.load_inertia_kg_m2 + 1.0 / (self.motor_inertia_kg_m2 * self.ratio**2)
        return math.sqrt(self.stiffness_nm_per_rad * compliance) / (2.0 * math.pi)

    @property
    def load_polynomial(self) -> FloatArray:
        """J s^2 + c s + k."""
        return np.array([self.load_inertia_kg_m2, self.damping_nm_s_per_rad, self.stiffness_nm_per_rad])

    def windup_deg(self, torque_nm: float) -> float:
        """Wind-up of the spring under a torque at the gantry, motor held, deg."""
        return math.degrees(torque_nm / self.stiffness_nm_per_rad)


@dataclass(frozen=True)
class TwoMassLoop:
    """`TwoMass` under the gains of a `RigidLoop` (whose inertia is not used). The loop closes on the motor
    angle.
    """

    plant: TwoMass
    gains: RigidLoop

    @cached_property
    def poles(self) -> ComplexArray:
        """Closed-loop poles, rad/s: s^3 [Jm (J s^2 + c s + k) + (J/i^2) (c s + k)] + PI (s + Kpp) (J s^2 + c
        s + k).
        """
        plant, gains = self.plant, self.gains
        load = plant.load_polynomial
        reflected = plant.load_inertia_kg_m2 / plant.ratio**2
        # Motor and load with the spring between them, the load's share reflected by 1/i^2.
        inertia = np.polyadd(plant.motor_inertia_kg_m2 * load, reflected * load[1:])
        pi = gains.kvp_nm_s_per_rad * np.array([1.0, 1.0 / gains.tvi_s])
        controller = np.polymul(pi, [1.0, gains.kpp_per_s])
        return roots(np.polyadd(np.polymul(inertia, [1.0, 0.0, 0.0, 0.0]), np.polymul(controller, load)))

    @property
    def max_real_part(self) -> float:
        """Largest real part of all poles, rad/s; positive = unstable."""
        return float(self.poles.real.max())

    @property
    def load_mode(self) -> complex:
        """The least damped oscillating pole (upper half plane): the load on its spring."""
        # Seen from the load the motor is a damper with the sign of 1 - Kpp/(w^2 Tvi): below sqrt(Kpp/Tvi), 5
        # Hz with the paper's gains, it feeds the swing.
        oscillating = [complex(pole) for pole in self.poles if pole.imag > 0.0]
        return min(oscillating, key=lambda pole: -pole.real / abs(pole))

    @property
    def load_mode_hz(self) -> float:
        """Natural frequency of the load mode."""
        return abs(self.load_mode) / (2.0 * math.pi)

    @property
    def load_mode_zeta(self) -> float:
        """Damping ratio of the load mode in the closed loop; negative = limit cycle."""
        return -self.load_mode.real / abs(self.load_mode)
