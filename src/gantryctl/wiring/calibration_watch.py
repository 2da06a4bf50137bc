"""The calibration file to what is watched of it: numbers, and bounds from their intervals; nothing of [plant]."""

from __future__ import annotations

import hashlib
import math
from typing import Final

from gantryctl.machine import Calibration, Machine, Number, calibration_toml
from gantryctl.program.settings import CalibrationWatchSettings
from gantryctl.units import rad

# A machine as it was identified is beyond twice its 95 % interval once in ten thousand.
_INTERVALS: Final = 2.0
# What a balance of torques leaves out, in parts of the friction (as `wiring.compensation` has it).
_RESIDUAL_SHARE: Final = 0.35
# Of the lowest setting; below it breakaway and pre-sliding are more than friction.
_SPEED_SHARE: Final = 0.1
# Nearer to 0 than half of all friction the flank is not known.
_FLANK_KNOWN_SHARE: Final = 0.5
_NEEDED: Final[tuple[Number, ...]] = (
    "moment_sine_nm", "moment_cosine_nm", "inertia_kg_m2", "friction_nm", "friction_load_ratio",
    "friction_nm_s_per_rad",
)  # fmt: skip


def calibration_identity(calibration: Calibration) -> str:
    """Hash of a calibration file; 16 hexadecimal digits."""
    return hashlib.sha256(calibration_toml(calibration).encode()).hexdigest()[:16]


def calibration_watch(machine: Machine, calibration: Calibration) -> CalibrationWatchSettings | None:
    """What is watched of a calibration; None where nothing is."""
    config, found = machine.control.compensation.calibration_watch, calibration.identified
    if not config.active or _missing(calibration, _NEEDED):
        return None
    half, ratio = calibration.half_width, machine.axis.ratio
    sine, cosine = found.moment_sine_nm or 0.0, found.moment_cosine_nm or 0.0
    inertia, friction = found.inertia_kg_m2 or 0.0, found.friction_nm or 0.0
    moment, per_load, viscous = (
        math.hypot(sine, cosine),
        half["friction_load_ratio"],
        found.friction_nm_s_per_rad,
    )
    fastest = rad(machine.speed.setting_max_deg_s)
    interval_nm = math.hypot(half["moment_sine_nm"], half["moment_cosine_nm"]) + per_load * moment
    # Over a turn the size of a sine is 2/pi of its largest on average.
    friction_interval = (
        half["friction_nm"] + half["friction_nm_s_per_rad"] * fastest + per_load * moment * 2.0 / math.pi
    )
    windup = found.windup_per_acc_s2 or 0.0
    motor = found.motor_inertia_kg_m2 or machine.motor.inertia_kg_m2
    flank = max(0.0, _FLANK_KNOWN_SHARE * friction)
    return CalibrationWatchSettings(
        identity=calibration_identity(calibration),
        moment_sine_nm=sine,
        moment_cosine_nm=cosine,
        inertia_kg_m2=inertia,
        inertia_load_kg_m2=max(0.0, inertia - ratio * ratio * motor),
        windup_per_acc_s2=windup,
        friction_nm=friction,
        friction_load_nm=calibration.friction_behind_mesh_nm,
        friction_load_ratio=found.friction_load_ratio or 0.0,
        friction_nm_s_per_rad=viscous or 0.0,
        flank_nm=flank,
        torque_spread_nm=machine.motor.torque_rated_nm * ratio,
        residual_nm=_RESIDUAL_SHARE * friction,
        speed_min_rad_s=_SPEED_SHARE * rad(machine.speed.setting_min_deg_s),
        moment_bound_nm=max(_INTERVALS * interval_nm, config.moment_nm),
        friction_bound_nm=max(
            _INTERVALS * friction_interval, config.friction_ratio * (friction + (viscous or 0.0) * fastest)
        ),
        **_gap_bounds(machine, calibration),
        scale_bound_rad=_scale_bound(calibration, moment, interval_nm),
    )


def what_is_not_watched(machine: Machine) -> tuple[str, ...]:
    """Sentences about what of the calibration in use cannot be watched, each with the reason."""
    laws, calibration = machine.control.compensation, machine.calibration
    if calibration is None or not (laws.needs_calibration and laws.calibration_watch.active):
        return ()
    begin = "calibration: no warning comes when it no longer fits in"
    lacking = _missing(calibration, _NEEDED)
    if lacking:
        return tuple(f"{begin} moment, friction and backlash: {name}: {why}" for name, why in lacking)
    return tuple(
        f"{begin} backlash: {name}: {why}" for name, why in _missing(calibration, ("windup_per_acc_s2",))
    )


def _missing(calibration: Calibration, names: tuple[Number, ...]) -> list[tuple[str, str]]:
    """Numbers without a value, or without an interval, each with the reason."""
    unknown = [(name, calibration.unknown[name].words) for name in names if name in calibration.unknown]
    bare = [
        name for name in names if name in calibration.half_width and not calibration.half_width[name] > 0.0
    ]
    return [*unknown, *((name, "its 95 % interval is 0: identify anew") for name in bare)]


def _gap_bounds(machine: Machine, calibration: Calibration) -> dict[str, float]:
    """Bounds of the backlash, and of the change of the lost motion.

    Where backlash is not known it stands in the lost motion, and is at most all of that, both ways together: then a
    load is led by the direction of the motion where the flank of the gears should count, wrong by as much.
    """
    config, found = machine.control.compensation.calibration_watch, calibration.identified
    if not found.windup_per_acc_s2:
        return {}
    most = 2.0 * abs(calibration.maps.reversal_rad[0])
    known, least = found.backlash_rad, rad(config.backlash_deg)
    change = _INTERVALS * (most if known is None else calibration.half_width["backlash_rad"])
    return {
        "backlash_bound_rad": max(most, least) if known is None else known + max(change, least),
        "lost_motion_bound_rad": max(change, rad(config.lost_motion_deg)),
    }


def _scale_bound(calibration: Calibration, moment_nm: float, interval_nm: float) -> float:
    """What the wind-up of the eccentric moment may be wrong by, rad; infinite where it is not known."""
    stiffness = calibration.identified.stiffness_nm_per_rad
    if not stiffness:
        return math.inf
    wrong = calibration.half_width["stiffness_nm_per_rad"] / stiffness
    return _INTERVALS * (moment_nm * wrong + interval_nm) / stiffness
