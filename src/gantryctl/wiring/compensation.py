"""[control.compensation] and the calibration file to the laws of the core. Nothing of [plant] is read here."""

from __future__ import annotations

import math
from typing import Final

from gantryctl import _core
from gantryctl.errors import ConfigError
from gantryctl.machine import Calibration, Machine, check_belongs
from gantryctl.program.settings import CompensationSettings
from gantryctl.units import deg, rad

_MS: Final = 1e-3
_US: Final = 1e-6


def check_calibration(machine: Machine, encoder_serial: str | None = None) -> Calibration:
    """The calibration of this machine.

    Raises:
        ConfigError: there is none, or it was measured on another machine.
    """
    calibration = machine.calibration
    if calibration is None:
        named = machine.control.compensation.calibration
        raise ConfigError(
            [
                f"{machine.name}: a compensation needs identified values, but {named or 'no calibration file'} "
                "does not exist beside the machine file: run `gantryctl identify` first"
            ]
        )
    check_belongs(calibration, machine, encoder_serial)
    return calibration


def compensation(machine: Machine) -> _core.Compensation | None:
    """The compensations that are on, at the beginning of their life; None where all are off, and on the ideal
    drive, which has nothing to compensate.

    Raises:
        ConfigError: one that is on needs a calibration, and there is none for this machine.
    """
    config = machine.control.compensation
    if not config.any_active or machine.drive.kind == "ideal":
        return None
    switches = {
        "torque_eccentric": config.torque.eccentric,
        "torque_acceleration": config.torque.acceleration,
        "gear_map": config.gear_map.active,
        "windup": config.windup.active,
        "reversal": config.windup.reversal,
        "load_encoder": config.load_encoder.active,
        "scale_map": config.load_encoder.own_errors,
        "damping": config.damping.active,
    }
    numbers = _numbers(machine)
    if not config.needs_calibration:
        return _core.Compensation(switches, numbers)
    calibration = check_calibration(machine)
    maps = calibration.maps
    return _core.Compensation(
        switches,
        numbers | _identified(calibration),
        list(maps.gear_rad),
        list(maps.reversal_rad),
        list(maps.scale_rad),
        list(maps.fast),
    )


def lead_deg(machine: Machine, angle_deg: float) -> float:
    """How far the motor leads a load at rest at this angle, by the maps that are on, deg at the gantry."""
    laws = compensation(machine)
    return 0.0 if laws is None else deg(laws.lead(rad(angle_deg)))


def compensation_settings(machine: Machine) -> CompensationSettings | None:
    """The same for the PLC program, with its watch over the second encoder."""
    laws = compensation(machine)
    if laws is None:
        return None
    encoder = machine.control.compensation.load_encoder
    return CompensationSettings(
        laws=laws,
        load_encoder=encoder.active,
        disagreement_rad=rad(encoder.disagreement_deg),
        disagreement_time_s=encoder.disagreement_time_ms * _MS,
    )


def _numbers(machine: Machine) -> dict[str, float]:
    """What the machine file says."""
    config = machine.control.compensation
    period_s = machine.control.scan_period_ms * _MS
    damping = config.damping
    return {
        "period_s": period_s,
        "torque_limit_nm": config.torque.limit_nm,
        "reversal_length_rad": rad(config.windup.reversal_length_deg),
        "fade_rad_s": 2.0 * math.pi * config.gear_map.fade_hz,
        "pos_limit_rad": rad(config.gear_map.limit_deg),
        "encoder_gain_per_s": config.load_encoder.integral_per_s,
        "encoder_dead_band_rad": rad(config.load_encoder.dead_band_deg),
        "encoder_limit_rad": rad(config.load_encoder.limit_deg),
        "damping_gain": damping.gain,
        "damping_filter": -math.expm1(-period_s / (damping.filter_ms * _MS)),
        "damping_slow": -math.expm1(-period_s / damping.slow_s),
        "latency_s": config.latency_us * _US,
    }


def _identified(calibration: Calibration) -> dict[str, float]:
    """What was measured."""
    found = calibration.identified
    return {
        "moment_sine_nm": found.moment_sine_nm,
        "moment_cosine_nm": found.moment_cosine_nm,
        "inertia_kg_m2": found.inertia_kg_m2,
        "compliance_rad_per_nm": 1.0 / found.stiffness_nm_per_rad,
        "windup_per_acc_s2": found.windup_per_acc_s2,
        "swing_rad_s": 2.0 * math.pi * found.swing_hz,
    }
