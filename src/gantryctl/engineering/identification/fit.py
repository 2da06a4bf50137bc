"""The numbers: least squares over the recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gantryctl.engineering.analysis.measured.speed_loop import SpeedLoop
from gantryctl.engineering.identification.measure import (
    CREEP_DEG_S,
    TURN_DEG_S,
    AxisUnderTest,
    MotionRecording,
    record,
)
from gantryctl.engineering.identification.samples import Floats, Samples, joined
from gantryctl.engineering.identification.torque_balance import TorqueBalance, torque_balance
from gantryctl.errors import UsageError
from gantryctl.machine import Calibration, Identified, Machine, Maps, identity_hash
from gantryctl.machine.calibration import MAP_HARMONICS, REVERSAL_HARMONICS, SCALE_HARMONICS, Origin
from gantryctl.units import rad

_DATE_OF_NOBODY: Final = "1970-01-01"
_SLOW_CYCLES: Final = (
    # Waves with fewer cycles per turn are seen in the slow turns, others in the creep.
    400.0
)
# Nearer to 0 the mesh is about to change its flank, and backlash would count as wind-up.
_FLANK_NM: Final = 2500.0
# Fewer accelerated samples tell no wind-up from noise.
_SAMPLES_MIN: Final = 50


@dataclass(frozen=True)
class CalibrationFit:
    """Identified numbers, and how well they fit.

    Attributes:
        residual_deg: rms of the slow turns after the fit.
        balance: moment, inertia and friction in parts.
        delay_s: of the instrument against the motor encoder.
        recording: what it was found from.
    """

    identified: Identified
    maps: Maps
    residual_deg: float
    balance: TorqueBalance
    delay_s: float
    recording: MotionRecording


def fit(machine: Machine, recording: MotionRecording) -> CalibrationFit:
    """Fit friction, moment, inertia, wind-up, first mode and maps.

    The lead, motor encoder minus load, is in the slow turns the mean map plus, by direction, the reversal map. What
    the swings show beyond that is the wind-up of the acceleration, J/k, and with it the first mode. Waves that pass
    with frequency f are seen larger by 1/(1 - (f/f1)^2), the load being a mass on a spring, and are taken back. What
    grows with the speed is the time by which the instrument's readings are late.

    Raises:
        UsageError: the load shows no wind-up under acceleration: a rigid machine, or an instrument that does not see
            the load.
    """
    turns, swings, loop = recording.turns, recording.swings, recording.speed_loop
    balance = torque_balance(
        joined([turns, swings]),
        machine.axis.ratio,
        loop.inertia_kg_m2,
        loop.sampled_torque_lack_kg_m2(machine.control.scan_period_ms * 1e-3),
    )
    fast = [c for c in machine.control.compensation.gear_map.cycles_per_turn if c > MAP_HARMONICS]
    mesh = [c for c in fast if c <= _SLOW_CYCLES]
    lead, reversal, waves, residual = _fit_turns(turns, mesh)
    windup, delay_s = _fit_windup(swings, lead, reversal, balance)
    if not windup > 1e-6:
        raise UsageError(
            f"identification: the load follows the acceleration with {windup:.3g} s2 of wind-up, at least 1e-6 is "
            "needed: a rigid machine, or an instrument that does not see the load"
        )
    # What the delay makes of two directions is no lost motion.
    reversal[0] -= delay_s * rad(TURN_DEG_S)
    swing_hz = 1.0 / (2.0 * math.pi * math.sqrt(windup))
    rest = [c for c in fast if c not in mesh]
    found = [
        *_static(mesh, waves, TURN_DEG_S, swing_hz),
        *_static(rest, _fit_creep(recording.creep, rest, mesh), CREEP_DEG_S, swing_hz),
    ]
    identified = _numbers(balance, loop, windup)
    gear = _without_windup(lead, identified, found)
    scale = _fit_scale(turns) if recording.has_ring and recording.sees_space else ()
    maps = Maps(
        gear_rad=tuple(gear.tolist()),
        reversal_rad=tuple(reversal.tolist()),
        scale_rad=scale,
        fast=tuple(found),
    )
    return CalibrationFit(identified, maps, math.degrees(residual), balance, delay_s, recording)


def calibrate(axis: AxisUnderTest, *, date: str = _DATE_OF_NOBODY, version: int = 1) -> Calibration:
    """Record and fit: the calibration of an axis."""
    return calibration_of(axis.machine, fit(axis.machine, record(axis)), date, version)


def calibration_of(machine: Machine, found: CalibrationFit, date: str, version: int) -> Calibration:
    """The calibration file of a fit."""
    recording = found.recording
    origin = Origin(
        machine=machine.name,
        version=version,
        date=date,
        identity=identity_hash(machine),
        encoder_serial=recording.encoder_serial,
        instrument=recording.instrument,
        trace_sha256=recording.trace_sha256,
    )
    return Calibration(origin=origin, identified=found.identified, maps=found.maps)


def waves_of(angle_rad: Floats, cycles: Sequence[float]) -> Floats:
    """Columns sin(c x), cos(c x) for each c: shape (samples, 2 x cycles)."""
    columns = [f(c * angle_rad) for c in cycles for f in (np.sin, np.cos)]
    return np.stack(columns, axis=1) if columns else np.empty((len(angle_rad), 0))


def harmonics_of(angle_rad: Floats, count: int) -> Floats:
    """Columns 1, sin x, cos x, sin 2x ...: shape (samples, 2 count + 1)."""
    return np.column_stack([np.ones_like(angle_rad), waves_of(angle_rad, range(1, count + 1))])


def _solve(columns: Floats, wanted: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(columns, wanted, rcond=None)[0])


def _fit_turns(turns: Samples, mesh: Sequence[float]) -> tuple[Floats, Floats, Floats, float]:
    """Mean map, reversal map and mesh waves, with the rms of what is left."""
    at, lead = turns.act_rad, turns.act_rad - turns.load_rad
    mean = harmonics_of(at, MAP_HARMONICS)
    turned = mean[:, : 2 * REVERSAL_HARMONICS + 1] * turns.direction[:, np.newaxis]
    columns = np.column_stack([mean, turned, waves_of(at, mesh)])
    x = _solve(columns, lead)
    left = lead - columns @ x
    first, second = mean.shape[1], mean.shape[1] + turned.shape[1]
    return x[:first], x[first:second], x[second:], float(np.sqrt(np.mean(left**2)))


def _fit_windup(
    swings: Samples, lead: Floats, reversal: Floats, balance: TorqueBalance
) -> tuple[float, float]:
    """Lead per acceleration and per speed beyond the maps, where the mesh stays on the flank of the slow turns."""
    with_acc, without = (balance.mesh_torque_nm(swings, accelerating=a) for a in (True, False))
    same_flank = (with_acc * without > 0.0) & (np.minimum(abs(with_acc), abs(without)) > _FLANK_NM)
    used = swings.where(same_flank)
    accelerated = int(np.count_nonzero(np.abs(used.acc_rad_s2) > 1e-9))
    if accelerated < _SAMPLES_MIN:
        raise UsageError(
            f"identification: the mesh keeps its flank in {accelerated} accelerated samples, {_SAMPLES_MIN} are "
            "needed: without a moment that loads the gears, backlash and wind-up cannot be told apart"
        )
    at = used.act_rad
    expected = harmonics_of(at, MAP_HARMONICS) @ lead
    expected += used.direction * (harmonics_of(at, REVERSAL_HARMONICS) @ reversal)
    columns = np.column_stack([used.acc_rad_s2, used.vel_rad_s, used.direction, np.ones_like(at)])
    found = _solve(columns, at - used.load_rad - expected)
    return float(found[0]), float(found[1])


def _fit_creep(creep: Samples, cycles: Sequence[float], mesh: Sequence[float]) -> Floats:
    """Waves of the reducer; slower parts of the map are a parabola and the mesh over so short a way."""
    at = creep.act_rad
    slow = np.column_stack([np.ones_like(at), at, at**2, waves_of(at, [13.0, *mesh])])
    return _solve(np.column_stack([slow, waves_of(at, cycles)]), at - creep.load_rad)[slow.shape[1] :]


def _static(
    cycles: Sequence[float], waves: Floats, speed_deg_s: float, swing_hz: float
) -> list[tuple[float, float, float]]:
    """Waves as they are at rest, from waves seen while passing."""
    found = []
    for k, c in enumerate(cycles):
        share = c * rad(speed_deg_s) / (2.0 * math.pi) / swing_hz
        seen_larger = 1.0 / (1.0 - share * share)
        found.append((c, float(waves[2 * k] / seen_larger), float(waves[2 * k + 1] / seen_larger)))
    return found


def _numbers(balance: TorqueBalance, loop: SpeedLoop, windup: float) -> Identified:
    return Identified(
        moment_sine_nm=balance.moment_sine_nm,
        moment_cosine_nm=balance.moment_cosine_nm,
        inertia_kg_m2=balance.inertia_load_kg_m2 + balance.inertia_motor_kg_m2,
        motor_inertia_kg_m2=loop.inertia_kg_m2,
        stiffness_nm_per_rad=balance.inertia_load_kg_m2 / windup,
        windup_per_acc_s2=windup,
        swing_hz=1.0 / (2.0 * math.pi * math.sqrt(windup)),
        friction_nm=balance.friction_load_side_nm + balance.friction_motor_side_nm,
        friction_load_ratio=balance.friction_load_ratio,
        friction_nm_s_per_rad=balance.viscous_nm_s_per_rad,
        dead_time_s=loop.dead_time_s,
    )


def _without_windup(
    lead: Floats, identified: Identified, fast: Sequence[tuple[float, float, float]]
) -> Floats:
    """The gear map: mean lead without the wind-up of the eccentric moment; all maps together are 0 at 0 deg."""
    gear = lead.copy()
    gear[1] -= identified.moment_sine_nm / identified.stiffness_nm_per_rad
    gear[2] -= identified.moment_cosine_nm / identified.stiffness_nm_per_rad
    gear[0] = -(lead[2::2].sum() + sum(cosine for _, _, cosine in fast))
    return gear


def _fit_scale(turns: Samples) -> tuple[float, ...]:
    """Load-side encoder minus load over its own angle, both directions together; 0 at 0 deg."""
    columns = harmonics_of(turns.ring_rad, SCALE_HARMONICS)
    both = np.column_stack([columns, turns.direction])
    scale = _solve(both, turns.ring_rad - turns.load_rad)[: columns.shape[1]]
    scale[0] = -scale[2::2].sum()
    return tuple(float(v) for v in scale)
