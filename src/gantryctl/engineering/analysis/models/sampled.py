"""The loop as it really runs: P every scan, PI every drive cycle, delay, current loop, latency, differenced
speed.

Within a scan the drive works N cycles on one held speed command, so the loop is exactly linear from scan to
scan; its poles are exact. Open loops are frequency responses: the one at the speed command belongs to the
scan and is exact, those at the speed error and at the torque belong to the drive cycle, where the position
loop counts as its mean over a scan (images at multiples of the scan frequency are left out).

State: plant (q, q', Te), encoder evaluation of the last cycle, integral I, torque set-point of the last
cycle (S7).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray, expm
from gantryctl.engineering.analysis.models.mechanics import BASE, LOAD, MOTOR, Mechanics
from gantryctl.machine import Machine
from gantryctl.wiring.simulator import drive_params


@dataclass(frozen=True)
class LoopSettings:
    """Gains and timing of the two loops.

    Attributes:
        kvp_nm_s_per_rad, tvi_s: PI speed loop of the drive. kpp_per_s, kvf: position loop of the controller.
        cycle_s: period of the drive. cycles_per_scan: drive cycles in a scan.
        delay_cycles: from computing a torque to its effect, 0 or 1. latency_s: age of an encoder reading.
    """

    kvp_nm_s_per_rad: float
    tvi_s: float
    kpp_per_s: float
    kvf: float
    cycle_s: float
    cycles_per_scan: int
    delay_cycles: int
    latency_s: float

    @property
    def scan_s(self) -> float:
        """Period of the scan."""
        return self.cycle_s * self.cycles_per_scan


def loop_settings(machine: Machine) -> LoopSettings:
    """The loop as the machine file configures it."""
    drive = drive_params(machine)
    return LoopSettings(
        kvp_nm_s_per_rad=drive.kvp_nm_s_per_rad,
        tvi_s=drive.tvi_s,
        kpp_per_s=machine.control.kpp_per_s,
        kvf=machine.control.kvf,
        cycle_s=drive.cycle_s,
        cycles_per_scan=round(machine.control.scan_period_ms * 1e-3 / drive.cycle_s),
        delay_cycles=drive.delay_cycles,
        latency_s=drive.latency_s,
    )


class Cut(Enum):
    """Places where the loop is opened."""

    SPEED_COMMAND = "speed command"
    SPEED_ERROR = "speed error"
    TORQUE = "torque"


class Input(Enum):
    """Places where a signal is added to the closed loop, at the motor: rad/s or N m."""

    SPEED = "speed command"
    TORQUE = "torque feed-forward"


@dataclass(frozen=True)
class SampledLoop:
    """One plant under one set of gains; angles and speeds at the motor unless a name says load or base."""

    plant: Mechanics
    settings: LoopSettings

    # --- one drive cycle, one scan

    @cached_property
    def held(self) -> tuple[FloatArray, FloatArray]:
        """The plant over one drive cycle with the torque set-point held: Ad, Bd."""
        n = self.plant.size
        # One exponential of [[A, B], [0, 0]] T gives the held plant exactly, input column and all.
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = self.plant.a, self.plant.b
        step = expm(block * self.settings.cycle_s)
        return step[:n, :n], step[:n, n]

    @cached_property
    def encoder(self) -> FloatArray:
        """Output row of an encoder reading: the motor angle `latency_s` ago, rad."""
        return self.plant.position(MOTOR) - self.settings.latency_s * self.plant.velocity(MOTOR)

    def cycle(self, torque_gain: float = 1.0) -> tuple[FloatArray, FloatArray, FloatArray]:
        """One drive cycle: F, and the columns of speed command and torque feed-forward.

        Args:
            torque_gain: factor on the torque that the speed loop asks for.
        """
        s, n = self.settings, self.plant.size
        ad, bd = self.held
        # The order of a drive cycle is that of plant equations S7.
        last, integral, set_point = n, n + 1, n + 2
        size = n + 3
        speed = np.zeros(size)
        # S7.2: speed by backward difference over one cycle.
        speed[:n], speed[last] = self.encoder / s.cycle_s, -1.0 / s.cycle_s
        kvp = torque_gain * s.kvp_nm_s_per_rad
        # S7.4: un = Kvp (e + I), without the clamp.
        wanted = -kvp * speed
        wanted[integral] += kvp
        f, command, torque = np.zeros((size, size)), np.zeros(size), np.zeros(size)
        f[:n, :n] = ad
        if s.delay_cycles:
            # S7.5: the plant advances with the torque of the cycle before.
            f[:n, set_point] = bd
        else:
            f[:n] += np.outer(bd, wanted)
            command[:n], torque[:n] = bd * kvp, bd
        f[last, :n] = self.encoder
        f[integral] = -speed * s.cycle_s / s.tvi_s
        f[integral, integral] += 1.0
        f[set_point] = wanted
        command[integral], command[set_point] = s.cycle_s / s.tvi_s, kvp
        torque[set_point] = 1.0
        return f, command, torque

    def scan(self, torque_gain: float = 1.0) -> tuple[FloatArray, FloatArray, FloatArray]:
        """One scan with speed command and torque feed-forward held: M, and both columns."""
        f, command, torque = self.cycle(torque_gain)
        m = np.eye(len(f))
        held_command, held_torque = np.zeros(len(f)), np.zeros(len(f))
        for _ in range(self.settings.cycles_per_scan):
            held_command = f @ held_command + command
            held_torque = f @ held_torque + torque
            m = f @ m
        return m, held_command, held_torque

    def closed(self, torque_gain: float = 1.0, command_gain: float = 1.0) -> FloatArray:
        """One scan of the closed loop; the gains are factors at the torque and at the speed command."""
        m, command, _ = self.scan(torque_gain)
        return m - np.outer(command, command_gain * self.settings.kpp_per_s * self.row(self.encoder))

    def row(self, plant_row: FloatArray) -> FloatArray:
        """An output row of the plant, widened to the whole state."""
        return np.concatenate([plant_row, np.zeros(3)])

    # --- poles

    @cached_property
    def poles(self) -> ComplexArray:
        """Poles of the closed loop, rad/s: ln(z)/T; those that die within one scan (|z| < 1e-6) are left
        out.
        """
        return self._poles(self.closed())

    @cached_property
    def inner_poles(self) -> ComplexArray:
        """Poles with the position loop open, rad/s."""
        return self._poles(self.scan()[0])

    def _poles(self, matrix: FloatArray) -> ComplexArray:
        z = np.linalg.eigvals(matrix).astype(np.complex128)
        # Dead time and deadbeat states: their logarithm would be noise.
        z = z[np.abs(z) > 1e-6]
        return np.sort_complex(np.log(z) / self.settings.scan_s)

    def stable(self, torque_gain: float = 1.0, command_gain: float = 1.0) -> bool:
        """True when the closed loop settles; with a command gain of 0 the free angle (pole at 0) does not count."""
        z = np.linalg.eigvals(self.closed(torque_gain, command_gain))
        # With the position loop open the free angle is a pole at z = 1, to rounding.
        limit = 1.0 if command_gain else 1.0 + 1e-9
        return bool(np.max(np.abs(z)) < limit)

    # --- frequency responses

    def angle_per_torque(self, w_rad_s: FloatArray) -> ComplexArray:
        """Encoder angle per torque set-point that acts, sampled at the drive cycle, rad/(N m)."""
        return response(*self.held, self.encoder, np.exp(1j * w_rad_s * self.settings.cycle_s))

    def open_loop(self, cut: Cut, w_rad_s: FloatArray, angle: ComplexArray | None = None) -> ComplexArray:
        """L(jw) at a cut, negative feedback; at SPEED_ERROR the position loop is open.

        Args:
            cut: where the loop is opened.
            w_rad_s: frequencies.
            angle: `angle_per_torque` at these, when it is known already.
        """
        s = self.settings
        if cut is Cut.SPEED_COMMAND:
            m, command, _ = self.scan()
            output = s.kpp_per_s * self.row(self.encoder)
            return response(m, command, output, np.exp(1j * w_rad_s * s.scan_s))
        z = np.exp(1j * w_rad_s * s.cycle_s)
        pi = s.kvp_nm_s_per_rad * (1.0 + s.cycle_s / s.tvi_s / (z - 1.0))
        feedback = (1.0 - 1.0 / z) / s.cycle_s
        if cut is Cut.TORQUE:
            # The speed command is held over the scan: seen at the drive's rate it is a mean over the last
            # cycles.
            held = sum((z**-k for k in range(s.cycles_per_scan)), np.zeros_like(z)) / s.cycles_per_scan
            feedback = feedback + s.kpp_per_s * held
        plant = self.angle_per_torque(w_rad_s) if angle is None else angle
        return np.asarray(pi * z**-s.delay_cycles * plant * feedback)

    def injected(self, where: Input, w_rad_s: FloatArray) -> Mapping[str, ComplexArray]:
        """Reports of the drive in the closed loop per unit of a signal added to command or torque.

        Returns:
            pos_act_rad, vel_act_rad_s (mean over the last scan), torque_act_nm, vel_law_rad_s (output of the
            position law), vel_cmd_rad_s (law and signal), and pos_load_rad, pos_base_rad that only a
            simulator knows.
        """
        s, n = self.settings, self.plant.size
        _, command, torque = self.scan()
        z = np.exp(1j * w_rad_s * s.scan_s)
        state = states(self.closed(), command if where is Input.SPEED else torque, z)
        plant = state[:, :n]
        angle = output(plant, self.encoder)
        law = -s.kpp_per_s * angle
        return {
            "pos_act_rad": angle,
            "vel_act_rad_s": state[:, n] * (1.0 - 1.0 / z) / s.scan_s,
            "torque_act_nm": output(plant, self.plant.torque),
            "vel_law_rad_s": law,
            "vel_cmd_rad_s": law + (1.0 if where is Input.SPEED else 0.0),
            "pos_load_rad": output(plant, self.plant.position(LOAD)),
            "pos_base_rad": output(plant, self.plant.position(BASE)),
        }

    def following(self, w_rad_s: FloatArray, kvf: float | None = None) -> Mapping[str, ComplexArray]:
        """Angles per set-point angle, all at the gantry: "motor" (as measured) and "load"."""
        s, n = self.settings, self.plant.size
        feed = s.kvf if kvf is None else kvf
        z = np.exp(1j * w_rad_s * s.scan_s)
        plant = states(self.closed(), self.scan()[1], z)[:, :n]
        per_set_point = self.plant.ratio * (s.kpp_per_s + feed * 1j * w_rad_s)
        return {
            MOTOR: per_set_point * output(plant, self.encoder) / self.plant.ratio,
            LOAD: per_set_point * output(plant, self.plant.position(LOAD)),
        }

    def speed_loop(self, w_rad_s: FloatArray) -> ComplexArray:
        """Motor speed per speed command with the position loop open, at the drive's rate."""
        inner = self.open_loop(Cut.SPEED_ERROR, w_rad_s)
        return np.asarray(inner / (1.0 + inner))


def states(a: FloatArray, b: FloatArray, z: ComplexArray) -> ComplexArray:
    """(z I - A)^-1 B for every z: one row per frequency."""
    shifted = z[:, None, None] * np.eye(len(a)) - a
    column = np.broadcast_to(b[:, None], (len(z), len(b), 1))
    return np.asarray(np.linalg.solve(shifted, column)[:, :, 0])


def output(state: ComplexArray, row: FloatArray) -> ComplexArray:
    """C x for every frequency; einsum, because threads of a BLAS cost more than this small product."""
    return np.asarray(np.einsum("fs,s->f", state, row))


def response(a: FloatArray, b: FloatArray, c: FloatArray, z: ComplexArray) -> ComplexArray:
    """C (z I - A)^-1 B for every z."""
    return output(states(a, b, z), c)
