"""The table of stops per class and speed."""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.engineering.stops.run import StopClass, StopResult, worst_stop
from gantryctl.machine import Machine

REACTION_S: Final = 0.06
"""Time from the cause of a stop to the beginning of the ramp that permitted angles allow for."""

SPEED_PARTS: Final = (0.1, 0.5, 1.0)
"""Speeds that stops are judged at, as parts of the highest one."""


class StopRow(NamedTuple):
    """A stop and what it means.

    Attributes:
        angle_with_reaction_deg: stopping angle with 60 ms of travel before it.
        inspect: the stop is above the ratings of motor or reducer: inspect afterwards.
    """

    stop: StopResult
    angle_with_reaction_deg: float
    inspect: bool


def stop_table(machine: Machine, speeds_deg_s: tuple[float, ...] | None = None) -> list[StopRow]:
    """Every stop class at 1/10, 1/2 and the whole of the highest speed (or at `speeds_deg_s`), worst of four cases."""
    top = machine.speed.setting_max_deg_s
    rows = []
    for stop_class in StopClass:
        for speed in speeds_deg_s or tuple(k * top for k in SPEED_PARTS):
            stop = worst_stop(machine, stop_class, speed)
            above = stop.torque_limited or stop.torque_reducer_nm > machine.reducer.torque_momentary_nm
            rows.append(StopRow(stop, stop.angle_deg + speed * REACTION_S, above))
    return rows
