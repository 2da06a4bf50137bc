"""Eccentric moment, inertia and friction from the motor torque of steady motion.

    i T = Tg + J_m acc + z (F_m + mu |Tg|)                        T motor torque, z direction of motion
    Tg  = Ms sin x + Mc cos x + M0 + z F_l + F_v v + J_l acc      torque in the mesh

M0 is what pulls one way at every angle: the mean of a wind, a hose. It is no part of what a controller is told.
The motor's friction grows with the torque that it transmits. Left out, that part looks like 5 % more moment: it turns
round with the direction, as moment does where the mesh torque keeps its sign. All of it at the gantry.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.identification.least_squares import Estimate, estimate_of
from gantryctl.engineering.identification.samples import Floats, Samples

_ITERATIONS: Final = 40
_HALVINGS: Final = 10
# Less than this is rounding, not a better fit.
_LESS: Final = 1.0 - 1e-12
_STEP: Final = 1e-4
# Before anything is measured: friction per load, and the others in parts of the largest torque that was seen.
_LOAD_RATIO_SPREAD: Final = 0.3
_TORQUE_SPREAD: Final = 3.0


class TorqueBalance(NamedTuple):
    """The numbers, at the gantry.

    Attributes:
        moment_sine_nm, moment_cosine_nm, moment_constant_nm: torque that holds the load.
        friction_load_side_nm, friction_motor_side_nm: Coulomb friction behind and before the mesh.
        friction_load_ratio: part of the mesh torque that the motor side loses as friction.
        viscous_nm_s_per_rad: growth of friction with speed.
        inertia_load_kg_m2, inertia_motor_kg_m2: behind and before the mesh.
        residual_nm: r.m.s. of what is left, at the gantry.
    """

    moment_sine_nm: float
    moment_cosine_nm: float
    moment_constant_nm: float
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
            + self.moment_constant_nm
            + samples.direction * self.friction_load_side_nm
            + self.viscous_nm_s_per_rad * samples.vel_rad_s
            + self.inertia_load_kg_m2 * acc
        )

    def torque_nm(self, samples: Samples) -> Floats:
        """Motor torque times the ratio."""
        mesh = self.mesh_torque_nm(samples)
        lost = self.friction_motor_side_nm + self.friction_load_ratio * np.abs(mesh)
        return np.asarray(mesh + self.inertia_motor_kg_m2 * samples.acc_rad_s2 + samples.direction * lost)


class BalanceFit(NamedTuple):
    """The balance, and how sure its values are.

    Attributes:
        half_width: half of the 95 % interval of each value of the balance, by its name; of `inertia_kg_m2` and
            `friction_nm` too, the sums of both sides.
    """

    balance: TorqueBalance
    half_width: dict[str, float]


def torque_balance(
    samples: Samples, ratio: float, motor_inertia_kg_m2: float, lack_kg_m2: float
) -> BalanceFit:
    """Least squares over the samples: Gauss and Newton, each step halved until it lowers what is left.

    Whole steps never end: |Tg| has a corner wherever the mesh torque changes its sign.

    Args:
        motor_inertia_kg_m2: of what turns before the mesh, at the motor.
        lack_kg_m2: torque per acceleration of the motor that the samples do not see
            (`SpeedLoop.sampled_torque_lack_kg_m2`).
    """
    square = ratio * ratio
    inertia_motor = square * motor_inertia_kg_m2
    wanted = samples.torque_nm * ratio + square * lack_kg_m2 * samples.acc_rad_s2
    spread = _spread(samples, wanted)

    def balance(x: Floats) -> TorqueBalance:
        return TorqueBalance._make([*x.tolist(), inertia_motor, 0.0])

    def slope_at(x: Floats) -> Floats:
        now, steps = balance(x).torque_nm(samples), np.diag(_STEP * spread)
        sides = [(balance(x + step).torque_nm(samples) - now) / step.sum() for step in steps]
        return np.column_stack(sides)

    x = _first(samples, wanted - inertia_motor * samples.acc_rad_s2)
    # One sample over what each value may be: on a turn of the reference gantry it moves nothing.
    prior = float(np.std(wanted - balance(x).torque_nm(samples))) / spread

    def left_over(x: Floats) -> float:
        return float(np.sum((wanted - balance(x).torque_nm(samples)) ** 2) + np.sum((prior * x) ** 2))

    for _ in range(_ITERATIONS):
        before = left_over(x)
        columns = np.vstack([slope_at(x), np.diag(prior)]) * spread
        off = np.append(wanted - balance(x).torque_nm(samples), -prior * x)
        step = np.linalg.lstsq(columns, off, rcond=None)[0] * spread
        share = next(
            (2.0**-k for k in range(_HALVINGS) if left_over(x + 2.0**-k * step) < _LESS * before), None
        )
        if share is None:
            break
        x = x + share * step
    left = wanted - balance(x).torque_nm(samples)
    found = balance(x)._replace(residual_nm=float(np.sqrt(np.mean(left**2))))
    return BalanceFit(found, _half_widths(estimate_of(x, slope_at(x), left, samples.stretch, spread)))


def _spread(samples: Samples, wanted: Floats) -> Floats:
    """What each value may be before anything is measured."""
    torque = _TORQUE_SPREAD * float(np.max(np.abs(wanted)))
    speed, acc = (float(np.max(np.abs(v))) for v in (samples.vel_rad_s, samples.acc_rad_s2))
    return np.array(
        [torque, torque, torque, torque, torque, _LOAD_RATIO_SPREAD, torque / speed, torque / max(acc, 1e-9)]
    )


def _first(samples: Samples, wanted: Floats) -> Floats:
    """Where the search begins: without friction that grows with the load, and as much on either side."""
    z = samples.direction
    columns = [samples.sine, samples.cosine, np.ones_like(z), z, samples.vel_rad_s, samples.acc_rad_s2]
    sine, cosine, constant, friction, viscous, inertia = np.linalg.lstsq(
        np.column_stack(columns), wanted, rcond=None
    )[0]
    return np.array([sine, cosine, constant, 0.5 * friction, 0.5 * friction, 0.0, viscous, inertia])


def _half_widths(found: Estimate) -> dict[str, float]:
    names = TorqueBalance._fields[: len(found.values)]
    unit = np.eye(len(names))
    by_name = {name: found.half_width_of(row) for name, row in zip(names, unit, strict=True)}
    both = unit[names.index("friction_load_side_nm")] + unit[names.index("friction_motor_side_nm")]
    return by_name | {
        "friction_nm": found.half_width_of(both),
        "inertia_kg_m2": by_name["inertia_load_kg_m2"],
    }
