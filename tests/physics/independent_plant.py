"""The plant equations written a second time, from the text, for scipy: no code shared with the core.

Only the tests use it. One function of time and state; every parameter comes from the machine file's own numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import RK45

from gantryctl.machine import Machine


@dataclass
class IndependentPlant:
    """Motor, gears, load, base and friction of a machine file; state order: thm wm th w ph dph Te Th zl zm."""

    machine: Machine
    ring_factor: bool = True  # (1 - e_r') on the mesh torque (S5); the reference left it out

    def __post_init__(self) -> None:
        m, p = self.machine, self.machine.plant
        t, ge = p.transmission, p.gear_error
        self.i = m.axis.reducer_ratio * m.axis.ring_ratio
        self.i1, self.i2 = m.axis.reducer_ratio, m.axis.ring_ratio
        self.J, self.Jm = p.load.inertia_kg_m2, m.motor.inertia_kg_m2 + p.motor.wave_generator_inertia_kg_m2
        self.K = [
            1 / (1 / (self.i2**2 * k) + 1 / t.rest_stiffness_nm_per_rad)
            for k in (
                t.reducer_stiffness_1_nm_per_rad,
                t.reducer_stiffness_2_nm_per_rad,
                t.reducer_stiffness_3_nm_per_rad,
            )
        ]
        self.T1, self.T2 = t.reducer_torque_1_nm * self.i2, t.reducer_torque_2_nm * self.i2
        self.c = 2 * t.damping_ratio * math.sqrt(self.K[0] * self.J)
        self.b2 = t.backlash_mm * 1e-3 / ge.ring_radius_m / 2
        self.Tu = p.load.eccentric_sign * p.load.mass_kg * 9.81 * p.load.eccentricity_m
        self.kb = p.base.inertia_kg_m2 * (2 * math.pi * p.base.frequency_hz) ** 2
        self.cb = 2 * p.base.damping_ratio * 2 * math.pi * p.base.frequency_hz * p.base.inertia_kg_m2
        r, s, ph = ge.ring_radius_m, ge.scale, ge.phases_rad
        self.ring = [(n, s * um * 1e-6 / r, ph[n - 1]) for n, um in enumerate(ge.ring_um, 1)]
        self.cycles = [
            (2.0, s * ge.reducer_2x_rad / self.i2, ph[12]),
            (1.0, s * ge.reducer_1x_rad / self.i2, ph[13]),
            (4.0, s * ge.reducer_4x_rad / self.i2, ph[14]),
            (1 / self.i1, s * (ge.output_1x_rad / self.i2 + ge.pinion_1x_um * 1e-6 / r), ph[15]),
            (ge.pinion_teeth / self.i1, s * ge.mesh_um * 1e-6 / r, ph[16]),
        ]
        self.wc = 2 * math.pi * m.drive.current_loop.bandwidth_hz

    def gear_error(self, thm: float, rho: float) -> tuple[float, float, float, float]:
        """e_r, e_r', e_m, e_m'."""
        er = der = em = dem = 0.0
        for n, a, q in self.ring:
            er += a * math.sin(n * rho + q)
            der += a * n * math.cos(n * rho + q)
        for f, a, q in self.cycles:
            em += a * math.sin(f * thm + q)
            dem += a * f * math.cos(f * thm + q)
        return er, der, em, dem

    @staticmethod
    def gate(v: float, z: float, zss: float) -> float:
        """Dupont's gate with break-away ratio 0.6."""
        if v * z <= 0:
            return 0.0
        a = abs(z) / zss
        if a <= 0.6:
            return 0.0
        return 1.0 if a >= 1 else 0.5 + 0.5 * math.sin(math.pi * (a - 0.8) / 0.4)

    def friction(
        self, f: Any, vs: float, inertia: float, extra: float, v: float, z: float
    ) -> tuple[float, float]:
        """Torque and z'."""
        s0 = f.coulomb_nm / f.presliding_rad
        g = f.coulomb_nm + (f.breakaway_nm - f.coulomb_nm) * math.exp(-((v / vs) ** 2)) + extra
        zss = g / s0
        dz = v - self.gate(v, z, zss) * abs(v) * z / zss
        s1 = f.micro_damping * math.sqrt(s0 * inertia) * math.exp(-((v / (5 * vs)) ** 2))
        return s0 * z + s1 * dz + f.viscous_nm_s_per_rad * v, dz

    def spring(self, x: float) -> float:
        """Torque of the three-slope spring for x >= 0."""
        x1 = self.T1 / self.K[0]
        x2 = x1 + (self.T2 - self.T1) / self.K[1]
        if x < x1:
            return self.K[0] * x
        return self.T1 + self.K[1] * (x - x1) if x < x2 else self.T2 + self.K[2] * (x - x2)

    def mesh(self, d: float, dd: float, th: float) -> tuple[float, float]:
        """Tg and Th'."""
        t = self.machine.plant.transmission
        if abs(d) <= self.b2:
            return 0.0, -th / 0.01
        de = d - math.copysign(self.b2, d)
        ts = math.copysign(self.spring(abs(de)), de)
        tg = ts + self.c * dd + th
        if self.b2 > 0 and tg * de < 0:
            tg = 0.0
        h = t.hysteresis_torque_nm + t.hysteresis_load_ratio * abs(ts)
        return tg, h / t.hysteresis_length_rad * (dd - self.gate(dd, th, h) * abs(dd) * th / h)

    def mesh_of(self, x: np.ndarray) -> float:
        """Tg of a state."""
        thm, wm, th, w, ph, dph, _, hys, _, _ = x
        er, der, em, dem = self.gear_error(thm, th - ph)
        return self.mesh(
            thm / self.i + em + er - (th - ph), wm * (1 / self.i + dem) - (w - dph) * (1 - der), hys
        )[0]

    def slope(self, x: np.ndarray, u: float) -> list[float]:
        """x' with torque set-point u."""
        thm, wm, th, w, ph, dph, te, hys, zl, zm = (float(v) for v in x)
        p = self.machine.plant
        rho = th - ph
        er, der, em, dem = self.gear_error(thm, rho)
        d = thm / self.i + em + er - rho
        dd = wm * (1 / self.i + dem) - (w - dph) * (1 - der)
        tg, dhys = self.mesh(d, dd, hys)
        fm, dzm = self.friction(
            p.motor_friction,
            p.motor_friction.stribeck_rad_s,
            self.Jm,
            p.motor_friction.load_ratio * abs(tg) / self.i,
            wm,
            zm,
        )
        fr, dzl = self.friction(
            p.roller_friction, math.radians(p.roller_friction.stribeck_deg_s), self.J, 0.0, w - dph, zl
        )
        ripple = (
            p.motor.torque_ripple_nm * math.sin(p.motor.torque_ripple_order * thm) * min(1.0, abs(te) / 20)
        )
        am = (te + ripple - fm - tg * (1 / self.i + dem)) / self.Jm
        at_ring = tg * (1 - der) if self.ring_factor else tg
        al = (at_ring - fr + self.Tu * math.sin(th)) / self.J
        ab = (-at_ring + fr - self.kb * ph - self.cb * dph) / p.base.inertia_kg_m2
        return [wm, am, w, al, dph, ab, self.wc * (u - te), dhys, dzl, dzm]

    def run(self, x: np.ndarray, u: float, duration_s: float, rtol: float = 1e-9) -> np.ndarray:
        """The state after `duration_s` with u held."""
        first = min(duration_s, 62.5e-6)
        solver = RK45(
            lambda _, y: self.slope(y, u), 0.0, x, duration_s, rtol=rtol, atol=1e-13, first_step=first
        )
        while solver.status == "running":
            solver.step()
        return np.asarray(solver.y)
