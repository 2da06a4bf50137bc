"""The brake of a CANopen axis: worked by object 60FE, or by the drive in its own state machine.

A drive that owns its brake closes it in order when it is disabled by "disable operation" (605C = 1: ramp, brake, then
torque off). The program asks for that by taking the brake release back while enabled; the word 07 stays until the drive
has left Operation enabled, or until it has had time enough. DISABLE without that takes the torque off at once.
"""

from __future__ import annotations

from typing import Final

from gantryctl.drives.canopen.cia402 import DISABLE_OPERATION
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.image import DriveRequest, DriveState

_ENABLED: Final = DriveState.OPERATION_ENABLED
_TURNING: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
_RESERVE_S: Final = 0.2


class BrakeControl:
    """Who closes the brake, and how.

    Args:
        settings: owner, closing time, period.
    """

    def __init__(self, settings: CanopenSettings) -> None:
        self._by_60fe = settings.brake_owner == "object_60FE"
        self._most = round((settings.brake_close_s + _RESERVE_S) / settings.period_s)
        self._was_released = False
        self._closing = 0
        self._closed_in_order = False
        self.released = False
        """What 60FE says; always False for a brake of the drive's own."""

    def word(self, word: int, state: DriveState, request: DriveRequest, brake_open: bool) -> int:
        """The controlword, with an orderly way down where the brake is the drive's."""
        if self._by_60fe:
            self.released = brake_open and state in _TURNING
            return word
        if request is not DriveRequest.ENABLE or brake_open:
            self._closed_in_order = False
        if state is not _ENABLED:
            self._was_released, self._closing = False, 0
            return min(word, DISABLE_OPERATION) if self._closed_in_order else word
        if request is DriveRequest.ENABLE:
            self._closing = int(self._was_released and not brake_open) and max(1, self._closing)
            self._was_released = self._was_released or brake_open
        if request is DriveRequest.QUICK_STOP or not 0 < self._closing <= self._most:
            return word
        self._closing += 1
        self._closed_in_order = request is DriveRequest.ENABLE
        return DISABLE_OPERATION

    def is_open(self, state: DriveState, contact: bool | None) -> bool:
        """By its contact; without one, what the drive must have done."""
        if contact is not None:
            return contact
        return self.released if self._by_60fe else state in _TURNING
