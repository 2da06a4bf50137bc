"""Whether the calibration still fits the machine: what the moves show against what the calibration says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from gantryctl.program.monitors.flank_swing import FlankSwing
from gantryctl.program.monitors.running_fit import Fitted, RunningFit
from gantryctl.program.settings import CalibrationWatchSettings

# Torque is averaged over this, a twentieth of a swing of the load: less says the same more often.
_SAMPLE_S: Final = 0.020
# The sums take every fifth of them.
_FIFTH: Final = 5
# Torques within half a swing say the same once, 0.25 s on the reference gantry.
_ALIKE_SWINGS: Final = 0.5
_ALIKE_S: Final = 0.25
# Time in motion over which what was seen fades: some 60 moves of 20 s.
_MEMORY_S: Final = 1200.0
# The same in changes of the flank, of which a move has about one; fewer than the least say nothing.
_EVENTS: Final = 40
_EVENTS_MIN: Final = 10
# The gap of the gears follows their temperature, 5 K are 0.095 mm: what a session shows may be its morning (0.089 of
# 0.05 mm by ten changes, within 0.004 of each other). It is judged when so much of the memory is full, after 40 moves.
_A_DAY: Final = 0.68
# Two minutes of motion, some moves each way: before, moment and friction are one number. What a short first move fits,
# 200 kN m, is not the load that friction grows with: its 20 kN m of friction would stay in the sums for 20 minutes.
_FIRST_MOVES: Final = 0.1
# A finding lies so many standard deviations beyond its bound: 3.4 in a million for a machine that stands at its bound.
_SURE: Final = 4.5
_TORQUE_MAX_NM: Final = 1e12
_ANGLE_MAX_RAD: Final = 1.0

NAMES: Final = ("moment", "friction", "backlash", "lost_motion", "scale")
"""What of a calibration may no longer fit."""


class Finding(NamedTuple):
    """What was measured, and its bound: N m at the axis for moment and friction, rad for the others."""

    measured: float
    bound: float


class CalibrationWatch:
    """Least squares over what the calibration leaves of torque and load-side angle, and the swing after the gears
    have changed their flank (docs/explanation/compensation.md, "When a calibration no longer fits").

        i T - known = dMs sin x + dMc cos x + z dF                          torque in motion
        load-side angle - motor and maps = a + s sin x + c cos x + f l/2    at constant speed, f the flank of the gears
        backlash of each change of the flank                                 `flank_swing`

    Constant work: a sum in each scan, some products every 20 ms of motion, small equations at the end of a move.

    Args:
        ratio: motor turns per turn of the axis.
        load_side: the load-side encoder is read.

    Attributes:
        found: what no longer fits, by its name in `NAMES`, with what was measured when it was found; it stays until
            there is another calibration.
        seen: the same for everything that is watched, as the last move left it.
    """

    __slots__ = (
        "_block", "_gap", "_half", "_mid", "_moment", "_moving", "_ratio", "_ring", "_samples", "_scans", "_sum",
        "_swing", "_torque", "_watches_ring", "found", "seen", "settings",
    )  # fmt: skip

    def __init__(
        self, settings: CalibrationWatchSettings, period_s: float, ratio: float, *, load_side: bool = False
    ) -> None:
        self.settings, self._ratio, self._watches_ring = settings, ratio, load_side
        self._block = max(1, round(_SAMPLE_S / period_s))
        self._half = (self._block + 1) // 2
        sample_s = self._block * period_s
        windup = settings.windup_per_acc_s2
        alike_s = _ALIKE_SWINGS * 2.0 * math.pi * math.sqrt(windup) if windup > 0.0 else _ALIKE_S
        taken_s = _FIFTH * sample_s
        alike, kept = max(1.0, alike_s / taken_s), math.exp(-taken_s / _MEMORY_S)
        ridge = (settings.residual_nm / settings.torque_spread_nm) ** 2
        self._torque = RunningFit(3, ridge, kept, alike)
        self._ring = RunningFit(4, 0.0, kept, alike)
        self._swing = (
            FlankSwing(settings.inertia_load_kg_m2, windup, settings.flank_nm, sample_s)
            if windup > 0.0 and math.isfinite(settings.backlash_bound_rad)
            else None
        )
        self._gap = _Running()
        self._moment = (settings.moment_sine_nm, settings.moment_cosine_nm)
        self.found: dict[str, Finding] = {}
        self.seen: dict[str, Finding] = {}
        self._mid = (0.0, 0.0, 0.0)
        self._moving, self._sum, self._scans, self._samples = False, 0.0, 0, 0

    def scan(
        self,
        pos_rad: float,
        vel_rad_s: float,
        acc_rad_s2: float,
        torque_nm: float,
        apart_rad: float,
        followed_rad: float = 0.0,
    ) -> None:
        """Take a scan of an axis whose set-point moves.

        Args:
            pos_rad, vel_rad_s, acc_rad_s2: set-point. torque_nm: of the motor.
            apart_rad: load-side encoder minus the angle by motor encoder and maps.
            followed_rad: what of the backlash the maps have followed since the calibration.
        """
        self._moving = True
        self._sum += torque_nm
        self._scans += 1
        if self._scans == self._half:
            self._mid = (pos_rad, vel_rad_s, acc_rad_s2)
        if self._scans == self._block:
            torque, self._sum, self._scans = self._sum / self._block, 0.0, 0
            self._sample(torque, apart_rad, followed_rad)

    def rest(self) -> bool:
        """Take a scan at rest; whether a move has just ended and something no longer fits."""
        if not self._moving:
            return False
        self._judge()
        return bool(self.found)

    def _sample(self, torque_nm: float, apart_rad: float, followed_rad: float) -> None:
        (pos, vel, acc), cal = self._mid, self.settings
        if not abs(vel) > cal.speed_min_rad_s:
            if self._swing is not None:
                self._swing.abandon()
            return
        sine, cosine, z = math.sin(pos), math.cos(pos), math.copysign(1.0, vel)
        now = self._moment[0] * sine + self._moment[1] * cosine
        friction = cal.friction_nm + cal.friction_load_ratio * abs(now + cal.inertia_kg_m2 * acc)
        left = (
            self._ratio * torque_nm
            - now
            - cal.inertia_kg_m2 * acc
            - cal.friction_nm_s_per_rad * vel
            - z * friction
        )
        if not abs(left) < _TORQUE_MAX_NM:  # NaN says nothing
            return
        mesh = now + z * cal.friction_load_nm + cal.inertia_load_kg_m2 * acc
        self._samples += 1
        if self._samples == _FIFTH:
            self._samples = 0
            calibrated = cal.moment_sine_nm * sine + cal.moment_cosine_nm * cosine
            self._torque.add((sine, cosine, z), left + now - calibrated)
            if (
                self._watches_ring
                and acc == 0.0
                and abs(mesh) > cal.flank_nm
                and abs(apart_rad) < _ANGLE_MAX_RAD
            ):
                flank = math.copysign(1.0, mesh)
                # Judged is what the gap has become since the calibration, not what the laws have left of it.
                self._ring.add((1.0, sine, cosine, flank), apart_rad - 0.5 * followed_rad * flank)
        if self._swing is not None:
            gap = self._swing.sample(acc, mesh, left)
            if gap is not None:
                self._gap.add(gap)

    def _judge(self) -> None:
        """Judge at the end of a move."""
        cal = self.settings
        self._moving, self._sum, self._scans = False, 0.0, 0
        if self._swing is not None:
            self._swing.abandon()
        if self._torque.filled < _FIRST_MOVES:
            return
        torque = self._torque.solved()
        if torque is not None:
            sine, cosine, friction = torque.values
            self._moment = (cal.moment_sine_nm + sine, cal.moment_cosine_nm + cosine)
            size, sure = _size(torque, 0)
            self._weigh("moment", size, cal.moment_bound_nm, sure)
            self._weigh("friction", friction, cal.friction_bound_nm, torque.deviations[2])
        a_day = self._torque.filled > _A_DAY
        if a_day and self._gap.count >= _EVENTS_MIN:
            self._weigh("backlash", self._gap.mean, cal.backlash_bound_rad, self._gap.deviation)
        ring = self._ring.solved() if self._watches_ring else None
        if ring is not None:
            size, sure = _size(ring, 1)
            self._weigh("scale", size, cal.scale_bound_rad, sure)
            if a_day:
                self._weigh(
                    "lost_motion", 2.0 * ring.values[3], cal.lost_motion_bound_rad, 2.0 * ring.deviations[3]
                )

    def _weigh(self, name: str, measured: float, bound: float, deviation: float) -> None:
        self.seen[name] = Finding(measured, bound)
        if abs(measured) > bound + _SURE * deviation and name not in self.found:
            self.found[name] = Finding(measured, bound)

    @property
    def memory(self) -> dict[str, object]:
        """What is to be retained, as plain JSON values."""
        return {
            "calibration": self.settings.identity,
            "torque": list(self._torque.sums),
            "ring": list(self._ring.sums),
            "gap": [self._gap.count, self._gap.mean, self._gap.variance],
            "found": {name: list(finding) for name, finding in self.found.items()},
        }

    def restore(self, memory: Mapping[str, object]) -> None:
        """Go on from what was retained; what belongs to another calibration, or is no such memory, changes nothing."""
        torque, ring, gap = (_numbers(memory.get(name)) for name in ("torque", "ring", "gap"))
        kept = memory.get("found")
        if memory.get("calibration") != self.settings.identity or not isinstance(kept, dict) or len(gap) != 3:
            return
        found = {name: _numbers(kept[name]) for name in NAMES if name in kept}
        sound = (
            len(found) == len(kept)
            and all(len(pair) == 2 for pair in found.values())
            and gap[0] >= 0.0
            and gap[2] >= 0.0
            and self._torque.fits(torque)
            and self._ring.fits(ring)
        )
        if sound:
            self._torque.restore(torque)
            self._ring.restore(ring)
            self._gap.count, self._gap.mean, self._gap.variance = int(gap[0]), gap[1], gap[2]
            self.found = {name: Finding(*pair) for name, pair in found.items()}


class _Running:
    """Mean and variance of values, of which the last `_EVENTS` count most."""

    __slots__ = ("count", "mean", "variance")

    def __init__(self) -> None:
        self.count, self.mean, self.variance = 0, 0.0, 0.0

    def add(self, value: float) -> None:
        self.count += 1
        share = max(1.0 / self.count, 1.0 / _EVENTS)
        step = value - self.mean
        self.mean += share * step
        self.variance = (1.0 - share) * (self.variance + share * step * step)

    @property
    def deviation(self) -> float:
        """Standard deviation of the mean."""
        # A mean that forgets with 1/n rests on 2n - 1 values.
        return math.sqrt(self.variance / min(self.count - 1, 2 * _EVENTS - 1))


def _size(fitted: Fitted, first: int) -> tuple[float, float]:
    """Size of a sine and cosine, and its standard deviation at most."""
    sine, cosine = fitted.values[first : first + 2]
    return math.hypot(sine, cosine), max(fitted.deviations[first : first + 2])


def _numbers(value: object) -> list[float]:
    """Finite numbers; none for anything else."""
    if not isinstance(value, list):
        return []
    kept = [float(x) for x in value if isinstance(x, int | float) and math.isfinite(x)]
    return kept if len(kept) == len(value) else []
