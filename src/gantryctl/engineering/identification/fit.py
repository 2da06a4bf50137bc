"""The numbers: least squares over the recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.analysis.measured.speed_loop import SpeedLoop
from gantryctl.engineering.identification.least_squares import estimate_of, solved
from gantryctl.engineering.identification.measure import AxisUnderTest, MotionRecording, record
from gantryctl.engineering.identification.samples import Floats, Samples, joined
from gantryctl.engineering.identification.torque_balance import BalanceFit, TorqueBalance, torque_balance
from gantryctl.machine import Calibration, Identified, Machine, Maps, Number, Unknown, identity_hash
from gantryctl.machine.calibration import MAP_HARMONICS, REVERSAL_HARMONICS, SCALE_HARMONICS, Origin
from gantryctl.units import rad

_DATE_OF_NOBODY: Final = "1970-01-01"
# Of the rated torque, at the axis. Nearer to 0 the mesh is about to change its flank, and backlash would count as
# wind-up: 2.5 kN m on the reference gantry.
_FLANK_SHARE: Final = 0.0085
# Fewer accelerated samples tell no wind-up from noise.
_SAMPLES_MIN: Final = 50
# Gears err by less than this: a wave that a short travel cannot tell from others stays as small.
_WAVE_SPREAD_RAD: Final = 3e-4
# What is left of one sample, as the prior weighs it.
_SAMPLE_RAD: Final = 1e-5
# What the model leaves out, in parts of the value: breakaway, hysteresis, three slopes of the spring (a loaded reducer
# is up to 1.75 times as stiff), a load that swings at the ends of a ramp.
_MODEL_SHARE: Final[dict[Number, float]] = {
    "moment_sine_nm": 0.02,
    "moment_cosine_nm": 0.02,
    "inertia_kg_m2": 0.02,
    "motor_inertia_kg_m2": 0.08,
    "stiffness_nm_per_rad": 0.4,
    "windup_per_acc_s2": 0.5,
    "swing_hz": 0.25,
    "friction_nm": 0.1,
    "friction_load_ratio": 0.25,
    "friction_nm_s_per_rad": 0.1,
    "dead_time_s": 0.15,
}
# A number of its own size is known when its interval does not reach 0; these may be 0, or are parts. Friction may be 0
# too: it is known when its interval is smaller than the torque at which the gears change their flank.
_KNOWN_WITHIN: Final[dict[Number, float]] = {
    "moment_sine_nm": math.inf,
    "moment_cosine_nm": math.inf,
    "friction_nm_s_per_rad": math.inf,
    "friction_load_ratio": 0.3,
}
# Wind-up per acceleration before it is measured: of a mode of 0.05 Hz.
_WINDUP_SPREAD: Final = np.array([10.0, 1.0, 1e-2, 1e-2])


@dataclass(frozen=True)
class CalibrationFit:
    """Identified numbers, and how well they fit.

    Attributes:
        half_width: half of the 95 % interval of each number. unknown: numbers that could not be identified.
        residual_deg: rms of the slow turns after the fit.
        balance: moment, inertia and friction in parts.
        delay_s: of the instrument against the motor encoder.
        recording: what it was found from.
    """

    identified: Identified
    half_width: dict[Number, float]
    unknown: dict[Number, Unknown]
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

    What the travel, the loads or the instrument do not show is told in `unknown`; the rest is identified.
    """
    turns, swings, loop = recording.turns, recording.swings, recording.speed_loop
    experiment = recording.experiment
    # Without a measured rotor that of the name plate: it only divides the inertia between load and motor.
    motor_inertia = loop.inertia_kg_m2 if loop else machine.motor.inertia_kg_m2
    lack = loop.sampled_torque_lack_kg_m2(machine.control.scan_period_ms * 1e-3) if loop else 0.0
    balanced = torque_balance(joined([turns, swings]), machine.axis.ratio, motor_inertia, lack)
    mesh, rest = experiment.slow_cycles, experiment.creep_cycles
    lead, reversal, waves, residual = _fit_turns(turns, mesh)
    flank_nm = _FLANK_SHARE * machine.motor.torque_rated_nm * machine.axis.ratio
    windup, delay_s = _fit_windup(swings, lead, reversal, balanced.balance, flank_nm)
    # What the delay makes of two directions is no lost motion.
    reversal[0] -= delay_s * rad(experiment.turn_deg_s)
    identified, half_width, unknown = _numbers(balanced, loop, windup, flank_nm)
    # Without a mode a wave is as large in passing as at rest.
    swing_hz = identified.swing_hz or math.inf
    found = [
        *_static(mesh, waves, experiment.turn_deg_s, swing_hz),
        *_static(
            rest,
            _fit_creep(recording.creep, rest, (machine.axis.ring_ratio, *mesh)),
            experiment.creep_deg_s,
            swing_hz,
        ),
    ]
    gear = _without_windup(lead, identified, found, rad(machine.axis.start_angle_deg))
    scale = (
        _fit_scale(turns, rad(machine.axis.start_angle_deg))
        if recording.has_ring and recording.sees_space
        else ()
    )
    maps = Maps(
        gear_rad=tuple(gear.tolist()),
        reversal_rad=tuple(reversal.tolist()),
        scale_rad=scale,
        fast=tuple(found),
    )
    return CalibrationFit(
        identified, half_width, unknown, maps, math.degrees(residual), balanced.balance, delay_s, recording
    )


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
    return Calibration(
        origin=origin,
        identified=found.identified,
        half_width=found.half_width,
        unknown=found.unknown,
        maps=found.maps,
    )


def waves_of(angle_rad: Floats, cycles: Sequence[float]) -> Floats:
    """Columns sin(c x), cos(c x) for each c: shape (samples, 2 x cycles)."""
    columns = [f(c * angle_rad) for c in cycles for f in (np.sin, np.cos)]
    return np.stack(columns, axis=1) if columns else np.empty((len(angle_rad), 0))


def harmonics_of(angle_rad: Floats, count: int) -> Floats:
    """Columns 1, sin x, cos x, sin 2x ...: shape (samples, 2 count + 1)."""
    return np.column_stack([np.ones_like(angle_rad), waves_of(angle_rad, range(1, count + 1))])


def _solve(columns: Floats, wanted: Floats, free: int = 0) -> Floats:
    """Least squares, waves of the gear kept as small as gears are; the first `free` columns are no waves."""
    prior = np.full(columns.shape[1], _SAMPLE_RAD / _WAVE_SPREAD_RAD)
    prior[:free] = 0.0
    return solved(columns, wanted, prior)


def _fit_turns(turns: Samples, mesh: Sequence[float]) -> tuple[Floats, Floats, Floats, float]:
    """Mean map, reversal map and mesh waves, with the rms of what is left."""
    at, lead = turns.act_rad, turns.act_rad - turns.load_rad
    mean = harmonics_of(at, MAP_HARMONICS)
    turned = mean[:, : 2 * REVERSAL_HARMONICS + 1] * turns.direction[:, np.newaxis]
    columns = np.column_stack([mean, turned, waves_of(at, mesh)])
    x = _solve(columns, lead, free=1)
    left = lead - columns @ x
    first, second = mean.shape[1], mean.shape[1] + turned.shape[1]
    return x[:first], x[first:second], x[second:], float(np.sqrt(np.mean(left**2)))


class _Windup(NamedTuple):
    """Lead of the motor per acceleration of the load, s2, with half of its 95 % interval; or why it is unknown."""

    per_acc_s2: float
    half_width_s2: float
    unknown: Unknown | None = None


def _fit_windup(
    swings: Samples, lead: Floats, reversal: Floats, balance: TorqueBalance, flank_nm: float
) -> tuple[_Windup, float]:
    """Lead per acceleration and per speed beyond the maps, where the mesh stays on the flank of the slow turns."""
    with_acc, without = (balance.mesh_torque_nm(swings, accelerating=a) for a in (True, False))
    same_flank = (with_acc * without > 0.0) & (np.minimum(abs(with_acc), abs(without)) > flank_nm)
    used = swings.where(same_flank)
    accelerated = int(np.count_nonzero(np.abs(used.acc_rad_s2) > 1e-9))
    if accelerated < _SAMPLES_MIN:
        return _Windup(0.0, math.inf, Unknown.NO_FLANK), 0.0
    at = used.act_rad
    expected = harmonics_of(at, MAP_HARMONICS) @ lead
    expected += used.direction * (harmonics_of(at, REVERSAL_HARMONICS) @ reversal)
    columns: Floats = np.column_stack([used.acc_rad_s2, used.vel_rad_s, used.direction, np.ones_like(at)])
    wanted = at - used.load_rad - expected
    found: Floats = np.asarray(np.linalg.lstsq(columns, wanted, rcond=None)[0])
    estimate = estimate_of(found, columns, wanted - columns @ found, used.stretch, _WINDUP_SPREAD)
    half_width = estimate.half_width_of(np.array([1.0, 0.0, 0.0, 0.0]))
    unknown = None if float(found[0]) > half_width else Unknown.NO_WINDUP
    return _Windup(float(found[0]), half_width, unknown), float(found[1])


def _fit_creep(creep: Samples, cycles: Sequence[float], slower: Sequence[float]) -> Floats:
    """Waves of the reducer; slower parts of the map are a parabola, and pinion and mesh, over so short a way."""
    at = creep.act_rad
    slow = np.column_stack([np.ones_like(at), at, at**2, waves_of(at, slower)])
    columns = np.column_stack([slow, waves_of(at, cycles)])
    return _solve(columns, at - creep.load_rad, free=slow.shape[1])[slow.shape[1] :]


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


def _numbers(
    balanced: BalanceFit, loop: SpeedLoop | None, windup: _Windup, flank_nm: float
) -> tuple[Identified, dict[Number, float], dict[Number, Unknown]]:
    """The numbers with their intervals, and those that could not be identified."""
    balance, half = balanced.balance, balanced.half_width
    inertia = balance.inertia_load_kg_m2 + balance.inertia_motor_kg_m2
    values: dict[Number, tuple[float, float]] = {
        "moment_sine_nm": (balance.moment_sine_nm, half["moment_sine_nm"]),
        "moment_cosine_nm": (balance.moment_cosine_nm, half["moment_cosine_nm"]),
        "inertia_kg_m2": (inertia, half["inertia_kg_m2"]),
        "friction_nm": (
            balance.friction_load_side_nm + balance.friction_motor_side_nm, half["friction_nm"],
        ),
        "friction_load_ratio": (balance.friction_load_ratio, half["friction_load_ratio"]),
        "friction_nm_s_per_rad": (balance.viscous_nm_s_per_rad, half["viscous_nm_s_per_rad"]),
    }  # fmt: skip
    unknown: dict[Number, Unknown] = {}
    if loop is None:
        unknown |= dict.fromkeys(("motor_inertia_kg_m2", "dead_time_s"), Unknown.NO_SPEED_LOOP)
    else:
        values["motor_inertia_kg_m2"] = (loop.inertia_kg_m2, 0.0)
        values["dead_time_s"] = (loop.dead_time_s, 0.0)
    if windup.unknown is not None:
        names: tuple[Number, ...] = ("stiffness_nm_per_rad", "windup_per_acc_s2", "swing_hz")
        unknown |= dict.fromkeys(names, windup.unknown)
    else:
        per_acc, ratio = windup.per_acc_s2, windup.half_width_s2 / windup.per_acc_s2
        load = balance.inertia_load_kg_m2
        swing_hz = 1.0 / (2.0 * math.pi * math.sqrt(per_acc))
        values["windup_per_acc_s2"] = (per_acc, windup.half_width_s2)
        values["swing_hz"] = (swing_hz, 0.5 * ratio * swing_hz)
        stiffness = load / per_acc
        values["stiffness_nm_per_rad"] = (
            stiffness, stiffness * math.hypot(half["inertia_load_kg_m2"] / load, ratio),
        )  # fmt: skip
    known_within = {**_KNOWN_WITHIN, "friction_nm": max(flank_nm, values["friction_nm"][0])}
    for name, (value, half_width) in list(values.items()):
        if not half_width < known_within.get(name, value):
            unknown[name] = Unknown.TOO_WIDE
            del values[name]
    # Of the moment the size is that of both parts: what is wrong with one shows in the other.
    size = {name: abs(value) for name, (value, _) in values.items()}
    moment = math.hypot(size["moment_sine_nm"], size["moment_cosine_nm"])
    size |= {"moment_sine_nm": moment, "moment_cosine_nm": moment}
    return (
        Identified(**{name: value for name, (value, _) in values.items()}),
        {name: math.hypot(half, _MODEL_SHARE[name] * size[name]) for name, (_, half) in values.items()},
        unknown,
    )


def _without_windup(
    lead: Floats, identified: Identified, fast: Sequence[tuple[float, float, float]], zero_rad: float
) -> Floats:
    """The gear map: mean lead without the wind-up of the eccentric moment; all maps together are 0 at `zero_rad`."""
    gear = lead.copy()
    stiffness = identified.stiffness_nm_per_rad
    if stiffness is not None:
        gear[1] -= (identified.moment_sine_nm or 0.0) / stiffness
        gear[2] -= (identified.moment_cosine_nm or 0.0) / stiffness
    waves = sum(
        sine * math.sin(cycles * zero_rad) + cosine * math.cos(cycles * zero_rad)
        for cycles, sine, cosine in fast
    )
    gear[0] = -(float(harmonics_of(np.array([zero_rad]), MAP_HARMONICS)[0, 1:] @ lead[1:]) + waves)
    return gear


def _fit_scale(turns: Samples, zero_rad: float) -> tuple[float, ...]:
    """Load-side encoder minus load over its own angle, both directions together; 0 at `zero_rad`."""
    columns = harmonics_of(turns.ring_rad, SCALE_HARMONICS)
    both = np.column_stack([turns.direction, columns])
    scale = _solve(both, turns.ring_rad - turns.load_rad, free=2)[1:]
    scale[0] = -harmonics_of(np.array([zero_rad]), SCALE_HARMONICS)[0, 1:] @ scale[1:]
    return tuple(float(v) for v in scale)
