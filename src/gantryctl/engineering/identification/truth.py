"""Identified numbers beside the truth of a simulated plant. No controller reads this."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from gantryctl import _core
from gantryctl.engineering.identification.experiment import experiment_of
from gantryctl.engineering.identification.waves import waves_of
from gantryctl.machine import Calibration, Machine, Number
from gantryctl.units import rad
from gantryctl.wiring.simulator import drive_params, plant_params

LABELS: Final[dict[Number, tuple[str, str]]] = {
    "moment_sine_nm": ("eccentric moment, sine", "N m"),
    "moment_cosine_nm": ("eccentric moment, cosine", "N m"),
    "inertia_kg_m2": ("inertia of load and motor", "kg m2"),
    "motor_inertia_kg_m2": ("inertia at the motor", "kg m2"),
    "stiffness_nm_per_rad": ("stiffness, small loads, base included", "N m/rad"),
    "windup_per_acc_s2": ("wind-up per acceleration", "s2"),
    "swing_hz": ("first mode, motor held", "Hz"),
    "friction_nm": ("Coulomb friction, unloaded", "N m"),
    "friction_load_ratio": ("friction per load", ""),
    "friction_nm_s_per_rad": ("friction per speed", "N m s/rad"),
    "dead_time_s": ("dead time", "s"),
    "backlash_rad": ("backlash", "rad"),
    "friction_load_nm": ("Coulomb friction behind the mesh", "N m"),
}


class Comparison(NamedTuple):
    """One number beside the truth.

    Attributes:
        identified: None where it could not be identified. half_width: half of its 95 % interval; None without one.
    """

    name: str
    identified: float | None
    truth: float
    unit: str
    half_width: float | None = None

    @property
    def error_percent(self) -> float:
        """How wrong, in per cent of the truth; nan where the truth is 0 or nothing was found."""
        if self.identified is None or not self.truth:
            return math.nan
        return 100.0 * (self.identified / self.truth - 1.0)


def comparisons(machine: Machine, calibration: Calibration) -> list[Comparison]:
    """Every identified number beside that of [plant]; of the gear map the rms over the travel."""
    p = plant_params(machine)
    base = 1.0 / p.base_stiffness_nm_per_rad if p.base else 0.0
    # Of small loads: hysteresis and the steeper slopes of larger loads are in what is found.
    stiffness = 1.0 / (1.0 / p.stiffness_1_nm_per_rad + base)
    angle = rad(0.0) if p.eccentric_moment_nm == 0.0 else p.eccentric_angle_rad
    inertia = p.inertia_load_kg_m2 + p.ratio * p.ratio * p.inertia_motor_kg_m2
    # Without the part that grows with the load.
    friction = p.roller_coulomb_nm * p.roller_friction + p.ratio * p.motor_coulomb_nm * p.motor_friction
    truth: dict[Number, float] = {
        "moment_sine_nm": -p.eccentric_moment_nm * math.cos(angle),
        "moment_cosine_nm": p.eccentric_moment_nm * math.sin(angle),
        "inertia_kg_m2": inertia,
        "motor_inertia_kg_m2": p.inertia_motor_kg_m2,
        "stiffness_nm_per_rad": stiffness,
        "windup_per_acc_s2": p.inertia_load_kg_m2 / stiffness,
        "friction_nm": friction,
        "friction_load_ratio": p.motor_load_ratio * p.motor_friction,
        "dead_time_s": _dead_time_s(machine),
        "backlash_rad": 2.0 * p.half_backlash_rad * p.backlash,
        "friction_load_nm": p.roller_coulomb_nm * p.roller_friction,
    }
    map_found, map_true = _maps(machine, p, calibration)
    return [
        *(
            Comparison(
                LABELS[name][0],
                getattr(calibration.identified, name),
                true,
                LABELS[name][1],
                calibration.half_width.get(name),
            )
            for name, true in truth.items()
        ),
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


def _maps(machine: Machine, p: _core.PlantParams, calibration: Calibration) -> tuple[np.ndarray, np.ndarray]:
    """Gear map as identified and as it is, over the travel or a turn of it, each without its mean, rad."""
    experiment = experiment_of(machine)
    at = np.linspace(rad(experiment.low_deg), rad(experiment.high_deg), 7201)
    gear = np.array(calibration.maps.gear_rad[1:])
    found = waves_of(at, range(1, len(gear) // 2 + 1)) @ gear
    for cycles, sine, cosine in calibration.maps.fast:
        found = found + waves_of(at, [cycles]) @ np.array([sine, cosine])
    true = np.zeros_like(at)
    if p.gear_error:
        true -= [_core.ring_error(p, x)[0] + _core.motor_error(p, p.ratio * x)[0] for x in at]
    if p.tooth_pitch:
        pitch = [_core.pitch_error(p, x, p.ratio * x) for x in at]
        true -= [ring + pinion for ring, _, _, pinion, _, _ in pitch]
    return found - found.mean(), true - true.mean()


def _rms_deg(values_rad: np.ndarray) -> float:
    return math.degrees(float(np.sqrt(np.mean(values_rad**2))))
