"""Stop of an axis whose controller is gone: what the drive's own deadline and ramp add up to."""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.engineering.stops.run import StopClass, worst_stop
from gantryctl.machine import Machine

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
