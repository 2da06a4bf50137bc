"""Stop of an axis whose program has failed: rest, brake, torque off."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from gantryctl.image import DriveRequest, InputImage, OutputImage

# Motor speed below which the quick stop counts as finished: 0.025 deg/s at the gantry; and how long it must stay
# there.
REST_SPEED_RAD_S: Final = 0.5
REST_TIME_S: Final = 0.05


class StopTimes(NamedTuple):
    """Times of a stop without its program; those of the reference machine, and of anything that is not slower."""

    ramp_s: float = 3.0
    """The brake closes at the latest after this time: twice what a quick stop from full speed takes, and more."""
    brake_s: float = 0.3
    """Time for the brake to close before the torque goes off: twice its closing time."""


REFERENCE_STOP: Final = StopTimes()


def quick_stop_output(brake_open: bool) -> OutputImage:
    """Ask for the drive's own ramp to zero; the brake stays as it was.

    A brake that closes on a turning gantry loads the reducer more than the ramp does.
    """
    return OutputImage(request=DriveRequest.QUICK_STOP, brake_open=brake_open)


class StopProgram:
    """Program in place of a failed one: quick stop, then brake, then torque off; its trace row is NaN.

    It reads only the motor speed, and does not trust it for longer than the ramp may take.
    """

    def __init__(self, brake_open: bool, columns: tuple[str, ...], times: StopTimes) -> None:
        self.trace_columns = columns
        self._times = times
        self._brake_open = brake_open
        self._row = (math.nan,) * len(columns)
        self._begin_s: float | None = None
        self._moving_s = 0.0
        self._closed_s = math.inf

    def scan(self, image: InputImage) -> OutputImage:
        now_s = image.time_s
        if self._begin_s is None:
            self._begin_s = self._moving_s = now_s
        # Written so that NaN counts as moving.
        if not abs(image.drive.vel_act_rad_s) < REST_SPEED_RAD_S:
            self._moving_s = now_s
        rested = now_s - self._moving_s >= REST_TIME_S or now_s - self._begin_s >= self._times.ramp_s
        if rested and self._closed_s == math.inf:
            self._brake_open, self._closed_s = False, now_s
        if now_s - self._closed_s >= self._times.brake_s:
            return OutputImage()
        return quick_stop_output(self._brake_open)

    def trace_row(self) -> tuple[float, ...]:
        return self._row
