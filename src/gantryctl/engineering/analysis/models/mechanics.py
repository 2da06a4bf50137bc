"""The gantry as a linear spring-mass system: rigid, two masses, or with the rocking base (plant equations S1
to S5).

Coordinates are the motor angle relative to the base, the load angle and the base angle. Gear error, backlash
and torque ripple are left out; friction and hysteresis are left out, slide, or hold (`Friction`). It is
derived from the machine's [plant]: an analysis of the model, never an input of the controller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from gantryctl import _core
from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray
from gantryctl.machine import Machine
from gantryctl.wiring.plant_effects import expect_one_pinion
from gantryctl.wiring.simulator import plant_params

# Stands for a current loop that follows at once: 1 us.
IDEAL_BANDWIDTH_RAD_S: Final = 1e6

MOTOR, LOAD, BASE = "motor", "load", "base"


class PlantKind(Enum):
    """Bodies that move by themselves."""

    RIGID = "rigid"
    TWO_MASS = "two-mass"
    FULL = "full"


class Friction(Enum):
    """Small-signal friction of motor and rollers, and hysteresis of the reducer (S3, S4).

    NONE: absent, also what a swing much larger than the hysteresis (10 urad at the gantry) sees. SLIDING: the axis
    turns, the friction of motor and rollers changes with speed only by its viscous part. HOLDING: the axis stands and
    both are springs sigma0 with their damping sigma1. The hysteresis is a spring h/z_h beside the transmission in the
    last two, because a small swing does not take it to its end even while the axis turns.
    """

    NONE = "none"
    SLIDING = "sliding"
    HOLDING = "holding"


@dataclass(frozen=True)
class Mechanics:
    """M q'' + D q' + K q = e_motor Te, Te' = wc (u - Te); SI, motor coordinate at the motor, the others at
    the gantry.

    Attributes:
        coordinates: names of q in order; the first is the motor.
        inertia: diagonal of M, kg m2. damping: D. stiffness: K.
        ratio: motor turns per gantry turn.
        current_bandwidth_rad_s: wc. torque_constant_ratio: torque on the shaft over Te, that of the drive.
    """

    coordinates: tuple[str, ...]
    inertia: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    ratio: float
    current_bandwidth_rad_s: float
    torque_constant_ratio: float = 1.0

    @property
    def size(self) -> int:
        """Number of states: q, q', Te."""
        return 2 * len(self.coordinates) + 1

    @property
    def a(self) -> FloatArray:
        """State matrix over (q, q', Te)."""
        n = len(self.coordinates)
        a = np.zeros((self.size, self.size))
        a[:n, n : 2 * n] = np.eye(n)
        a[n : 2 * n, :n] = -self.stiffness / self.inertia[:, None]
        a[n : 2 * n, n : 2 * n] = -self.damping / self.inertia[:, None]
        a[n, -1] = self.torque_constant_ratio / self.inertia[0]
        a[-1, -1] = -self.current_bandwidth_rad_s
        return a

    @property
    def b(self) -> FloatArray:
        """Input column: the torque set-point u, N m."""
        b = np.zeros(self.size)
        b[-1] = self.current_bandwidth_rad_s
        return b

    def position(self, coordinate: str) -> FloatArray:
        """Output row of an angle; a rigid load is the motor angle divided by the ratio."""
        row = np.zeros(self.size)
        if coordinate in self.coordinates:
            row[self.coordinates.index(coordinate)] = 1.0
        elif coordinate == LOAD:
            row[0] = 1.0 / self.ratio
        return row

    def velocity(self, coordinate: str) -> FloatArray:
        """Output row of a speed."""
        n = len(self.coordinates)
        return np.concatenate([np.zeros(n), self.position(coordinate)[:n], [0.0]])

    @property
    def torque(self) -> FloatArray:
        """Output row of the motor torque Te."""
        row = np.zeros(self.size)
        row[-1] = 1.0
        return row

    def held_poles(self) -> ComplexArray:
        """Poles with the motor held, upper half plane, by rising frequency: the zeros of torque to motor
        angle.
        """
        return _oscillating(self.inertia[1:], self.damping[1:, 1:], self.stiffness[1:, 1:])

    def free_poles(self) -> ComplexArray:
        """Poles of the mechanics alone, nothing held, no drive; upper half plane, by rising frequency."""
        return _oscillating(self.inertia, self.damping, self.stiffness)


@dataclass(frozen=True)
class Variation:
    """Values of the uncertain parts of the gantry; None takes the machine's own.

    Attributes:
        stiffness_nm_per_rad: transmission, at the gantry. damping_ratio: of the load on it, motor held, base
        fixed. load_inertia_kg_m2: at the gantry. motor_inertia_kg_m2: rotor with everything on its shaft.
    """

    stiffness_nm_per_rad: float | None = None
    damping_ratio: float | None = None
    load_inertia_kg_m2: float | None = None
    motor_inertia_kg_m2: float | None = None


NOMINAL: Final = Variation()


def mechanics(
    machine: Machine,
    kind: PlantKind,
    friction: Friction = Friction.NONE,
    variation: Variation = NOMINAL,
    angle_rad: float = 0.0,
) -> Mechanics:
    """The linear plant of a machine file.

    Args:
        machine: [plant], [motor] and the current loop are read.
        kind: which bodies move by themselves.
        friction: small-signal friction and hysteresis; an element whose switch is off is absent anyway.
        variation: other values than the machine's.
        angle_rad: gantry angle; the eccentric moment is linearised there, and its torque on the mesh (with the
            rollers' friction while the axis slides in positive direction) widens the hysteresis.

    Raises:
        ConfigError: the machine has two pinions.
    """
    expect_one_pinion(machine, "the linear model (analyse, tune)")
    p = _with(plant_params(machine), machine.plant.transmission.damping_ratio, variation)
    if kind is PlantKind.RIGID:
        return _rigid(p, friction, angle_rad)
    return _flexible(p, friction, angle_rad, with_base=kind is PlantKind.FULL and p.base)


def _with(p: _core.PlantParams, damping_ratio: float, variation: Variation) -> _core.PlantParams:
    """Parameters with the uncertain ones replaced; damping follows c = 2 zeta sqrt(K J)."""
    p.stiffness_1_nm_per_rad = (
        p.stiffness_1_nm_per_rad if variation.stiffness_nm_per_rad is None else variation.stiffness_nm_per_rad
    )
    p.inertia_load_kg_m2 = (
        p.inertia_load_kg_m2 if variation.load_inertia_kg_m2 is None else variation.load_inertia_kg_m2
    )
    p.inertia_motor_kg_m2 = (
        p.inertia_motor_kg_m2 if variation.motor_inertia_kg_m2 is None else variation.motor_inertia_kg_m2
    )
    # S1: c = 2 zeta sqrt(K1 J), with the varied stiffness and inertia.
    zeta = damping_ratio if variation.damping_ratio is None else variation.damping_ratio
    p.damping_nm_s_per_rad = 2.0 * zeta * math.sqrt(p.stiffness_1_nm_per_rad * p.inertia_load_kg_m2)
    return p


def _gravity(p: _core.PlantParams, angle_rad: float) -> float:
    """Stiffness of the eccentric moment at an angle, -T_u cos(theta - theta_u0), N m/rad."""
    # S5: T_u sin(theta - theta_u0), linearised.
    return -p.eccentric_moment_nm * math.cos(angle_rad - p.eccentric_angle_rad)


def _rigid(p: _core.PlantParams, friction: Friction, angle_rad: float) -> Mechanics:
    (motor_k, motor_d), (roller_k, roller_d) = _motor_friction(p, friction), _roller_friction(p, friction)
    square = p.ratio**2
    return Mechanics(
        coordinates=(MOTOR,),
        inertia=np.array([p.inertia_load_kg_m2 / square + p.inertia_motor_kg_m2]),
        damping=np.array([[motor_d + roller_d / square]]),
        stiffness=np.array([[motor_k + (roller_k + _gravity(p, angle_rad)) / square]]),
        ratio=p.ratio,
        current_bandwidth_rad_s=p.current_bandwidth_rad_s or IDEAL_BANDWIDTH_RAD_S,
        torque_constant_ratio=p.torque_constant_ratio,
    )


def _flexible(p: _core.PlantParams, friction: Friction, angle_rad: float, with_base: bool) -> Mechanics:
    """Every element acts along a direction in (motor, load, base): K and D are sums of k g g^T."""
    # S3: D = thm/i - theta + phi; gear errors have no part in a small signal.
    twist = np.array([1.0 / p.ratio, -1.0, 1.0])
    # S4: the rollers turn with w - phi'.
    roller = np.array([0.0, 1.0, -1.0])
    motor, load, base = np.eye(3)
    parts = [
        (twist, p.stiffness_1_nm_per_rad, p.damping_nm_s_per_rad),
        (twist, _hysteresis(p, friction, angle_rad), 0.0),
        (roller, *_roller_friction(p, friction)),
        (motor, *_motor_friction(p, friction)),
        (load, _gravity(p, angle_rad), 0.0),
        (base, p.base_stiffness_nm_per_rad, p.base_damping_nm_s_per_rad),
    ]
    stiffness = sum((k * np.outer(g, g) for g, k, _ in parts), np.zeros((3, 3)))
    damping = sum((d * np.outer(g, g) for g, _, d in parts), np.zeros((3, 3)))
    inertia = np.array([p.inertia_motor_kg_m2, p.inertia_load_kg_m2, p.base_inertia_kg_m2])
    n = 3 if with_base else 2
    return Mechanics(
        coordinates=(MOTOR, LOAD, BASE)[:n],
        inertia=inertia[:n],
        damping=damping[:n, :n],
        stiffness=stiffness[:n, :n],
        ratio=p.ratio,
        current_bandwidth_rad_s=p.current_bandwidth_rad_s or IDEAL_BANDWIDTH_RAD_S,
        torque_constant_ratio=p.torque_constant_ratio,
    )


def _motor_friction(p: _core.PlantParams, friction: Friction) -> tuple[float, float]:
    """Stiffness and damping of the motor friction, at the motor."""
    if not p.motor_friction:
        return 0.0, 0.0
    stiffness = p.motor_coulomb_nm / p.motor_presliding_rad
    micro_damping = p.motor_micro_damping * math.sqrt(stiffness * p.inertia_motor_kg_m2)
    return _element(friction, stiffness, micro_damping, p.motor_viscous_nm_s_per_rad)


def _roller_friction(p: _core.PlantParams, friction: Friction) -> tuple[float, float]:
    """Stiffness and damping of the rollers, at the gantry."""
    if not p.roller_friction:
        return 0.0, 0.0
    stiffness = p.roller_coulomb_nm / p.roller_presliding_rad
    micro_damping = p.roller_micro_damping * math.sqrt(stiffness * p.inertia_load_kg_m2)
    return _element(friction, stiffness, micro_damping, p.roller_viscous_nm_s_per_rad)


def _hysteresis(p: _core.PlantParams, friction: Friction, angle_rad: float) -> float:
    """Stiffness h/z_h of the reducer's hysteresis, h = T_h0 + mu_h |Ts|, at the gantry."""
    if not p.hysteresis or friction is Friction.NONE:
        return 0.0
    load = -p.eccentric_moment_nm * math.sin(angle_rad - p.eccentric_angle_rad)
    if friction is Friction.SLIDING and p.roller_friction:
        # The mesh drives the rollers as well while the axis turns.
        load += p.roller_coulomb_nm
    # S3: while it holds, Th' = (h/z_h) D', a spring beside the transmission.
    return (p.hysteresis_torque_nm + p.hysteresis_load_ratio * abs(load)) / p.hysteresis_length_rad


def _element(
    friction: Friction, stiffness: float, micro_damping: float, viscous: float
) -> tuple[float, float]:
    match friction:
        case Friction.NONE:
            return 0.0, 0.0
        case Friction.SLIDING:
            return 0.0, viscous
        case Friction.HOLDING:
            # S4 before sliding: F = s0 z + s1 v + Fv v.
            return stiffness, micro_damping + viscous


def _oscillating(inertia: FloatArray, damping: FloatArray, stiffness: FloatArray) -> ComplexArray:
    n = len(inertia)
    if n == 0:
        return np.zeros(0, dtype=np.complex128)
    a = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-stiffness / inertia[:, None], -damping / inertia[:, None]]]
    )
    poles = np.linalg.eigvals(a).astype(np.complex128)
    # a free body has a double pole at 0, which rounding turns into a tiny pair
    upper = poles[poles.imag > 1e-6 * np.abs(poles).max()]
    return np.asarray(upper[np.argsort(np.abs(upper))])
