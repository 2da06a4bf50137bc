"""Electrical cabinet of a virtual axis: what outputs of the controller work, and what that does to the axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_US: Final = 1e6


class Cabinet:
    """Relays and lamps behind outputs of the controller, wherever those outputs are.

    The brake relay gives the brake its current: released while `brake_release` is on. The watchdog relay closes at an
    edge of `watchdog` and opens when none comes for its time; the enable relay is closed while `drive_enable` is on.
    The contacts of either lie in the safe-torque-off circuit of the drive and in the supply of the brake.

    Args:
        watchdog_s: time after which the watchdog relay opens; 0: none is fitted.
        enable_relay: an enable relay is fitted.

    Attributes:
        levels: present level of every output that was ever set, by name.
    """

    def __init__(self, watchdog_s: float = 0.0, *, enable_relay: bool = False) -> None:
        self._hold_us, self._enable_relay = round(watchdog_s * _US), enable_relay
        self._left_us = 0
        self.welded = False
        """The contact of the watchdog or enable relay stays closed, whatever its coil does."""
        self.levels: dict[str, bool] = {}

    def take(self, outputs: Mapping[str, bool]) -> None:
        """Take levels of outputs by name."""
        before, after = self.levels.get("watchdog"), outputs.get("watchdog")
        if after is not None and before is not None and after is not before:
            self._left_us = self._hold_us
        self.levels.update(outputs)

    def advance(self, us: int) -> None:
        """Let time go on."""
        self._left_us = max(0, self._left_us - us)

    @property
    def watchdog_closed(self) -> bool:
        """The contact of watchdog or enable relay is closed; True where neither is fitted."""
        return self.watchdog_contact or not (self._hold_us or self._enable_relay)

    @property
    def watchdog_contact(self) -> bool:
        """What the contact of a watchdog or enable relay shows; False where neither is fitted."""
        return self._left_us > 0 or self.welded or self.levels.get("drive_enable", False)

    @property
    def brake_released(self) -> bool:
        """The brake relay has current."""
        return self.levels.get("brake_release", False) and self.watchdog_closed
