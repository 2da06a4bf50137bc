"""Recorded motion of an axis, and the steady stretches of it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.identification.experiment import Experiment
from gantryctl.units import rad

Floats = NDArray[np.float64]

# Of the creep: slower than this the axis stands.
_MOVES_SHARE: Final = 0.5
# What the model does not know lasts: a gust of wind some 10 s (100 m at 10 m/s), a wave of the gear part of a turn.
_TOGETHER_S: Final = 30.0
_TOGETHER_SHARE: Final = 1.0 / 12.0


class MoveLog(NamedTuple):
    """One move with its settling, a row a scan, at the gantry, SI.

    Attributes:
        act_rad: by the motor encoder. load_rad: by the instrument; NaN where it gave no reading.
        ring_rad: by the load-side encoder. vel_rad_s, acc_rad_s2: of the set-point. torque_nm: of the motor.
        block: scans that are averaged to one sample.
        uncertainty_rad: standard uncertainty of the least certain reading of the instrument.
    """

    period_s: float
    act_rad: Floats
    load_rad: Floats
    ring_rad: Floats
    vel_rad_s: Floats
    acc_rad_s2: Floats
    torque_nm: Floats
    block: int
    uncertainty_rad: float


@dataclass(frozen=True)
class Samples:
    """Steady stretches of motion; each sample the mean over a block of scans, at the gantry, SI.

    Angles, speed and acceleration are means over the scans of the block with a reading of the instrument, the torque
    over all of them.

    Attributes:
        act_rad: by the motor encoder. load_rad: by the instrument. ring_rad: by the load-side encoder.
        vel_rad_s, acc_rad_s2: of the set-point. torque_nm: of the motor.
        stretch: number of the piece of time that a sample belongs to; what disturbs one disturbs its neighbours.
    """

    act_rad: Floats
    load_rad: Floats
    ring_rad: Floats
    vel_rad_s: Floats
    acc_rad_s2: Floats
    torque_nm: Floats
    stretch: Floats

    # Kept: fits evaluate their model of the samples again and again.
    @cached_property
    def direction(self) -> Floats:
        """+1 or -1."""
        return np.sign(self.vel_rad_s)

    @cached_property
    def sine(self) -> Floats:
        """Of the angle by the motor encoder."""
        return np.asarray(np.sin(self.act_rad))

    @cached_property
    def cosine(self) -> Floats:
        """Of the angle by the motor encoder."""
        return np.asarray(np.cos(self.act_rad))

    def where(self, chosen: NDArray[np.bool_]) -> Samples:
        """These samples only."""
        return Samples(**{name: getattr(self, name)[chosen] for name in _NAMES})


_NAMES: Final = tuple(Samples.__dataclass_fields__)
_MEASURED: Final = tuple(name for name in _NAMES if name != "stretch")


def steady(log: MoveLog, experiment: Experiment, *, cruise_only: bool) -> Samples:
    """The stretches of a log at constant speed, or at constant acceleration as well."""
    vel, acc = log.vel_rad_s, log.acc_rad_s2
    even = np.abs(np.diff(acc, prepend=acc[0])) < 1e-12
    # The swing of the load dies out; what is left belongs to maps and wind-up.
    skip = round(experiment.transient_s / log.period_s)
    since = np.arange(len(vel)) - np.maximum.accumulate(np.where(even, 0, np.arange(len(vel))))
    keep = even & (since > skip) & (np.abs(vel) > _MOVES_SHARE * rad(experiment.creep_deg_s))
    if cruise_only:
        keep &= np.abs(acc) < 1e-9
    chosen, block = np.flatnonzero(keep), log.block
    rows = chosen[: len(chosen) // block * block].reshape(-1, block)
    rows = rows[rows[:, -1] - rows[:, 0] == block - 1]
    read = np.isfinite(log.load_rad[rows])
    rows, read = rows[read.any(axis=1)], read[read.any(axis=1)]
    count = read.sum(axis=1)

    def mean(values: Floats) -> Floats:
        return np.asarray(np.where(read, values[rows], 0.0).sum(axis=1) / count)

    return Samples(
        act_rad=mean(log.act_rad),
        load_rad=mean(log.load_rad),
        ring_rad=mean(log.ring_rad),
        vel_rad_s=mean(vel),
        acc_rad_s2=mean(acc),
        torque_nm=np.asarray(log.torque_nm[rows].mean(axis=1)),
        stretch=np.asarray(rows[:, 0] // round(_together_s(experiment) / log.period_s), dtype=np.float64),
    )


def _together_s(experiment: Experiment) -> float:
    turn_s = (experiment.high_deg - experiment.low_deg) / experiment.turn_deg_s
    return min(_TOGETHER_S, _TOGETHER_SHARE * turn_s)


def joined(parts: Sequence[Samples]) -> Samples:
    """One after the other; stretches of two parts are never the same."""
    numbered = [replace(part, stretch=_numbers_from(1e6 * k, part.stretch)) for k, part in enumerate(parts)]
    return Samples(**{name: np.concatenate([getattr(part, name) for part in numbered]) for name in _NAMES})


def _numbers_from(first: float, stretch: Floats) -> Floats:
    return np.asarray(first + np.unique(stretch, return_inverse=True)[1], dtype=np.float64)


def hash_of(parts: Sequence[Samples]) -> str:
    """SHA-256 of the samples, 64 hexadecimal digits."""
    digest = hashlib.sha256()
    for part in parts:
        for name in _MEASURED:
            digest.update(np.ascontiguousarray(getattr(part, name)).tobytes())
    return digest.hexdigest()
