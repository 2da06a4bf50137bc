"""Stop of an axis whose controller is gone: what the drive's own deadline and ramp add up to."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

from gantryctl.engineering.stops.run import StopClass, StopRow, worst_stop
from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import silent_speed_max_deg_s

# The drive looks at its deadline once a tick, and its ramp begins with the next one.
_TICKS: Final = 2.0


class SilentStop(NamedTuple):
    """Way from the last telegram of a controller to rest.

    Attributes:
        deadline_s: without an RPDO for this long the drive stops the axis (1400:05); it runs from the last one on.
        tick_s: added by the drive's clock: the deadline is seen at the end of a tick, the ramp begins with the next.
        reaction_deg: way at the speed of the last command until the ramp begins.
        stop_deg: the quick stop from that speed on the full plant, with the eccentric moment of the check.
    """

    deadline_s: float
    tick_s: float
    reaction_deg: float
    stop_deg: float

    @property
    def angle_deg(self) -> float:
        """The whole way."""
        return self.reaction_deg + self.stop_deg


def silent_stop(machine: Machine, speed_deg_s: float, drive_tick_s: float) -> SilentStop:
    """The stop of the axis of a dead controller, counted from its last telegram.

    What does not enter, and why: the scan period, because a controller that dies between two telegrams has sent its
    last one before, so that the way from its death is the shorter one; the phase of SYNC, because the deadline runs
    from the reception, whether or not the telegram has taken effect; and a command in flight, as long as
    `speed_deg_s` is the larger of speed and last speed command: an axis that speeds up reaches that and no more.
    Both are above the speed setting while the load swings (6.05 and 6.06 deg/s of 6 half a second after a ramp of
    2 deg/s2, measured over UDP): by v^2 / 2a that is 0.06 deg more.

    Args:
        speed_deg_s: the larger of the speed at the last telegram and of the speed that it commands.
        drive_tick_s: period of the drive's supervision, 1 ms for the virtual one.
    """
    deadline_s, tick_s = machine.can.rpdo_deadline_ms * 1e-3, _TICKS * drive_tick_s
    speed = abs(speed_deg_s)
    stop = worst_stop(machine, StopClass.QUICK, speed)
    return SilentStop(deadline_s, tick_s, speed * (deadline_s + tick_s), stop.angle_deg)


class WatchRow(NamedTuple):
    """Stop of a silent controller's axis by one of the two watches that a drive may have.

    Attributes:
        watch: object of the drive; delay_ms: until it acts.
        angle_deg: way from the last telegram to rest from `speed_deg_s`, on the full plant.
        speed_max_deg_s: highest speed within the permitted angle with this watch alone (rigid body, to the tenth
            below); None where every setting is.
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
    quick = [row.stop for row in stops if row.stop.stop_class is StopClass.QUICK]
    return tuple(
        WatchRow(
            watch,
            delay_ms,
            stop.speed_deg_s,
            stop.angle_deg + stop.speed_deg_s * delay_ms * 1e-3,
            _ceiling_deg_s(machine, delay_ms),
        )
        for watch, delay_ms in watches.items()
        for stop in quick
    )


def _ceiling_deg_s(machine: Machine, delay_ms: float) -> float | None:
    fastest = silent_speed_max_deg_s(machine, delay_ms)
    return None if fastest >= machine.speed.setting_max_deg_s else math.floor(10.0 * fastest) / 10.0
