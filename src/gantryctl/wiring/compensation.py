"""[control.compensation] and the calibration file to the laws of the core; reads nothing of [plant]."""

from __future__ import annotations

import math
from operator import attrgetter
from typing import Final

from gantryctl import _core
from gantryctl.errors import ConfigError
from gantryctl.machine import Calibration, Machine, Number, check_belongs
from gantryctl.program.settings import CalibrationWatchSettings, CompensationSettings
from gantryctl.units import deg, rad

# A simulation that feeds its own parameters to the controller removes the load error without merit: every number comes
# from the calibration file, measured by `gantryctl identify` (decision 0010).
_MS: Final = 1e-3
_US: Final = 1e-6
# After a stop the load swings on by up to 0.53 deg/s (program/power/sequence.py); a step of the encoder is no swing.
_SWING_DEG_S: Final = 1.0
# What a balance of torques leaves out (waves of the gear, a load that swings), in parts of the friction: 4.3 kN m on
# the reference gantry, where moves from -110 to 110 deg leave 4.2 kN m r.m.s.
_OBSERVED_SHARE: Final = 0.35
# The band in which a load that has passed the gap shows: a quarter of its swing to four times that.
_FASTER: Final = 4.0
# Periods of the first mode: what is in use follows within so many, so it excites none; within as many the swing behind
# a hard stop is over.
_SWINGS: Final = 4.0
# A load that comes to rest is held by anything between nothing and all of the friction behind the mesh; what is left of
# a flank that was planned wrong the load-side loop takes back, so with one the middle is planned.
_RESTING_SHARE: Final = 0.5
# Grease warms and seals run in.
_FRICTION_SPREAD: Final = 0.5
# Of the lowest setting; below it breakaway and pre-sliding are more than friction.
_OBSERVED_SPEED: Final = 0.1


def check_calibration(machine: Machine, encoder_serial: str | None = None) -> Calibration:
    """Calibration of this machine.

    Raises:
        ConfigError: it is missing, or was measured on another machine.
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
    """Compensation laws that are on, in their initial state; None if all are off or the drive is ideal.

    Raises:
        ConfigError: a law that is on needs a calibration, and this machine has none.
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
        "moment_observer": config.moment_observer.active,
        "backlash_observer": config.backlash_observer.active,
    }
    numbers = _numbers(machine)
    # A machine file that needs a calibration loads without it, or it could never be identified; here it is refused.
    if not config.needs_calibration:
        return _core.Compensation(switches, numbers)
    calibration = check_calibration(machine)
    maps = calibration.maps
    return _core.Compensation(
        switches,
        numbers | _identified(machine, calibration),
        list(maps.gear_rad),
        list(maps.reversal_rad),
        list(maps.scale_rad),
        list(maps.fast),
    )


def lead_deg(machine: Machine, angle_deg: float) -> float:
    """Lead of the motor over a load at rest at this angle, by the maps that are on, deg at the gantry."""
    laws = compensation(machine)
    return 0.0 if laws is None else deg(laws.lead(rad(angle_deg)))


def compensation_settings(machine: Machine) -> CompensationSettings | None:
    """Compensation settings of the PLC program, with the supervision of the second encoder."""
    laws = compensation(machine)
    if laws is None:
        return None
    encoder, observer = (
        machine.control.compensation.load_encoder,
        machine.control.compensation.moment_observer,
    )
    return CompensationSettings(
        laws=laws,
        load_encoder=encoder.active,
        disagreement_rad=rad(encoder.disagreement_deg),
        disagreement_time_s=encoder.disagreement_time_ms * _MS,
        moment_limit_nm=observer.limit_nm if observer.active else math.inf,
        watch=_watch(machine),
    )


def _watch(machine: Machine) -> CalibrationWatchSettings | None:
    if not machine.control.compensation.needs_calibration:
        return None
    from gantryctl.wiring.calibration_watch import (
        calibration_watch,
    )  # a machine without a calibration loads none

    return calibration_watch(machine, check_calibration(machine))


def flank_torque_nm(machine: Machine) -> float:
    """Torque in the mesh below which it is about to change its flank, N m at the axis."""
    return _FLANK_SHARE * machine.motor.torque_rated_nm * machine.axis.ratio


def _numbers(machine: Machine) -> dict[str, float]:
    """Values from the machine file."""
    config, axis = machine.control.compensation, machine.virtual_axis
    period_s = machine.control.scan_period_ms * _MS
    damping = config.damping
    return {
        "period_s": period_s,
        "torque_limit_nm": config.torque.limit_nm,
        "flank_nm": _CROSSING * flank_torque_nm(machine),
        # Of moves, with a hundredth to spare for the rounding of a difference.
        "jerk_max_rad_s3": rad(1.01 * max(axis.jerk_deg_s3, axis.end_jerk_deg_s3)),
        "reversal_length_rad": rad(config.windup.reversal_length_deg),
        "fade_rad_s": 2.0 * math.pi * config.gear_map.fade_hz,
        "pos_limit_rad": rad(config.gear_map.limit_deg),
        "encoder_gain_per_s": config.load_encoder.integral_per_s,
        "encoder_dead_band_rad": rad(config.load_encoder.dead_band_deg),
        "encoder_limit_rad": rad(config.load_encoder.limit_deg),
        "swing_speed_max_rad_s": rad(_SWING_DEG_S),
        "damping_gain": damping.gain,
        # First-order filters as exact discrete gains, 1 - exp(-T/tau).
        "damping_filter": -math.expm1(-period_s / (damping.filter_ms * _MS)),
        "damping_slow": -math.expm1(-period_s / damping.slow_s),
        "latency_s": config.latency_us * _US,
        "moment_limit_nm": config.moment_observer.limit_nm,
        "observer_speed_rad_s": rad(_OBSERVED_SPEED * machine.speed.setting_min_deg_s),
        "observer_memory": math.exp(-period_s / config.moment_observer.memory_s),
        "backlash_memory": math.exp(-period_s / config.backlash_observer.memory_s),
        # Without a limit no backlash is followed; the step of the bank is never 0.
        "backlash_step_rad": rad(config.backlash_observer.limit_deg) / (_core.BACKLASH_MODELS - 1) or 1.0,
    }


# What each law lives on, in the words of the calibration.
_LIVES_ON: Final[dict[str, tuple[Number, ...]]] = {
    "torque.eccentric": ("moment_sine_nm", "moment_cosine_nm"),
    "torque.acceleration": ("inertia_kg_m2",),
    "windup.active": ("moment_sine_nm", "moment_cosine_nm", "stiffness_nm_per_rad", "windup_per_acc_s2"),
    "damping.active": ("swing_hz", "windup_per_acc_s2"),
    "backlash_observer.active": ("windup_per_acc_s2",),
    "moment_observer.active": (
        "moment_sine_nm",
        "moment_cosine_nm",
        "inertia_kg_m2",
        "friction_nm",
        "friction_load_ratio",
        "friction_nm_s_per_rad",
        "stiffness_nm_per_rad",
        "swing_hz",
    ),
}
# Nearer to 0 than this part of the rated torque the mesh is about to change its flank: 1 kN m on the reference gantry.
_FLANK_SHARE: Final = 0.0034
# The motor crosses the gap while the planned torque goes through twice that to either side. Within once that the
# speed command rose by 0.12 deg/s in a scan of 4 ms, and the motor gave 190 N m; so it is 0.025 deg/s and 62 N m, and
# the load swings no more.
_CROSSING: Final = 2.0


def _identified(machine: Machine, calibration: Calibration) -> dict[str, float]:
    """Values from the identification; 0 for what no law that is on asks for.

    Raises:
        ConfigError: a law that is on lives on a number that could not be identified.
    """
    config, found = machine.control.compensation, calibration.identified
    lines = [
        f"{machine.name}: [control.compensation] {law} lives on {name}, which could not be identified: "
        f"{calibration.unknown[name].words}; switch {law} off"
        for law, names in _LIVES_ON.items()
        if attrgetter(law)(config)
        for name in names
        if name in calibration.unknown
    ]
    stiffness, swing_hz, ratio = found.stiffness_nm_per_rad, found.swing_hz, machine.axis.ratio
    inertia, motor = found.inertia_kg_m2 or 0.0, found.motor_inertia_kg_m2 or machine.motor.inertia_kg_m2
    friction, period_s = found.friction_nm or 0.0, machine.control.scan_period_ms * _MS
    swing_rad_s = 2.0 * math.pi * (swing_hz or 0.0)
    observes = config.backlash_observer.active
    load_kg_m2, behind_nm = max(0.0, inertia - ratio * ratio * motor), calibration.friction_behind_mesh_nm
    if observes and not (friction > 0.0 and behind_nm > 0.0 and load_kg_m2 > 0.0):
        lines.append(
            f"{machine.name}: [control.compensation] backlash_observer.active lives on friction and a load behind the "
            f"gears, all above 0, but the calibration has {friction:g} N m of friction, {behind_nm:g} N m of it behind "
            f"the mesh, and a load of {load_kg_m2:g} kg m2: identify again, or switch backlash_observer.active off"
        )
    if lines:
        raise ConfigError(lines)
    return {
        "moment_sine_nm": found.moment_sine_nm or 0.0,
        "moment_cosine_nm": found.moment_cosine_nm or 0.0,
        "inertia_kg_m2": inertia,
        "inertia_load_kg_m2": load_kg_m2,
        "friction_load_nm": behind_nm if observes else found.friction_load_nm or 0.0,
        "flank_friction_share": _RESTING_SHARE if observes and config.load_encoder.active else 1.0,
        "backlash_rad": found.backlash_rad or 0.0,
        "compliance_rad_per_nm": 1.0 / stiffness if stiffness else 0.0,
        "lean_rad_per_nm": calibration.maps.lean_rad_per_nm or 0.0,
        "windup_per_acc_s2": found.windup_per_acc_s2 or 0.0,
        "swing_rad_s": swing_rad_s,
        "friction_nm": friction,
        "friction_load_ratio": found.friction_load_ratio or 0.0,
        "friction_nm_s_per_rad": found.friction_nm_s_per_rad or 0.0,
        "friction_spread_nm": _FRICTION_SPREAD * friction,
        "observer_rate": -math.expm1(-period_s * (swing_hz or 0.0) / _SWINGS),
        "observer_calm_s": _SWINGS / swing_hz if swing_hz else 0.0,
        # The load swings about what is planned: torques within half a swing say the same once.
        "observer_weight": 2.0 * period_s * (swing_hz or 0.0) / (_OBSERVED_SHARE * friction) ** 2
        if friction > 0.0
        else 0.0,
        "backlash_held_rad": calibration.backlash_held_rad,
        "backlash_fast": -math.expm1(-period_s * swing_rad_s * _FASTER),
        "backlash_slow": -math.expm1(-period_s * swing_rad_s / _FASTER),
    }
