"""Stop of an axis whose program has failed: rest, brake, torque off."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from gantryctl.image import DriveRequest, DriveState, InputImage, OutputImage

# Motor speed below which the quick stop counts as finished: 0.025 deg/s at the gantry; and how long it must stay
# there.
REST_SPEED_RAD_S: Final = 0.5
REST_TIME_S: Final = 0.05
# Torque that drives the load which it is to hold (a wrong sign) is taken off; the load swings slower than this, 0.25
# deg/s at the gantry, or not so long.
DRIVEN_SPEED_RAD_S: Final = 5.0
DRIVEN_TIME_S: Final = 0.05
_ENABLED: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
# On their way up to torque.
_RISING: Final = (DriveState.SWITCH_ON_DISABLED, DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON)


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


def stop_output(last: OutputImage) -> OutputImage:
    """What a drive is told behind a program that has failed, by what it was told last.

    Torque that alone holds the load goes on, at zero speed: behind a quick stop it would go off, and the load would
    fall through a brake that is known not to hold it.
    """
    if last.torque_holds and last.request in (DriveRequest.ENABLE, DriveRequest.QUICK_STOP):
        return last._replace(vel_cmd_rad_s=0.0, brake_open=False, lamp=True, in_position=False, at_rest=False)
    return quick_stop_output(last.brake_open)


class StopProgram:
    """Program in place of a failed one: quick stop, then brake, then torque off; its trace row is NaN.

    It reads only the motor speed, and does not trust it for longer than the ramp may take. Where torque alone holds the
    load it holds it on, as long as the drive gives it: a drive in fault, or one that was disabled, is left to the
    brake, and so is a load that the torque drives.

    Args:
        begun: what the drive was told as the program failed, of `stop_output`.

    Attributes:
        holding: the torque goes on.
    """

    def __init__(self, begun: OutputImage, columns: tuple[str, ...], times: StopTimes) -> None:
        self.trace_columns = columns
        self._times = times
        self.holding = begun.torque_holds
        self._hold, self._has_held = begun, False
        self._driven_s, self._speed_before = math.inf, 0.0
        self._brake_open = begun.brake_open
        self._row = (math.nan,) * len(columns)
        self._begin_s: float | None = None
        self._moving_s = 0.0
        self._closed_s = math.inf

    def scan(self, image: InputImage) -> OutputImage:
        now_s = image.time_s
        if self._begin_s is None:
            self._begin_s = self._moving_s = now_s
        if self._hold.torque_holds:
            self.holding = self.holding and self._holds(image, now_s)
            return self._hold if self.holding else OutputImage(horn=self._hold.horn)
        # Written so that NaN counts as moving.
        if not abs(image.drive.vel_act_rad_s) < REST_SPEED_RAD_S:
            self._moving_s = now_s
        rested = now_s - self._moving_s >= REST_TIME_S or now_s - self._begin_s >= self._times.ramp_s
        if rested and self._closed_s == math.inf:
            self._brake_open, self._closed_s = False, now_s
        if now_s - self._closed_s >= self._times.brake_s:
            return OutputImage()
        return quick_stop_output(self._brake_open)

    def _holds(self, image: InputImage, now_s: float) -> bool:
        """Whether the drive gives the torque, or is coming to it, and the torque does not drive the load."""
        drive = image.drive
        assert self._begin_s is not None
        # Telegrams that are missing are no word of the drive, as in HOLD.
        if drive.state is DriveState.UNKNOWN:
            return True
        if drive.state not in _ENABLED:
            rises = drive.state in _RISING and not self._has_held
            return rises and now_s - self._begin_s < self._times.ramp_s
        self._has_held = True
        speed = abs(drive.vel_act_rad_s)
        drives = drive.torque_act_nm * drive.vel_act_rad_s > 0.0
        if not (drives and speed > DRIVEN_SPEED_RAD_S and speed >= self._speed_before):
            self._driven_s = now_s
        self._speed_before = speed
        return now_s - min(self._driven_s, now_s) < DRIVEN_TIME_S

    def trace_row(self) -> tuple[float, ...]:
        return self._row
