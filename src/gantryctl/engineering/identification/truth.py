"""Identified numbers beside the truth of a simulated plant. No controller reads this."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gantryctl import _core
from gantryctl.engineering.identification.fit import waves_of
from gantryctl.machine import Calibration, Machine
from gantryctl.units import rad
from gantryctl.wiring.simulator import drive_params, plant_params


class Comparison(NamedTuple):
    """One number beside the truth."""

    name: str
    identified: float
    truth: float
    unit: str

    @property
    def error_percent(self) -> float:
        """How wrong, in per cent of the truth; nan where the truth is 0."""
        return 100.0 * (self.identified / self.truth - 1.0) if self.truth else math.nan


def comparisons(machine: Machine, calibration: Calibration) -> list[Comparison]:
    """Every identified number beside that of [plant]; of the gear map the rms over the turn."""
    p, found = plant_params(machine), calibration.identified
    base = 1.0 / p.base_stiffness_nm_per_rad if p.base else 0.0
    # Of small loads: hysteresis and the steeper slopes of larger loads are in what is found.
    stiffness = 1.0 / (1.0 / p.stiffness_1_nm_per_rad + base)
    angle = rad(0.0) if p.eccentric_moment_nm == 0.0 else p.eccentric_angle_rad
    inertia = p.inertia_load_kg_m2 + p.ratio * p.ratio * p.inertia_motor_kg_m2
    # Without the part that grows with the load.
    friction = p.roller_coulomb_nm * p.roller_friction + p.ratio * p.motor_coulomb_nm * p.motor_friction
    map_found, map_true = _maps(p, calibration)
    return [
        Comparison(
            "eccentric moment, sine", found.moment_sine_nm, -p.eccentric_moment_nm * math.cos(angle), "N m"
        ),
        Comparison(
            "eccentric moment, cosine", found.moment_cosine_nm, p.eccentric_moment_nm * math.sin(angle), "N m"
        ),
        Comparison("inertia of load and motor", found.inertia_kg_m2, inertia, "kg m2"),
        Comparison("inertia at the motor", found.motor_inertia_kg_m2, p.inertia_motor_kg_m2, "kg m2"),
        Comparison("stiffness, small loads, base included", found.stiffness_nm_per_rad, stiffness, "N m/rad"),
        Comparison(
            "wind-up per acceleration",
            found.windup_per_acc_s2,
            p.inertia_load_kg_m2 / stiffness,
            "s2",
        ),
        Comparison("Coulomb friction, unloaded", found.friction_nm, friction, "N m"),
        Comparison("friction per load", found.friction_load_ratio, p.motor_load_ratio * p.motor_friction, ""),
        Comparison("dead time", found.dead_time_s, _dead_time_s(machine), "s"),
        Comparison("gear map, rms", _rms_deg(map_found), _rms_deg(map_true), "deg"),
        Comparison("gear map, rms of its error", _rms_deg(map_found - map_true), 0.0, "deg"),
    ]


def _dead_time_s(machine: Machine) -> float:
    """From the scan that computes a command to the torque that answers it, as the position shows."""
    drive, current = drive_params(machine), plant_params(machine).current_bandwidth_rad_s
    # On a bus the command acts at the next SYNC. The drive takes it within half a cycle on average, computes for a
    # cycle, the current follows, and the reading that shows it is old.
    bus_s = machine.control.scan_period_ms * 1e-3 if machine.on_bus else 0.0
    own_s = (0.5 + drive.delay_cycles) * drive.cycle_s + (1.0 / current if current else 0.0)
    return bus_s + own_s + drive.latency_s


def _maps(p: _core.PlantParams, calibration: Calibration) -> tuple[np.ndarray, np.ndarray]:
    """Gear map as identified and as it is, over the turn, each without its mean, rad."""
    at = np.linspace(-math.pi, math.pi, 7201)
    gear = np.array(calibration.maps.gear_rad[1:])
    found = waves_of(at, range(1, len(gear) // 2 + 1)) @ gear
    for cycles, sine, cosine in calibration.maps.fast:
        found = found + waves_of(at, [cycles]) @ np.array([sine, cosine])
    true = -np.array(
        [_core.ring_error(p, x)[0] + _core.motor_error(p, p.ratio * x)[0] for x in at]
        if p.gear_error
        else 0.0 * at
    )
    return found - found.mean(), true - true.mean()


def _rms_deg(values_rad: np.ndarray) -> float:
    return math.degrees(float(np.sqrt(np.mean(values_rad**2))))
