"""Limits of the invariants, at the gantry, on the true motor side, each with its reason."""

from __future__ import annotations

from enum import Enum
from typing import Final


class StopClass(Enum):
    """Class of a stop: which way and time it may take."""

    QUICK = "quick stop"
    TORQUE_OFF = "torque off and brake"
    FEEDBACK = "torque off and brake after a fault of the feedback"
    SILENCE = "drive and outputs by themselves after the last command"


# deg of way from the fault to rest at 1, 3 and 6 deg/s. Quick: 0.06 s of reaction, the stop computed on the full
# plant, and 2 %. Torque off and feedback are the worst of seeded runs, rounded up (fault catalogue, recomputed limits).
# Silence: torque off and brake 0.2 s later, the longest that a watchdog or a heartbeat of these tests waits.
_WAYS_DEG: Final = {
    StopClass.QUICK: (0.16, 1.04, 3.75),
    StopClass.TORQUE_OFF: (0.45, 1.4, 3.6),
    StopClass.FEEDBACK: (0.8, 2.1, 4.5),
    StopClass.SILENCE: (0.65, 2.0, 4.8),
}
# deg, for a fault at standstill or at the first motion, whatever its class.
_FROM_REST_DEG: Final = 0.35
REST_S: Final = {
    StopClass.QUICK: 1.5,
    StopClass.TORQUE_OFF: 1.5,
    StopClass.FEEDBACK: 1.6,
    StopClass.SILENCE: 1.7,
}
"""From the alarm to rest: 1.2 and 1.1 s from 6 deg/s, and the 50 kN m of the check moment with the 50 ms of a rest
that lasts; silence has no alarm, and is noticed 0.2 s after the last command at the latest."""
SILENT_MS: Final = 20
"""No command for so long is a controller that commands no more: the longest scan takes 10 ms."""
BRAKE_BEGINS_S: Final = 0.15
"""A brake that closes by itself has its torque this long after it began to close (fault catalogue C5)."""

SAG_DEG: Final = 0.15
"""Motion without a reason, in total: the brake that slips and is caught (C4)."""
TOLD_DEG: Final = 0.05
"""Every angle that is told."""
TOLD_WRONG_S: Final = 0.1
"""So long may an angle be wrong before it is called not valid: an alarm is told within 100 ms."""
BRAKE_CLOSES_S: Final = 0.2
"""Dead time of the brake by its specification."""
BEYOND_DEG: Final = 4.5
"""So far beyond over-travel, or into a no-go sector, a stop of a fault may end: its largest way, from 6 deg/s."""
OVERSPEED: Final = 1.1
"""Part of the highest speed setting that the true speed never passes without a fault of the feedback."""
FAULT_OVERSPEED_DEG_S: Final = 1.2
"""What a fault of the feedback may add before the torque is off."""
REST_DEG_S: Final = 0.05
"""Slower is no motion: a tenth of what the load swings with after a quick stop."""


def way_deg(kind: StopClass, speed_deg_s: float) -> float:
    """Permitted way from the fault to rest, deg; between the speeds of the table by the way per speed."""
    speed = abs(speed_deg_s)
    low, middle, high = (way / at for way, at in zip(_WAYS_DEG[kind], (1.0, 3.0, 6.0), strict=True))
    if speed <= 3.0:
        share = low + (middle - low) * max(0.0, speed - 1.0) / 2.0
    else:
        share = middle + (high - middle) * (speed - 3.0) / 3.0
    return max(_FROM_REST_DEG, share * speed)
