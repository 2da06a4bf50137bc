"""Eccentric moment, inertia and friction from the motor torque of steady motion.

    i T = Tg + J_m acc + z (F_m + mu |Tg|)                        T motor torque, z direction of motion
    Tg  = Ms sin x + Mc cos x + z F_l + F_v v + J_l acc           torque in the mesh

The motor's friction grows with the torque that it transmits. Left out, that part looks like 5 % more moment: it turns
round with the direction, as moment does where the mesh torque keeps its sign. All of it at the gantry.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.identification.samples import Floats, Samples

_ITERATIONS: Final = 40
_HALVINGS: Final = 10
# Less than this is rounding, not a better fit.
_LESS: Final = 1.0 - 1e-12
# Begin near the reference gantry: N m, N m, N m, N m, 1, N m s/rad, kg m2.
_START: Final = (1e4, 1e3, 5e3, 5e3, 0.05, 1e4, 2e6)
_SIZE: Final = np.array([1e4, 1e4, 1e3, 1e3, 0.1, 1e4, 1e6])


class TorqueBalance(NamedTuple):
    """The numbers, at the gantry.

    Attributes:
        moment_sine_nm, moment_cosine_nm: torque that holds the load.
        friction_load_side_nm, friction_motor_side_nm: Coulomb friction behind and before the mesh.
        friction_load_ratio: part of the mesh torque that the motor side loses as friction.
        viscous_nm_s_per_rad: growth of friction with speed.
        inertia_load_kg_m2, inertia_motor_kg_m2: behind and before the mesh.
        residual_nm: r.m.s. of what is left, at the gantry.
    """

    moment_sine_nm: float
    moment_cosine_nm: float
    friction_load_side_nm: float
    friction_motor_side_nm: float
    friction_load_ratio: float
    viscous_nm_s_per_rad: float
    inertia_load_kg_m2: float
    inertia_motor_kg_m2: float
    residual_nm: float

    def mesh_torque_nm(self, samples: Samples, *, accelerating: bool = True) -> Floats:
        """Torque in the mesh; `accelerating`: with what the acceleration asks for."""
        acc = samples.acc_rad_s2 if accelerating else 0.0
        return np.asarray(
            self.moment_sine_nm * samples.sine
            + self.moment_cosine_nm * samples.cosine
            + samples.direction * self.friction_load_side_nm
            + self.viscous_nm_s_per_rad * samples.vel_rad_s
            + self.inertia_load_kg_m2 * acc
        )

    def torque_nm(self, samples: Samples) -> Floats:
        """Motor torque times the ratio."""
        mesh = self.mesh_torque_nm(samples)
        lost = self.friction_motor_side_nm + self.friction_load_ratio * np.abs(mesh)
        return np.asarray(mesh + self.inertia_motor_kg_m2 * samples.acc_rad_s2 + samples.direction * lost)


def torque_balance(
    samples: Samples, ratio: float, motor_inertia_kg_m2: float, lack_kg_m2: float
) -> TorqueBalance:
    """Least squares over the samples: Gauss and Newton, each step halved until it lowers what is left.

    Whole steps go round for ever: |Tg| has a corner wherever the mesh torque changes its sign.

    Args:
        motor_inertia_kg_m2: of what turns before the mesh, at the motor.
        lack_kg_m2: torque per acceleration of the motor that the samples do not see
            (`SpeedLoop.sampled_torque_lack_kg_m2`).
    """
    square = ratio * ratio
    wanted = samples.torque_nm * ratio + square * lack_kg_m2 * samples.acc_rad_s2

    def balance(x: Floats) -> TorqueBalance:
        return TorqueBalance._make([*x.tolist(), square * motor_inertia_kg_m2, 0.0])

    def left_over(x: Floats) -> float:
        return float(np.sum((wanted - balance(x).torque_nm(samples)) ** 2))

    x = np.array(_START)
    for _ in range(_ITERATIONS):
        now, before = balance(x).torque_nm(samples), left_over(x)
        slope = np.column_stack([balance(x + 1e-4 * row).torque_nm(samples) - now for row in np.diag(_SIZE)])
        step = np.linalg.lstsq(slope * 1e4, wanted - now, rcond=None)[0] * _SIZE
        share = next(
            (2.0**-k for k in range(_HALVINGS) if left_over(x + 2.0**-k * step) < _LESS * before), None
        )
        if share is None:
            break
        x = x + share * step
    left = wanted - balance(x).torque_nm(samples)
    return balance(x)._replace(residual_nm=float(np.sqrt(np.mean(left**2))))
