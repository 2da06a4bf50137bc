"""Stops of a held key (hold-to-run) of which nothing comes any more: the lease passes at full speed before the ramp."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gantryctl.engineering.stops.run import StopClass, StopRow
from gantryctl.machine import Machine


class KeyRow(NamedTuple):
    """The way from the last status frame that the person saw.

    Attributes:
        angle_deg, time_s: until the motor stands.
    """

    speed_deg_s: float
    angle_deg: float
    time_s: float


def key_rows(machine: Machine, rows: Sequence[StopRow]) -> tuple[KeyRow, ...]:
    """Lease and jog-release ramp from each speed of a table of stops."""
    lease_s = machine.monitors.lease_ms * 1e-3
    return tuple(
        KeyRow(stop.speed_deg_s, stop.angle_deg + lease_s * stop.speed_deg_s, stop.time_s + lease_s)
        for stop in (row.stop for row in rows)
        if stop.stop_class is StopClass.JOG_RELEASE
    )
