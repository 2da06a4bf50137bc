"""The rigid drive train: from what the gantry does to the torque of the motor, loss by loss.

At the gantry T_out = J a + T_e + (Fc + Fv |w|) sgn w, with T_e the torque against the eccentric moment; at the motor
T = T_out/i (1 + mu sgn(T_out w)) + (Jm + Jin) a i + (Fc,m + Fv,m |w| i) sgn w (plant equations S1, S4, as one body).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.sizing.equations import mean_acceleration_rad_s2, reflected_inertia_kg_m2
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.units import DEG_S_PER_R_MIN, GRAVITY_M_S2, rad

Floats = NDArray[np.float64]


class Part(NamedTuple):
    """One part of a motor torque."""

    name: str
    torque_nm: float


@dataclass(frozen=True)
class Train:
    """A requirement sheet with the rotor of one motor; SI, speeds and accelerations at the gantry."""

    sheet: Sheet
    rotor_kg_m2: float

    @property
    def ratio(self) -> float:
        """Motor turns per gantry turn."""
        return self.sheet.gears.ratio

    @property
    def fast_inertia_kg_m2(self) -> float:
        """Rotor and reducer input, at the motor shaft."""
        return self.rotor_kg_m2 + self.sheet.gears.input_inertia_kg_m2

    @property
    def inertia_kg_m2(self) -> float:
        """Everything as one body, at the motor shaft."""
        return reflected_inertia_kg_m2(self.sheet.load.inertia_kg_m2, self.ratio) + self.fast_inertia_kg_m2

    @property
    def inertia_ratio(self) -> float:
        """Load to rotor and reducer input, both at the motor shaft."""
        return reflected_inertia_kg_m2(self.sheet.load.inertia_kg_m2, self.ratio) / self.fast_inertia_kg_m2

    @property
    def speed_rad_s(self) -> float:
        """Highest speed."""
        return rad(self.sheet.motion.speed_max_r_min * DEG_S_PER_R_MIN)

    @property
    def sizing_acc_rad_s2(self) -> float:
        """Acceleration of the sizing case."""
        return mean_acceleration_rad_s2(self.sheet.motion.speed_max_r_min, self.sheet.motion.sizing_time_s)

    @property
    def normal_acc_rad_s2(self) -> float:
        """Acceleration of normal moves."""
        return rad(self.sheet.motion.acc_deg_s2)

    @property
    def quick_dec_rad_s2(self) -> float:
        """Least deceleration of a quick stop within the permitted angle, v^2/2 (angle - v reaction)."""
        # The axis travels on at full speed until the stop begins.
        way = rad(self.sheet.required.stopping_angle_deg) - self.speed_rad_s * REACTION_S
        return self.speed_rad_s**2 / (2.0 * way)

    @property
    def eccentric_nm(self) -> float:
        """Eccentric moment of the balanced machine, mass x g x eccentricity."""
        load = self.sheet.load
        return load.mass_kg * GRAVITY_M_S2 * load.eccentricity_m

    def against_nm(self, angle_rad: Floats | float) -> Floats:
        """Torque against the eccentric moment at an angle; the centre of mass hangs down at the eccentric angle."""
        return np.asarray(self.eccentric_nm * np.sin(angle_rad - rad(self.sheet.load.eccentric_angle_deg)))

    def load_nm(self, acc: Floats | float, vel: Floats | float, against: Floats | float) -> Floats:
        """Torque that ring and rollers take, at the gantry."""
        load = self.sheet.load
        rollers = load.friction_coulomb_nm * np.sign(vel)
        rollers = rollers + load.friction_viscous_nm_s_per_rad * np.asarray(vel)
        return np.asarray(load.inertia_kg_m2 * np.asarray(acc) + against + rollers)

    def motor_nm(self, acc: Floats | float, vel: Floats | float, against: Floats | float) -> Floats:
        """Motor torque; standing still no friction is counted on, neither helping nor hindering."""
        gears, i = self.sheet.gears, self.ratio
        # Friction under load is a part of the torque that the reducer transmits: mu_m of plant equations S4.
        through = self.load_nm(acc, vel, against) / i
        loss = gears.load_loss_ratio * np.abs(through) * np.sign(vel)
        idle = gears.friction_coulomb_nm * np.sign(vel)
        idle = idle + gears.friction_viscous_nm_s_per_rad * np.asarray(vel) * i
        return np.asarray(through + loss + self.fast_inertia_kg_m2 * np.asarray(acc) * i + idle)

    def parts(self, acc_rad_s2: float) -> list[Part]:
        """The largest torque: accelerating at the highest speed against the largest eccentric moment, by parts."""
        s, i, w = self.sheet, self.ratio, self.speed_rad_s
        against = s.load.eccentric_check_moment_nm
        through = float(self.load_nm(acc_rad_s2, w, against)) / i
        rollers = s.load.friction_coulomb_nm + s.load.friction_viscous_nm_s_per_rad * w
        return [
            Part("load inertia alone", s.load.inertia_kg_m2 * acc_rad_s2 / i),
            Part("rotor", self.rotor_kg_m2 * acc_rad_s2 * i),
            Part("reducer input", s.gears.input_inertia_kg_m2 * acc_rad_s2 * i),
            Part("largest eccentric moment", against / i),
            Part("rollers", rollers / i),
            Part("loss under load", s.gears.load_loss_ratio * through),
            Part(
                "friction of motor and reducer",
                s.gears.friction_coulomb_nm + s.gears.friction_viscous_nm_s_per_rad * w * i,
            ),
        ]

    def largest_nm(self, acc_rad_s2: float) -> float:
        """Sum of `parts`."""
        return sum(part.torque_nm for part in self.parts(acc_rad_s2))

    def efficiency(self, acc_rad_s2: float) -> float:
        """Efficiency of the transmission in this case: torque at the gantry over i x the torque into the reducer."""
        s, w = self.sheet, self.speed_rad_s
        # Friction of motor and reducer counts against the transmission, the inertia of the rotor does not.
        out = float(self.load_nm(acc_rad_s2, w, s.load.eccentric_check_moment_nm))
        into = self.largest_nm(acc_rad_s2) - self.fast_inertia_kg_m2 * acc_rad_s2 * self.ratio
        return out / (self.ratio * into)

    @property
    def hold_nm(self) -> float:
        """Motor torque that holds the largest eccentric moment, without friction."""
        return self.sheet.load.eccentric_check_moment_nm / self.ratio

    @property
    def quick_stop_nm(self) -> float:
        """Motor torque of the quick stop, the largest eccentric moment driving, no friction counted on."""
        return self.inertia_kg_m2 * self.quick_dec_rad_s2 * self.ratio + self.hold_nm

    def reducer_nm(self, acc_rad_s2: float, swing: float = 1.0) -> float:
        """Torque at the reducer output, accelerating against the largest eccentric moment.

        Args:
            acc_rad_s2: at the gantry.
            swing: factor on the accelerating part: a step of the acceleration swings a load on a spring up to 2.
        """
        s = self.sheet
        # A step of the acceleration swings a load on a spring up to twice its steady wind-up; rigid, the sizing case
        # puts 17.6 kN m on the reducer.
        held = s.load.eccentric_check_moment_nm + s.load.friction_coulomb_nm
        held += s.load.friction_viscous_nm_s_per_rad * self.speed_rad_s
        return (swing * s.load.inertia_kg_m2 * acc_rad_s2 + held) / s.gears.ring_ratio

    @property
    def kinetic_energy_j(self) -> float:
        """Kinetic energy of the whole train at the highest speed."""
        return 0.5 * self.inertia_kg_m2 * (self.ratio * self.speed_rad_s) ** 2

    @property
    def braking_power_w(self) -> float:
        """Mechanical power into the motor: slowing down from the highest speed as hard as in the sizing case, the
        largest eccentric moment driving.
        """
        w, against = self.speed_rad_s, -self.sheet.load.eccentric_check_moment_nm
        torque = float(self.motor_nm(-self.sizing_acc_rad_s2, w, against))
        return max(0.0, -torque * w * self.ratio)


ANGLES_DEG = (0.0, 45.0, 90.0, 135.0, 180.0)


class AngleRow(NamedTuple):
    """Motor torques at one angle, N m, with the eccentric moment of the balanced machine.

    Attributes:
        against_knm: torque against the eccentric moment, kN m at the gantry.
        hold: standing. steady: turning outwards at the highest speed. back: turning back. normal, sizing: accelerating
            outwards at the highest speed.
    """

    angle_deg: float
    against_knm: float
    hold: float
    steady: float
    back: float
    normal: float
    sizing: float


def over_angle(train: Train) -> list[AngleRow]:
    """The eccentric moment over the angle, and what it asks of the motor."""
    rows = []
    w, normal, sizing = train.speed_rad_s, train.normal_acc_rad_s2, train.sizing_acc_rad_s2
    cases = ((0.0, w), (0.0, -w), (normal, w), (sizing, w))
    for angle in ANGLES_DEG:
        # Angles from where the centre of mass hangs down, so that the rows are alike on every machine.
        at = math.fmod(angle + train.sheet.load.eccentric_angle_deg, 360.0)
        against = float(train.against_nm(rad(at)))
        moving = [float(train.motor_nm(acc, vel, against)) for acc, vel in cases]
        rows.append(AngleRow(at, against / 1e3, against / train.ratio, *moving))
    return rows
