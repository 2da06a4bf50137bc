"""Frames that an interface of SocketCAN has counted, those included that a filter keeps from this process."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final, NamedTuple

_SYSTEM: Final = Path("/sys/class/net")
_LONGEST: Final = 32


class Counted(NamedTuple):
    """Data frames and their data bytes since the interface was made."""

    frames: int
    data_bytes: int


class InterfaceCounters:
    """Statistics of a network interface (Linux, sysfs), read without waiting.

    Args:
        channel: name of the interface, for example can0.
        root: folder of the interfaces.

    Attributes:
        counts_own: frames of this computer are counted as received, too: a virtual interface gives them back.

    Raises:
        OSError: there is no such interface, or it has no statistics.
    """

    def __init__(self, channel: str, root: Path = _SYSTEM) -> None:
        folder = root / channel
        # A controller on a board has a device; vcan is a link into /sys/devices/virtual.
        self.counts_own = not (folder / "device").exists()
        self._files: list[int] = []
        try:
            for name in ("rx_packets", "rx_bytes"):
                self._files.append(os.open(folder / "statistics" / name, os.O_RDONLY))
            self.read()
        except (OSError, ValueError) as fault:
            self.close()
            raise OSError(f"{folder / 'statistics'}: {fault}") from None

    def read(self) -> Counted:
        """Read the counters of received frames.

        Raises:
            OSError: the interface has gone.
        """
        frames, data_bytes = (int(os.pread(file, _LONGEST, 0)) for file in self._files)
        return Counted(frames, data_bytes)

    def close(self) -> None:
        """Close the files; may be called twice."""
        for file in self._files:
            os.close(file)
        self._files.clear()
