"""Picture of a motion: it lies in the results, so that a report shows what was seen on another day."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from gantryctl.engineering.report.pictures import Line, Panel, Picture, line

# Enough for a panel of a third of the page; all curves of a commissioning stay below a megabyte.
POINTS: Final = 600


class MotionSample(NamedTuple):
    """The axis in one scan: speed commanded and as the drive says, way, torque of the motor; NaN where unknown."""

    time_s: float
    ref_deg_s: float
    act_deg_s: float
    way_deg: float
    torque_nm: float


def motion_picture(title: str, samples: Sequence[MotionSample]) -> Picture | None:
    """Speed, way and, where it is known, torque over the time; None of an axis that did nothing."""
    if len(samples) < 2:
        return None
    time_s, ref, act, way, torque = zip(*samples, strict=True)
    panels = [
        Panel(
            "time, s",
            "speed, deg/s",
            (_line("commanded", time_s, ref), _line("drive", time_s, act)),
            followed=True,
        ),
        Panel("time, s", "way, deg", (_line("motor side", time_s, way),)),
    ]
    if any(math.isfinite(value) for value in torque):
        panels.append(Panel("time, s", "torque, N m", (_line("motor", time_s, torque),)))
    return Picture(title, tuple(panels))


def _line(name: str, time_s: Sequence[float], values: Sequence[float]) -> Line:
    return line(name, time_s, values, POINTS)
