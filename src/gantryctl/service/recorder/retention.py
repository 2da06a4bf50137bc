"""Retention policy of journal and recordings: options of `gantryctl serve`, handed to the recorder process."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import UsageError

MB: Final = 2**20
# Hysteresis: there is room again with so much more than the reserve, or recordings would come and go at its edge.
ENOUGH: Final = 1.1


class RetentionPolicy(NamedTuple):
    """Sizes in MB of 2^20 bytes. Recordings end before events do, and have no part in the room of events.

    Attributes:
        journal_mb: the oldest events go when all of them need more.
        journal_days: events go when they are older; 0 keeps them whatever their age.
        traces_mb: the oldest recordings go when all of them need more.
        reserve_mb: with less free on the disk nothing is recorded.
        bus_log_mb, bus_logs: size of one file of the log of the bus, and how many of them are kept.
        event_reserve_mb: with less free no new motion begins.
    """

    journal_mb: int = 500
    journal_days: int = 0
    traces_mb: int = 5000
    reserve_mb: int = 64
    event_reserve_mb: int = 16
    bus_log_mb: int = 500
    bus_logs: int = 8

    def shortage(self, free_mb: float) -> int:
        """Judge the free room: 0 enough, 1 none for recordings, 2 none for new motion either."""
        return (free_mb < self.reserve_mb) + (free_mb < self.event_reserve_mb)

    def checked(self) -> RetentionPolicy:
        """Return the policy; UsageError for sizes that contradict each other."""
        if not self.reserve_mb >= self.event_reserve_mb:
            raise UsageError(
                f"--reserve {self.reserve_mb} MB is below --event-reserve {self.event_reserve_mb} MB: "
                "recordings must end before events"
            )
        return self

    @classmethod
    def from_json(cls, text: str) -> RetentionPolicy:
        """Read the argument of the recorder process."""
        return cls(**json.loads(text))

    def to_json(self) -> str:
        """Write the argument of the recorder process."""
        return json.dumps(self._asdict())


def free_of(directory: Path) -> Callable[[], int]:
    """Make a function that returns the free bytes on the disk of a directory."""

    def free() -> int:
        # One that was moved away meanwhile leaves the directory above it.
        there = next(place for place in (directory, *directory.absolute().parents) if place.is_dir())
        return shutil.disk_usage(there).free

    return free
