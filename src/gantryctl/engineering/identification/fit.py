"""The numbers: least squares over the recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.analysis.measured.speed_loop import SpeedLoop
from gantryctl.engineering.identification.experiment import Experiment, expected_waves
from gantryctl.engineering.identification.lead import (
    FastWaves,
    Lead,
    fit_lead,
    harmonics_of,
    wave_solution,
)
from gantryctl.engineering.identification.least_squares import estimate_of
from gantryctl.engineering.identification.measure import AxisUnderTest, MotionRecording, record
from gantryctl.engineering.identification.samples import Floats, Samples, joined
from gantryctl.engineering.identification.torque_balance import BalanceFit, TorqueBalance, torque_balance
from gantryctl.engineering.identification.validation import Validation, validated
from gantryctl.engineering.identification.waves import Band, find_waves, waves_of
from gantryctl.errors import CriterionNotMet
from gantryctl.machine import Calibration, Identified, Machine, Maps, Number, Unknown, identity_hash
from gantryctl.machine.calibration import FAST_WAVES, SCALE_HARMONICS, Origin
from gantryctl.units import rad
from gantryctl.wiring.compensation import flank_torque_nm

_DATE_OF_NOBODY: Final = "1970-01-01"
# Of the torque at which the mesh changes its flank: nearer to 0 backlash would count as wind-up, 2.5 kN m on the
# reference gantry.
_SAFE_FLANKS: Final = 2.5
# Fewer accelerated samples tell no wind-up from noise.
_SAMPLES_MIN: Final = 50
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
    "backlash_rad": 0.25,
    "friction_load_nm": 0.2,
}
# A number of its own size is known when its interval does not reach 0; these may be 0, or are parts. Friction may be 0
# too: it is known when its interval is smaller than the torque at which the gears change their flank.
_KNOWN_WITHIN: Final[dict[Number, float]] = {
    "moment_sine_nm": math.inf,
    "moment_cosine_nm": math.inf,
    "friction_nm_s_per_rad": math.inf,
    "friction_load_ratio": 0.3,
    "friction_load_nm": math.inf,
}
# Wind-up per acceleration before it is measured: of a mode of 0.05 Hz.
_WINDUP_SPREAD: Final = np.array([10.0, 1.0, 1e-2, 1e-2])


@dataclass(frozen=True)
class CalibrationFit:
    """Identified numbers, and how well they fit.

    Attributes:
        half_width: half of the 95 % interval of each number. unknown: numbers that could not be identified.
        residual_deg: rms of the slow turns after the fit. left_over: waves per turn that the law has no place for.
        lead: what they show.
        validation: what the model leaves of a move that was not in the fit.
        balance: moment, inertia and friction in parts.
        delay_s: of the instrument against the motor encoder.
        recording: what it was found from.
    """

    identified: Identified
    half_width: dict[Number, float]
    unknown: dict[Number, Unknown]
    maps: Maps
    residual_deg: float
    left_over: list[float]
    lead: Lead
    validation: Validation
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
    balance, expected = balanced.balance, expected_waves(machine)
    flank_nm = flank_torque_nm(machine)
    lead = fit_lead(
        turns,
        balance.mesh_torque_nm(turns, accelerating=False),
        flank_nm,
        Band(0.0, experiment.turn_waves),
        expected,
    )
    windup, delay_s = _fit_windup(swings, lead, balance, flank_nm)
    # What the delay makes of two directions is no lost motion.
    lead.reversal_rad[0] -= delay_s * rad(experiment.turn_deg_s)
    identified, half_width, unknown = _numbers(balanced, loop, windup, lead, flank_nm)
    # Without a mode a wave is as large in passing as at rest.
    swing_hz = identified.swing_hz or math.inf
    found = _static(lead.waves, experiment.turn_deg_s, swing_hz)
    found += _static(
        _fit_creep(recording.creep, lead, found, balance, flank_nm, experiment, expected, swing_hz),
        experiment.creep_deg_s,
        swing_hz,
    )
    # The largest where there are more than the law carries.
    found.sort(key=lambda wave: -math.hypot(*wave[1:]))
    found, left_over = sorted(found[:FAST_WAVES]), [wave[0] for wave in found[FAST_WAVES:]]
    gear = _without_windup(lead.mean_rad, identified, found, rad(machine.axis.start_angle_deg))
    scale = (
        _fit_scale(turns, rad(machine.axis.start_angle_deg))
        if recording.has_ring and recording.sees_space
        else ()
    )
    lean = _fit_lean(swings, scale) if scale else None
    load_kg_m2 = balance.inertia_load_kg_m2
    maps = Maps(
        gear_rad=tuple(gear.tolist()),
        reversal_rad=tuple(lead.reversal_rad.tolist()),
        scale_rad=scale,
        lean_rad_per_nm=lean.per_acc_s2 / load_kg_m2 if lean and load_kg_m2 > 0.0 else None,
        fast=tuple(found),
    )
    check = recording.check
    validation = validated(
        lead,
        turns,
        check,
        balance.mesh_torque_nm(check, accelerating=False),
        flank_nm,
        delay_s,
        experiment.turn_waves,
    )
    residual_deg = math.degrees(float(np.sqrt(np.mean(lead.left_rad**2))))
    return CalibrationFit(
        identified,
        half_width,
        unknown,
        maps,
        residual_deg,
        left_over,
        lead,
        validation,
        balance,
        delay_s,
        recording,
    )


def calibrate(axis: AxisUnderTest, *, date: str = _DATE_OF_NOBODY, version: int = 1) -> Calibration:
    """Record and fit: the calibration of an axis.

    Raises:
        CriterionNotMet: the maps leave too much of what they are for.
    """
    found = fit(axis.machine, record(axis))
    check_valid(axis.machine, found)
    return calibration_of(axis.machine, found, date, version)


def check_valid(machine: Machine, found: CalibrationFit) -> None:
    """Refuse maps that leave more than a third of the lead, and the same again each time.

    Raises:
        CriterionNotMet: with what is left.
    """
    if found.validation.refused:
        raise CriterionNotMet(
            f"{machine.name}: {found.validation.words(machine.axis.dial)}; more than a third of the lead is left, so "
            "no calibration is written: look at the gears there, or name the wave in [control.compensation.gear_map] "
            "cycles_per_turn"
        )


def calibration_of(machine: Machine, found: CalibrationFit, date: str, version: int) -> Calibration:
    """The calibration file of a fit, rounded to a hundredth of what is known: the same on every computer."""
    recording, half = found.recording, found.half_width
    map_place = math.radians(found.validation.left_deg) * 1e-4
    lean = found.maps.lean_rad_per_nm
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
        identified=Identified(
            **{name: _rounded(getattr(found.identified, name), 0.01 * half[name]) for name in half}
        ),
        half_width={name: _rounded(width, 0.01 * width) for name, width in half.items()},
        unknown=found.unknown,
        maps=Maps(
            gear_rad=_all_rounded(found.maps.gear_rad, map_place),
            reversal_rad=_all_rounded(found.maps.reversal_rad, map_place),
            scale_rad=_all_rounded(found.maps.scale_rad, map_place),
            lean_rad_per_nm=None if lean is None else _rounded(lean, 1e-3 * lean),
            fast=tuple(
                (c, _rounded(sine, map_place), _rounded(cosine, map_place))
                for c, sine, cosine in found.maps.fast
            ),
        ),
    )


def _rounded(value: float, least: float) -> float:
    """A value to the decimal place of `least`, the smallest part of it that means something."""
    return round(value, -math.floor(math.log10(least))) if least > 0.0 else value


def _all_rounded(values: Sequence[float], least: float) -> tuple[float, ...]:
    return tuple(_rounded(value, least) for value in values)


class _Windup(NamedTuple):
    """Lead of the motor per acceleration of the load, s2, with half of its 95 % interval; or why it is unknown."""

    per_acc_s2: float
    half_width_s2: float
    unknown: Unknown | None = None


def _fit_windup(
    swings: Samples, lead: Lead, balance: TorqueBalance, flank_nm: float
) -> tuple[_Windup, float]:
    """Lead per acceleration and per speed beyond the maps, where the mesh stays on the flank of the slow turns."""
    with_acc, without = (balance.mesh_torque_nm(swings, accelerating=a) for a in (True, False))
    same_flank = (with_acc * without > 0.0) & (
        np.minimum(abs(with_acc), abs(without)) > _SAFE_FLANKS * flank_nm
    )
    used = swings.where(same_flank)
    accelerated = int(np.count_nonzero(np.abs(used.acc_rad_s2) > 1e-9))
    if accelerated < _SAMPLES_MIN:
        return _Windup(0.0, math.inf, Unknown.NO_FLANK), 0.0
    at = used.act_rad
    expected = lead.at(used, balance.mesh_torque_nm(used), flank_nm)
    columns: Floats = np.column_stack([used.acc_rad_s2, used.vel_rad_s, used.direction, np.ones_like(at)])
    wanted = at - used.load_rad - expected
    found: Floats = np.asarray(np.linalg.lstsq(columns, wanted, rcond=None)[0])
    estimate = estimate_of(found, columns, wanted - columns @ found, used.stretch, _WINDUP_SPREAD)
    half_width = estimate.half_width_of(np.array([1.0, 0.0, 0.0, 0.0]))
    unknown = None if float(found[0]) > half_width else Unknown.NO_WINDUP
    return _Windup(float(found[0]), half_width, unknown), float(found[1])


def _fit_creep(
    creep: Samples,
    lead: Lead,
    slow: FastWaves,
    balance: TorqueBalance,
    flank_nm: float,
    experiment: Experiment,
    expected: Sequence[float],
    swing_hz: float,
) -> FastWaves:
    """Waves too fast for the slow turns, as they pass; what maps and slower waves leave is a parabola."""
    at = creep.act_rad
    wanted = at - creep.load_rad - lead.at(creep, balance.mesh_torque_nm(creep, accelerating=False), flank_nm)
    for wave, sine, cosine in slow:
        larger = _seen_larger(wave, experiment.creep_deg_s, swing_hz)
        wanted = wanted - larger * (waves_of(at, [wave]) @ np.array([sine, cosine]))
    bend = np.column_stack([np.ones_like(at), at, at**2])

    def columns(cycles: Sequence[float]) -> Floats:
        return np.column_stack([bend, waves_of(at, cycles)])

    def left(cycles: Sequence[float]) -> Floats:
        return np.asarray(
            wanted - columns(cycles) @ wave_solution(columns(cycles), wanted, free=bend.shape[1])
        )

    # A creep of some degrees tells a wave from its neighbours less well than a turn does.
    cycles = find_waves(
        at,
        left,
        Band(experiment.turn_waves, experiment.creep_waves),
        [*expected, *(wave[0] for wave in lead.shaken)],
    )
    pairs = wave_solution(columns(cycles), wanted, free=bend.shape[1])[bend.shape[1] :].reshape(-1, 2)
    return [(c, float(sine), float(cosine)) for c, (sine, cosine) in zip(cycles, pairs, strict=True)]


def _static(waves: FastWaves, speed_deg_s: float, swing_hz: float) -> FastWaves:
    """Waves as they are at rest, from waves seen while passing."""
    larger = [_seen_larger(c, speed_deg_s, swing_hz) for c, _, _ in waves]
    return [(c, sine / by, cosine / by) for (c, sine, cosine), by in zip(waves, larger, strict=True)]


def _seen_larger(cycles: float, speed_deg_s: float, swing_hz: float) -> float:
    """How much larger a wave is seen in passing than at rest: the load is a mass on a spring."""
    share = cycles * rad(speed_deg_s) / (2.0 * math.pi) / swing_hz
    return 1.0 / (1.0 - share * share)


def _numbers(
    balanced: BalanceFit, loop: SpeedLoop | None, windup: _Windup, lead: Lead, flank_nm: float
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
    if lead.backlash_rad is None:
        unknown["backlash_rad"] = Unknown.NO_GAP
    else:
        values["backlash_rad"] = (lead.backlash_rad, lead.backlash_half_width_rad)
    if balance.friction_load_side_nm > 0.0:
        values["friction_load_nm"] = (balance.friction_load_side_nm, half["friction_load_side_nm"])
    else:  # Under a small moment it is not told from the motor's; what drives the load is no friction.
        unknown["friction_load_nm"] = Unknown.TOO_WIDE
    known_within = {**_KNOWN_WITHIN, "friction_nm": max(_SAFE_FLANKS * flank_nm, values["friction_nm"][0])}
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
    gear[0] = -(float(harmonics_of(np.array([zero_rad]), len(lead) // 2)[0, 1:] @ lead[1:]) + waves)
    return gear


def _fit_scale(turns: Samples, zero_rad: float) -> tuple[float, ...]:
    """Load-side encoder minus load over its own angle, both directions together; 0 at `zero_rad`."""
    columns = harmonics_of(turns.ring_rad, SCALE_HARMONICS)
    both = np.column_stack([turns.direction, columns])
    scale = wave_solution(both, turns.ring_rad - turns.load_rad, free=2)[1:]
    scale[0] = -harmonics_of(np.array([zero_rad]), SCALE_HARMONICS)[0, 1:] @ scale[1:]
    return tuple(float(v) for v in scale)


def _fit_lean(swings: Samples, scale: Sequence[float]) -> _Windup | None:
    """What the base leans per acceleration of the load: what the load-side encoder shows more than the instrument.

    None where swings show it no better than 0. The torque that accelerates bends the base as that of the eccentric
    moment does, and of that the scale map holds one angle for each place only.
    """
    columns: Floats = np.column_stack(
        [swings.acc_rad_s2, swings.vel_rad_s, swings.direction, np.ones_like(swings.acc_rad_s2)]
    )
    own = harmonics_of(swings.ring_rad, len(scale) // 2) @ np.array(scale)
    wanted = swings.ring_rad - swings.load_rad - own
    found: Floats = np.asarray(np.linalg.lstsq(columns, wanted, rcond=None)[0])
    estimate = estimate_of(found, columns, wanted - columns @ found, swings.stretch, _WINDUP_SPREAD)
    half_width = estimate.half_width_of(np.array([1.0, 0.0, 0.0, 0.0]))
    return _Windup(float(found[0]), half_width) if float(found[0]) > half_width else None
