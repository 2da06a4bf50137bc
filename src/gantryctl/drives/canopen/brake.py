"""Brake control of a CANopen axis: by an output, or by the state machine of a drive that owns its brake."""

from __future__ import annotations

from typing import Final

from gantryctl.drives.canopen.cia402 import DISABLE_OPERATION, TURNING
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.image import DriveRequest, DriveState

_ENABLED: Final = DriveState.OPERATION_ENABLED
# Beyond the closing time of the machine file; after that the torque goes off whether the drive has followed or not, and
# the program tells people so (DRV-03).
_RESERVE_S: Final = 0.2


class BrakeControl:
    """Close and release the brake, whoever owns it.

    A drive that owns its brake closes it in order when it is disabled by "disable operation". The program asks for
    that by withdrawing the brake release while enabled. DISABLE without that takes the torque off at once, and so does
    DISABLE with `at_once` on the way down: a ramp on a reading of the wrong sign has no end.

    Args:
        settings: owner, closing time, period.
    """

    def __init__(self, settings: CanopenSettings) -> None:
        self._by_output = settings.brake_owner != "drive"
        self._most = round((settings.brake_close_s + _RESERVE_S) / settings.period_s)
        self._close = round(settings.brake_close_s / settings.period_s)
        self._was_released = False
        self._closing = self._close if self._by_output else 0
        self._closed_in_order = False
        self.released = False
        """Release command for the output; always False for a brake that the drive owns."""

    def word(
        self, word: int, state: DriveState, request: DriveRequest, brake_open: bool, *, at_once: bool = False
    ) -> int:
        """Controlword with an orderly way down where the drive owns the brake, unless the torque goes at once."""
        if self._by_output:
            self.released = brake_open and state in TURNING
            self._closing = 0 if self.released else self._closing + 1
            return word
        if request is not DriveRequest.ENABLE or brake_open:
            self._closed_in_order = False
        if at_once:
            self._closing = 0
        if state is not _ENABLED:
            self._was_released, self._closing = False, 0
            return min(word, DISABLE_OPERATION) if self._closed_in_order else word
        if request is DriveRequest.ENABLE:
            self._closing = int(self._was_released and not brake_open) and max(1, self._closing)
            self._was_released = self._was_released or brake_open
        # 605C = 1: ramp, brake, then torque off (decision 0012). The word 07 stays until the drive has left Operation
        # enabled, or for as long as that may take; a quick stop has precedence.
        if request is DriveRequest.QUICK_STOP or not 0 < self._closing <= self._most:
            return word
        self._closing += 1
        self._closed_in_order = request is DriveRequest.ENABLE
        return DISABLE_OPERATION

    def is_open(self, state: DriveState, contact: bool | None) -> bool:
        """State of the brake contact; without one, what the brake must have done by its closing time."""
        if contact is not None:
            return contact
        return self._closing < self._close if self._by_output else state in TURNING
