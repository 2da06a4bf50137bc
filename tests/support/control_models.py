"""The sampled loop as python-control systems, built with its algebra of transfer functions: an independent check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control
import numpy as np

from gantryctl.engineering.analysis.models.linear import FloatArray
from gantryctl.engineering.analysis.models.mechanics import BASE, LOAD, MOTOR, Mechanics
from gantryctl.engineering.analysis.models.sampled import LoopSettings, SampledLoop

PLANT_OUTPUTS = (
    "encoder_rad",
    "vel_motor_rad_s",
    "pos_load_rad",
    "vel_load_rad_s",
    "pos_base_rad",
    "torque_nm",
)
CLOSED_OUTPUTS = (
    "pos_act_rad",
    "pos_load_rad",
    "vel_load_rad_s",
    "pos_base_rad",
    "torque_act_nm",
    "vel_cmd_rad_s",
)
"""Angles and speeds of the closed loop are at the gantry; torque and speed command at the motor."""


@dataclass(frozen=True)
class ControlModels:
    """python-control systems of one loop.

    Attributes:
        plant: continuous; torque set-point to `PLANT_OUTPUTS`. plant_sampled: the same, held over a drive
        cycle.
        speed_open: cut at the speed error, position loop open, dt = drive cycle.
        command_open: cut at the speed command, dt = scan.
        closed: set-point angle and speed (rad, rad/s at the gantry) to `CLOSED_OUTPUTS`, dt = scan.
    """

    plant: Any
    plant_sampled: Any
    speed_open: Any
    command_open: Any
    closed: Any


def control_models(loop: SampledLoop) -> ControlModels:
    """Build all of them."""
    s = loop.settings
    a, b, c = loop.plant.a, loop.plant.b[:, None], _plant_rows(loop.plant, s.latency_s)
    plant = control.ss(a, b, c, np.zeros((len(c), 1)), inputs=["torque"], outputs=list(PLANT_OUTPUTS))
    held = control.sample_system(plant, s.cycle_s, method="zoh")
    encoder = control.ss(held.A, held.B, held.C[:1], 0, s.cycle_s)
    return ControlModels(
        plant=plant,
        plant_sampled=held,
        speed_open=control.series(*_speed_controller(s), encoder, _difference(s)),
        command_open=_command_open(loop),
        closed=_closed(loop),
    )


def _plant_rows(plant: Mechanics, latency_s: float) -> FloatArray:
    return np.vstack(
        [
            plant.position(MOTOR) - latency_s * plant.velocity(MOTOR),
            plant.velocity(MOTOR),
            plant.position(LOAD),
            plant.velocity(LOAD),
            plant.position(BASE),
            plant.torque,
        ]
    )


def _speed_controller(s: LoopSettings) -> list[Any]:
    """Kvp (1 + (Ts/Tvi)/(z - 1)), and the dead time of the drive."""
    pi = control.tf(
        [s.kvp_nm_s_per_rad, s.kvp_nm_s_per_rad * (s.cycle_s / s.tvi_s - 1.0)], [1.0, -1.0], s.cycle_s
    )
    systems = [control.ss(pi)]
    if s.delay_cycles:
        systems.append(control.ss(control.tf([1.0], [1.0, 0.0], s.cycle_s)))
    return systems


def _difference(s: LoopSettings) -> Any:
    """(1 - 1/z)/Ts: the speed that the drive makes of its encoder."""
    return control.ss(control.tf([1.0, -1.0], [s.cycle_s, 0.0], s.cycle_s))


def _command_open(loop: SampledLoop) -> Any:
    m, command, _ = loop.scan()
    row = loop.settings.kpp_per_s * loop.row(loop.encoder)
    return control.ss(m, command[:, None], row[None, :], 0, loop.settings.scan_s)


def _closed(loop: SampledLoop) -> Any:
    """v_cmd = i (Kpp r + Kvf r') - Kpp y, held over the scan."""
    s, ratio = loop.settings, loop.plant.ratio
    _, command, _ = loop.scan()
    feed = ratio * np.array([s.kpp_per_s, s.kvf])
    plant = loop.plant
    rows = [
        loop.encoder / ratio,
        plant.position(LOAD),
        plant.velocity(LOAD),
        plant.position(BASE),
        plant.torque,
        -s.kpp_per_s * loop.encoder,
    ]
    direct = np.zeros((len(rows), 2))
    direct[-1] = feed
    return control.ss(
        loop.closed(),
        np.outer(command, feed),
        np.vstack([loop.row(row) for row in rows]),
        direct,
        s.scan_s,
        inputs=["pos_ref", "vel_ref"],
        outputs=list(CLOSED_OUTPUTS),
    )
