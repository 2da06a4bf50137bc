"""Electrical cabinet of a virtual axis: what outputs of the controller work, and what that does to the axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_US: Final = 1e6


class Cabinet:
    """Relays and lamps behind outputs of the controller, wherever those outputs are.

    The brake relay gives the brake its current: released while `brake_release` is on. The watchdog relay closes at an
    edge of `watchdog` and opens when none comes for its time; its contacts lie in the safe-torque-off circuit of the
    drive and in the supply of the brake.

    Args:
        watchdog_s: time after which the watchdog relay opens; 0: none is fitted.

    Attributes:
        levels: present level of every output that was ever set, by name.
    """

    def __init__(self, watchdog_s: float = 0.0) -> None:
        self._hold_us = round(watchdog_s * _US)
        self._left_us = 0
        self.welded = False
        """The contact of the watchdog relay stays closed, whatever its coil does."""
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
        """The contact of the watchdog relay is closed; True where none is fitted."""
        return self._left_us > 0 or self.welded or not self._hold_us

    @property
    def watchdog_contact(self) -> bool:
        """What the contact of a watchdog relay shows; False where none is fitted."""
        return self._left_us > 0 or self.welded

    @property
    def brake_released(self) -> bool:
        """The brake relay has current."""
        return self.levels.get("brake_release", False) and self.watchdog_closed
