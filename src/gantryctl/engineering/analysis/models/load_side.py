"""The whole loop of a machine whose compensations feed back: the loop on the motor, and beside it the slow integral of
the load-side error and the damping of the swing (core/control/compensated_law.hpp).

Maps, feed-forward torque and dead time act on the set-point and change no margin. The moment observer is left out: what
it learns is used four swings later and only while the axis turns. The dead band of the integral is left out too: within
it nothing is fed back. Deviations from a set-point at rest, so every map is a constant.

State of a scan: that of `sampled`, ring reading of the last scan, filtered ring speed, resting twist, correction of the
integral.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray
from gantryctl.engineering.analysis.models.mechanics import BASE, LOAD
from gantryctl.engineering.analysis.models.modes import Oscillation, least_damped
from gantryctl.engineering.analysis.models.sampled import SampledLoop, response, states
from gantryctl.machine import Machine
from gantryctl.wiring.compensation import compensation

# Golden section: 40 steps leave 0.618^40 = 4e-9 of the decades that are searched.
_GOLDEN_STEPS: Final = 40
_GOLDEN: Final = (math.sqrt(5.0) - 1.0) / 2.0
# Decades of the scaling between the two encoders in which the structured singular value is searched.
_SCALINGS: Final = 4.0


class LoadSideLaw(NamedTuple):
    """What of the compensations is a feedback.

    Attributes:
        integral_per_s: of the load-side error, 0 without. damping_gain: part of the swing that the motor yields to, 0
            without. swing_rad_s: first mode with the motor held, as calibrated.
        filter_share, slow_share: 1 - exp(-T/tau) of the ring speed and of the resting twist.
    """

    integral_per_s: float
    damping_gain: float
    swing_rad_s: float
    filter_share: float
    slow_share: float


def load_side_law(machine: Machine) -> LoadSideLaw | None:
    """The law as the machine file and its calibration set it; None where nothing of it is on, or not identified yet.

    Raises:
        ConfigError: the calibration is of another machine.
    """
    config = machine.control.compensation
    unknown = config.needs_calibration and machine.calibration is None
    if unknown or not (config.load_encoder.active or config.damping.active):
        return None
    laws = compensation(machine)
    # An ideal drive has no laws.
    if laws is None:
        return None
    p = laws.parameters
    return LoadSideLaw(
        integral_per_s=p["encoder_gain_per_s"] * p["load_encoder"],
        damping_gain=p["damping_gain"] * p["damping"],
        swing_rad_s=p["swing_rad_s"],
        filter_share=p["damping_filter"],
        slow_share=p["damping_slow"],
    )


@dataclass(frozen=True)
class WholeLoop:
    """Motor loop and load-side law on one plant; both encoders are read at the same instant, once a scan."""

    loop: SampledLoop
    law: LoadSideLaw

    # --- the controller: two readings at the gantry (motor, ring) to a speed command at the motor

    @cached_property
    def controller(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """A, B, C, D of one scan; states ring before, ring speed, resting twist, correction; readings motor, ring."""
        law, s = self.law, self.loop.settings
        a, b = np.zeros((4, 4)), np.zeros((4, 2))
        b[0, 1] = 1.0
        a[1, 0], a[1, 1], b[1, 1] = (
            -law.filter_share / s.scan_s,
            1.0 - law.filter_share,
            law.filter_share / s.scan_s,
        )
        a[2, 2], b[2] = 1.0 - law.slow_share, (law.slow_share, -law.slow_share)
        a[3, 3], b[3, 1] = 1.0, -law.integral_per_s * s.scan_s
        # The command takes what this scan has made of ring speed, resting twist and correction.
        g, square = law.damping_gain, law.swing_rad_s**2
        now = np.array([0.0, -g * s.kpp_per_s, g * square, s.kpp_per_s])
        direct = np.array([-s.kpp_per_s - g * square, g * square])
        ratio = self.loop.plant.ratio
        return a, b, ratio * (now @ a), ratio * (now @ b + direct)

    @cached_property
    def readings(self) -> FloatArray:
        """Rows of both readings over the state of the motor loop: motor angle and ring angle, rad at the gantry."""
        plant, late = self.loop.plant, self.loop.settings.latency_s
        ring = plant.position(LOAD) - plant.position(BASE)
        moving = plant.velocity(LOAD) - plant.velocity(BASE)
        return np.array([self.loop.row(self.loop.encoder / plant.ratio), self.loop.row(ring - late * moving)])

    def closed(
        self, command_gain: float = 1.0, reading_gains: tuple[float, float] = (1.0, 1.0)
    ) -> FloatArray:
        """One scan of the whole loop; factors at the speed command and at both readings."""
        m, command, _ = self.loop.scan()
        a, b, c, d = self.controller
        seen = np.diag(reading_gains) @ self.readings
        return np.block(
            [
                [m + command_gain * np.outer(command, d @ seen), command_gain * np.outer(command, c)],
                [b @ seen, a],
            ]
        )

    @cached_property
    def poles(self) -> ComplexArray:
        """Poles of the whole loop, rad/s: ln(z)/T; without what is gone within a scan."""
        z = np.linalg.eigvals(self.closed()).astype(np.complex128)
        z = z[np.abs(z) > 1e-6]
        # An integral that is off keeps what it has: a pole at 1 that belongs to no motion.
        if self.law.integral_per_s == 0.0:
            z = np.delete(z, np.argmin(np.abs(z - 1.0)))
        return np.sort_complex(np.log(z) / self.loop.settings.scan_s)

    @property
    def stable(self) -> bool:
        """Every pole in the left half plane."""
        return bool(self.poles.real.max() < 0.0)

    # --- frequency responses

    def paths(self, w_rad_s: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Speed command per motor reading and per ring reading at the scan's rate, 1/s times the ratio."""
        a, b, c, d = self.controller
        z = np.exp(1j * w_rad_s * self.loop.settings.scan_s)
        motor, ring = (response(a, b[:, k], c, z) + d[k] for k in range(2))
        return motor, ring

    def seen(self, w_rad_s: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Both readings per speed command with the drive's loop closed, at the scan's rate."""
        m, command, _ = self.loop.scan()
        found = states(m, command, np.exp(1j * w_rad_s * self.loop.settings.scan_s))
        motor, ring = (np.asarray(found @ row) for row in self.readings)
        return motor, ring

    def at_command(self, w_rad_s: FloatArray) -> ComplexArray:
        """L(jw) cut at the speed command, negative feedback."""
        (motor, ring), (to_motor, to_ring) = self.paths(w_rad_s), self.seen(w_rad_s)
        return np.asarray(-(motor * to_motor + ring * to_ring))

    def at_torque(self, w_rad_s: FloatArray) -> ComplexArray:
        """L(jw) cut at the torque; the law counts as its mean over a scan, as in `sampled`."""
        s, loop = self.loop.settings, self.loop
        z = np.exp(1j * w_rad_s * s.cycle_s)
        pi = s.kvp_nm_s_per_rad * (1.0 + s.cycle_s / s.tvi_s / (z - 1.0))
        held = sum((z**-k for k in range(s.cycles_per_scan)), np.zeros_like(z)) / s.cycles_per_scan
        state = states(*loop.held, z)
        n = loop.plant.size
        motor, ring = (np.asarray(state @ row[:n]) for row in self.readings)
        to_motor, to_ring = self.paths(w_rad_s)
        speed = (1.0 - 1.0 / z) / s.cycle_s * motor * loop.plant.ratio
        return np.asarray(pi * z**-s.delay_cycles * (speed - held * (to_motor * motor + to_ring * ring)))

    def at_encoders(self, w_rad_s: FloatArray) -> ComplexArray:
        """L(jw) cut at both readings: one 2 x 2 matrix per frequency, negative feedback."""
        (motor, ring), (to_motor, to_ring) = self.paths(w_rad_s), self.seen(w_rad_s)
        seen, told = np.stack([to_motor, to_ring], axis=-1), np.stack([motor, ring], axis=-1)
        return np.asarray(-seen[:, :, None] * told[:, None, :])


class DiskMargin(NamedTuple):
    """Balanced disk margin (Seiler, Packard, Gahinet, IEEE Control Systems 40(5), 2020): the loop stays stable while
    each cut is multiplied by (1 + a d/2)/(1 - a d/2), d any stable system with |d| < 1, one of its own at each cut.

    Attributes:
        alpha: a, at most 2; 0 at the limit of stability. w_rad_s: where it is smallest.
    """

    alpha: float
    w_rad_s: float

    @property
    def gain_up(self) -> float:
        """Factor that every gain may rise by."""
        return (2.0 + self.alpha) / (2.0 - self.alpha) if self.alpha < 2.0 else math.inf

    @property
    def gain_down(self) -> float:
        """Factor that every gain may fall to."""
        return (2.0 - self.alpha) / (2.0 + self.alpha)

    @property
    def phase_deg(self) -> float:
        """Phase that every cut may lose."""
        return math.degrees(2.0 * math.atan(self.alpha / 2.0))


def disk_margin(loop: ComplexArray, w_rad_s: FloatArray) -> DiskMargin:
    """Of one loop: alpha = 1 / max |(1 - L) / (2 (1 + L))|."""
    return _disk(np.abs((1.0 - loop) / (2.0 * (1.0 + loop))), w_rad_s)


def disk_margin_of_both(loop: ComplexArray, w_rad_s: FloatArray) -> DiskMargin:
    """Of two cuts at once, each with a factor of its own: shape (n, 2, 2); alpha = 1 / max mu((S - T)/2).

    For two blocks mu is the smallest largest singular value of diag(d, 1) M diag(1/d, 1) over d > 0, exactly (Packard,
    Doyle, Automatica 29(1), 1993).
    """
    one = np.eye(2)
    m: ComplexArray = np.asarray(0.5 * np.linalg.solve(one + loop, one - loop), dtype=np.complex128)
    return _disk(_mu(m), w_rad_s)


def _disk(size: FloatArray, w_rad_s: FloatArray) -> DiskMargin:
    worst = int(np.argmax(size))
    return DiskMargin(min(2.0, 1.0 / float(size[worst])), float(w_rad_s[worst]))


def _mu(m: ComplexArray) -> FloatArray:
    """Structured singular value of 2 x 2 matrices for two complex scalar blocks; convex in the logarithm of d."""
    # At d^2 = |m12/m21| both off-diagonal parts are as large; from there the best lies within decades.
    off = np.abs(m[:, 0, 1]), np.abs(m[:, 1, 0])
    middle = 0.5 * np.log((off[1] + 1e-300) / (off[0] + 1e-300))
    low, high = middle - _SCALINGS, middle + _SCALINGS
    for _ in range(_GOLDEN_STEPS):
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        better = _scaled(m, left) < _scaled(m, right)
        low, high = np.where(better, low, left), np.where(better, right, high)
    return _scaled(m, 0.5 * (low + high))


def _scaled(m: ComplexArray, log_d: FloatArray) -> FloatArray:
    """Largest singular value of diag(d, 1) M diag(1/d, 1), in closed form."""
    d = np.exp(log_d)
    squares = np.abs(np.stack([m[:, 0, 0], d * m[:, 0, 1], m[:, 1, 0] / d, m[:, 1, 1]])) ** 2
    total = squares.sum(axis=0)
    determinant = np.abs(m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]) ** 2
    root = np.sqrt(np.maximum(total**2 - 4.0 * determinant, 0.0))
    return np.asarray(np.sqrt(0.5 * (total + root)))


class LoadSideFigures(NamedTuple):
    """The whole loop on one plant.

    Attributes:
        stable: every pole in the left half plane.
        worst: swinging pole with the smallest damping ratio, negative = unstable.
        command, torque, encoders: disk margin at the speed command, at the torque, at both encoders at once.
    """

    stable: bool
    worst: Oscillation
    command: DiskMargin
    torque: DiskMargin
    encoders: DiskMargin

    @property
    def smallest(self) -> DiskMargin:
        """The smallest of the three."""
        return min((self.command, self.torque, self.encoders), key=lambda margin: margin.alpha)


def load_side_figures(whole: WholeLoop, w_rad_s: FloatArray) -> LoadSideFigures:
    """The figures on a grid up to half of the drive's rate; what belongs to the scan, up to half of the scan's."""
    scanned = w_rad_s[w_rad_s < 0.999 * math.pi / whole.loop.settings.scan_s]
    return LoadSideFigures(
        stable=whole.stable,
        worst=least_damped(whole.poles),
        command=disk_margin(whole.at_command(scanned), scanned),
        torque=disk_margin(whole.at_torque(w_rad_s), w_rad_s),
        encoders=disk_margin_of_both(whole.at_encoders(scanned), scanned),
    )
