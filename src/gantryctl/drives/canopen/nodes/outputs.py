"""Digital outputs of the axis: levels of a scan to words of the drive (60FE) and of an I/O node (6200)."""

from __future__ import annotations

from typing import Final

from gantryctl.drives.canopen.mapping import SET_BRAKE
from gantryctl.drives.canopen.settings import CanopenSettings, OutputBits
from gantryctl.image import OutputImage

# Edges of the watchdog in the time after which its relay opens: one that is late by two scans harms nothing.
_EDGES: Final = 4.0


class Watchdog:
    """Level of the watchdog output: an edge every few scans while the controller is well.

    Args:
        relay_s: time after which the relay opens without an edge.
        period_s: of the scan.
    """

    def __init__(self, relay_s: float, period_s: float) -> None:
        self._every = max(1, int(relay_s / _EDGES / period_s + 1e-9))
        self._left = 0
        self.level = False

    def scan(self, well: bool) -> bool:
        """Level for this scan; it stands still where the controller is not well."""
        # Nothing counts time here: a controller that does not scan makes no edges.
        if well:
            self._left -= 1
            if self._left <= 0:
                self._left, self.level = self._every, not self.level
        return self.level


class OutputWriter:
    """Levels to words.

    Args:
        settings: bits of drive and I/O node, owner of the brake.
    """

    def __init__(self, settings: CanopenSettings) -> None:
        self._drive = settings.outputs
        self._node = OutputBits() if settings.io is None else settings.io.outputs
        self._sets_brake = settings.brake_owner == "object_60FE"
        self._watchdog: Watchdog | None = None
        if self._drive.watchdog is not None or self._node.watchdog is not None:
            self._watchdog = Watchdog(settings.watchdog_s, settings.period_s)
        self.drive_word = SET_BRAKE if self._sets_brake else 0
        """60FE:01."""
        self.node_word = 0
        """6200 of the I/O node."""

    def take(self, output: OutputImage, brake_released: bool, well: bool) -> None:
        """Take the outputs of a scan.

        Args:
            brake_released: the brake is to open.
            well: the drive is heard, and commanded.
        """
        watchdog = self._watchdog is not None and self._watchdog.scan(well)
        levels = (
            brake_released, watchdog, well, output.horn, output.lamp, output.in_position, output.at_rest
        )  # fmt: skip
        self.drive_word = _word(self._drive, levels)
        if self._sets_brake and not brake_released:
            self.drive_word |= SET_BRAKE
        self.node_word = _word(self._node, levels)


def _word(bits: OutputBits, levels: tuple[bool, ...]) -> int:
    """Bits of the outputs that are on, in the order of `OutputBits`."""
    return sum(1 << bit for bit, on in zip(bits, levels, strict=True) if on and bit is not None)
