"""Stop of an axis whose controller is gone: what the drive's own deadline and ramp add up to."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from gantryctl.engineering.stops.run import StopClass, StopRow, unbraked_stop_deg
from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import permitted_speed_deg_s, silent_speed_max_deg_s


class WatchRow(NamedTuple):
    """Stop of a silent controller's axis by one of the two watches that a drive may have.

    Attributes:
        watch: object of the drive; delay_ms: until it acts.
        angle_deg: way from the last telegram to rest from `speed_deg_s`, on the full plant, and until the brake has
            closed that is not the drive's own.
        speed_max_deg_s: highest speed within the permitted angle with this watch alone (rigid body, to the tenth
            below, of a slow axis to two digits); None where every setting is.
    """

    watch: str
    delay_ms: float
    speed_deg_s: float
    angle_deg: float
    speed_max_deg_s: float | None


def watch_rows(machine: Machine, stops: Iterable[StopRow]) -> tuple[WatchRow, ...]:
    """Both watches at the speeds of a table of stops; () for a machine without a bus."""
    if not machine.on_bus:
        return ()
    watches = {"1400:05": machine.can.rpdo_deadline_ms, "1016": machine.can.lone_heartbeat_ms}
    quick = [
        (row.stop.speed_deg_s, _stop_deg(machine, row))
        for row in stops
        if row.stop.stop_class is StopClass.QUICK
    ]
    return tuple(
        WatchRow(
            watch,
            delay_ms,
            speed,
            angle + speed * delay_ms * 1e-3,
            _ceiling_deg_s(machine, delay_ms),
        )
        for watch, delay_ms in watches.items()
        for speed, angle in quick
    )


def _stop_deg(machine: Machine, row: StopRow) -> float:
    if machine.brake.owner == "drive":
        return row.stop.angle_deg
    # The motor may come back a little behind its brake, never by what its ramp has taken.
    return max(row.stop.angle_deg, unbraked_stop_deg(machine, row.stop.speed_deg_s))


def _ceiling_deg_s(machine: Machine, delay_ms: float) -> float | None:
    fastest = silent_speed_max_deg_s(machine, delay_ms)
    return None if fastest >= machine.speed.setting_max_deg_s else permitted_speed_deg_s(fastest)
