"""How much the service keeps on its disk: options of `gantryctl serve`, handed to the recorder process."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import UsageError

MB: Final = 2**20
# There is room again when there is so much more than the reserve: nothing comes and goes at the edge of it.
ENOUGH: Final = 1.1


class RetentionPolicy(NamedTuple):
    """Sizes in MB of 2^20 bytes. Events come before recordings: those end first, and have no part in their room.

    Attributes:
        journal_mb: the oldest events go when all of them need more.
        journal_days: events go when they are older; 0 keeps them whatever their age.
        traces_mb: the oldest recordings go when all of them need more.
        reserve_mb: with less free on the disk nothing is recorded.
        event_reserve_mb: with less free no new motion begins.
    """

    journal_mb: int = 500
    journal_days: int = 0
    traces_mb: int = 5000
    reserve_mb: int = 64
    event_reserve_mb: int = 16

    def shortage(self, free_mb: float) -> int:
        """0 for room enough, 1 for none for recordings, 2 for none for new motion either."""
        return (free_mb < self.reserve_mb) + (free_mb < self.event_reserve_mb)

    def checked(self) -> RetentionPolicy:
        """The same; UsageError for sizes that contradict each other."""
        if not self.reserve_mb >= self.event_reserve_mb:
            raise UsageError(
                f"--reserve {self.reserve_mb} MB is below --event-reserve {self.event_reserve_mb} MB: "
                "recordings must end before events"
            )
        return self

    @classmethod
    def from_json(cls, text: str) -> RetentionPolicy:
        """From the argument of the process."""
        return cls(**json.loads(text))

    def to_json(self) -> str:
        """For the argument of the process."""
        return json.dumps(self._asdict())


def free_of(directory: Path) -> Callable[[], int]:
    """A function that gives the bytes free on the disk of a directory."""

    def free_bytes() -> int:
        found = os.statvfs(directory)
        return found.f_bavail * found.f_frsize

    return free_bytes
