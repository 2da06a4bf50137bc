"""Pictures of a step as data: they lie in the results, so that a report shows what was seen on another day."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

# Enough for any print; a turn of four minutes has 60 000 scans.
POINTS: Final = 300
_DIGITS: Final = 6


@dataclass(frozen=True)
class Line:
    """One curve."""

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]


@dataclass(frozen=True)
class Panel:
    """Curves over one another.

    Attributes:
        limits: levels that are drawn as limits.
    """

    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    limits: tuple[float, ...] = ()


@dataclass(frozen=True)
class Picture:
    """Panels side by side."""

    title: str
    panels: tuple[Panel, ...]


class MotionSample(NamedTuple):
    """The axis in one scan: speed commanded and as the drive says, way, torque of the motor; NaN where unknown."""

    time_s: float
    ref_deg_s: float
    act_deg_s: float
    way_deg: float
    torque_nm: float


def line(name: str, x: ArrayLike, y: ArrayLike) -> Line:
    """A curve of at most `POINTS` points, without what is not finite."""
    xs, ys = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    known = np.isfinite(xs) & np.isfinite(ys)
    xs, ys = xs[known], ys[known]
    if len(xs) > POINTS:
        kept = np.unique(np.linspace(0, len(xs) - 1, POINTS).round().astype(int))
        xs, ys = xs[kept], ys[kept]
    return Line(name, _short(xs.tolist()), _short(ys.tolist()))


def _short(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(f"{value:.{_DIGITS}g}") for value in values)


def motion_picture(title: str, samples: Sequence[MotionSample]) -> Picture | None:
    """Speed, way and, where it is known, torque over the time; None of an axis that did nothing."""
    if len(samples) < 2:
        return None
    time_s, ref, act, way, torque = zip(*samples, strict=True)
    panels = [
        Panel("time, s", "speed, deg/s", (line("commanded", time_s, ref), line("drive", time_s, act))),
        Panel("time, s", "way, deg", (line("motor side", time_s, way),)),
    ]
    if any(math.isfinite(value) for value in torque):
        panels.append(Panel("time, s", "torque, N m", (line("motor", time_s, torque),)))
    return Picture(title, tuple(panels))
