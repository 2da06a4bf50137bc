"""What became of one change: found by a test, or not."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any


class Fate(StrEnum):
    """What the chosen tests did to a change."""

    KILLED = "killed"
    TIMEOUT = "timeout"  # counts as killed: whoever runs the tests sees them hang
    SURVIVED = "survived"
    UNCOVERED = "uncovered"  # counts as survived: no test runs the line
    STALE = "stale"  # no program: counts nowhere


FOUND = frozenset({Fate.KILLED, Fate.TIMEOUT})


@dataclass(frozen=True)
class Trial:
    """One row of a result file.

    Attributes:
        by: the test that failed first.
        tests: how many were chosen.
        seconds: that the trial took.
        digest: of the text that was changed: a result counts for this text only.
    """

    name: str
    fate: Fate
    by: str = ""
    tests: int = 0
    seconds: float = 0.0
    severe: bool = False
    shown: str = ""
    digest: str = ""

    def row(self) -> dict[str, Any]:
        """As one line of JSON."""
        return asdict(self)
