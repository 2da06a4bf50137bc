"""The runs: the axis moved under its position loop while an instrument watches the load."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.batch import ClosedLoop, Log
from gantryctl.errors import UsageError
from gantryctl.machine import Machine
from gantryctl.motion import MotionLimits, SetPoint, plan_move
from gantryctl.units import rad
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import fit_load_encoder, gantry_sim

Floats = NDArray[np.float64]

# Speed of the slow turns: friction is steady, and the tooth mesh passes below the first mode.
TURN_DEG_S: Final = 1.0
# Speed of the creep: the waves of the reducer pass slowly enough for the load to follow.
CREEP_DEG_S: Final = 0.1
CREEP_DEG: Final = 8.2
# Of the travel, kept at both ends.
_MARGIN_DEG: Final = 0.5
# Acceleration ramps of the runs.
_JERK_TIME_S: Final = 0.5
_SETTLE_S: Final = 3.0
# After a change of the acceleration.
_TRANSIENT_S: Final = 2.0
# Scans that are averaged to one sample.
_BLOCK: Final = 40


class LoadInstrument(Enum):
    """Instruments at the load."""

    # A laser tracker sampling along: inertial, with the noise of [accuracy].
    TRACKER = "tracker"
    # The encoder on the ring: blind to the rocking of the base, and with scale errors of its own.
    LOAD_ENCODER = "load-encoder"


@dataclass(frozen=True)
class Samples:
    """One steady stretch of motion; means over 40 scans each, at the gantry, SI.

    Attributes:
        act_rad: by the motor encoder. load_rad: by the instrument. ring_rad: by the load-side encoder.
        vel_rad_s, acc_rad_s2: of the set-point. torque_nm: of the motor.
    """

    act_rad: Floats
    load_rad: Floats
    ring_rad: Floats
    vel_rad_s: Floats
    acc_rad_s2: Floats
    torque_nm: Floats

    @property
    def direction(self) -> Floats:
        """+1 or -1."""
        return np.sign(self.vel_rad_s)


@dataclass(frozen=True)
class MotionRecording:
    """Recorded motion of one identification.

    Attributes:
        turns: slow turns, forward and back. moves: fast moves, steady stretches. creep: a slow crawl.
        has_ring: a load-side encoder was recorded.
        axis_time_s: length of the runs.
        trace_sha256: of the samples.
    """

    turns: Samples
    moves: Samples
    creep: Samples
    instrument: LoadInstrument
    has_ring: bool
    axis_time_s: float
    trace_sha256: str


class _Runner:
    """The axis, standing at 0 deg in the beginning."""

    def __init__(self, machine: Machine, instrument: LoadInstrument, seed: int) -> None:
        sim = gantry_sim(machine)
        if instrument is LoadInstrument.LOAD_ENCODER:
            fit_load_encoder(machine, sim)
        self.machine = machine
        self.instrument = instrument
        self.loop = ClosedLoop.standing_at(sim, position_law(machine), 0.0)
        self.latency_s = machine.control.compensation.latency_us * 1e-6
        self.sigma_rad = machine.accuracy.tracker_noise_um * 1e-6 / machine.accuracy.chord_radius_m
        self.rng = np.random.default_rng(seed)
        self.pos_rad = 0.0
        self.time_s = 0.0

    def go(self, to_deg: float, vel_deg_s: float) -> Log:
        """Move and settle."""
        acc = rad(self.machine.virtual_axis.acc_deg_s2)
        limits = MotionLimits(rad(vel_deg_s), acc, acc, acc / _JERK_TIME_S)
        plan = plan_move(SetPoint(self.pos_rad, 0.0, 0.0), rad(to_deg), limits)
        self.pos_rad = rad(to_deg)
        self.time_s += plan.duration + _SETTLE_S
        return self.loop.run(plan, plan.duration + _SETTLE_S)

    def samples(self, log: Log, *, cruise_only: bool) -> Samples:
        """The steady stretches of a log: constant speed, or constant acceleration as well."""
        vel, acc = log["vel_ref_rad_s"], log["acc_ref_rad_s2"]
        steady = np.abs(np.diff(acc, prepend=acc[0])) < 1e-12
        # The swing of the load dies out; what is left belongs to maps and wind-up.
        skip = round(_TRANSIENT_S / log.period_s)
        since = np.arange(len(vel)) - np.maximum.accumulate(np.where(steady, 0, np.arange(len(vel))))
        keep = steady & (since > skip) & (np.abs(vel) > rad(0.5 * CREEP_DEG_S))
        if cruise_only:
            keep &= np.abs(acc) < 1e-9
        chosen = np.flatnonzero(keep)
        rows = chosen[: len(chosen) // _BLOCK * _BLOCK].reshape(-1, _BLOCK)
        rows = rows[rows[:, -1] - rows[:, 0] == _BLOCK - 1]

        def mean(values: Floats) -> Floats:
            return np.asarray(values[rows].mean(axis=1))

        ring = mean(log["pos_ring_rad"])
        # A mean of 40 samples carries noise smaller by the square root of 40.
        seen = mean(log["pos_load_rad"]) + self.rng.normal(0.0, self.sigma_rad / _BLOCK**0.5, len(rows))
        return Samples(
            # A reading is latency_us old: at constant speed it lags by speed times age.
            act_rad=mean(log["pos_act_rad"] + self.latency_s * log["vel_ref_rad_s"]),
            load_rad=seen if self.instrument is LoadInstrument.TRACKER else ring,
            ring_rad=ring,
            vel_rad_s=mean(vel),
            acc_rad_s2=mean(acc),
            torque_nm=mean(log["torque_act_nm"]),
        )


def record(
    machine: Machine, instrument: LoadInstrument = LoadInstrument.TRACKER, seed: int = 0
) -> MotionRecording:
    """Turn the simulated machine slowly through its travel both ways, fast both ways, and let it creep.

    Args:
        seed: of the instrument's noise.

    Raises:
        UsageError: the travel is shorter than half a turn: the maps would have no ground.
    """
    axis, fast = machine.axis, machine.speed.setting_max_deg_s
    low, high = axis.pos_min_deg + _MARGIN_DEG, axis.pos_max_deg - _MARGIN_DEG
    # Sixteen harmonics over less than half a turn cannot be told apart.
    if high - low < 180.0:
        raise UsageError(
            f"identification needs at least half a turn of travel, [axis] gives {high - low + 1.0:g} deg"
        )
    runner = _Runner(machine, instrument, seed)
    # 17 minutes of axis time: slow turns for the maps, fast ones for inertia and wind-up, a creep for the
    # waves of the reducer.
    runner.go(low, fast)
    turns = [runner.samples(runner.go(to, TURN_DEG_S), cruise_only=True) for to in (high, low)]
    moves = [runner.samples(runner.go(to, fast), cruise_only=False) for to in (high, low)]
    start = max(low, -0.5 * CREEP_DEG)
    runner.go(start, fast)
    creep = runner.samples(runner.go(start + CREEP_DEG, CREEP_DEG_S), cruise_only=True)
    parts = (_joined(turns), _joined(moves), creep)
    return MotionRecording(
        *parts,
        instrument=instrument,
        has_ring=machine.plant.load_encoder.fitted or instrument is LoadInstrument.LOAD_ENCODER,
        axis_time_s=runner.time_s,
        trace_sha256=_hash(parts),
    )


def _joined(parts: list[Samples]) -> Samples:
    names = Samples.__dataclass_fields__
    return Samples(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _hash(parts: tuple[Samples, ...]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        for name in Samples.__dataclass_fields__:
            digest.update(np.ascontiguousarray(getattr(part, name)).tobytes())
    return digest.hexdigest()
