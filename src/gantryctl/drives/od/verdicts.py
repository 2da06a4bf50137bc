"""How the value of an object compares with what it must be."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class ParameterVerdict(Enum):
    """Result of the comparison of one parameter.

    A value that the drive takes and does not hold is a fault of the drive; what it has not, or has fixed, is judged by
    the ledger of the machine, which knows what makes up for it.
    """

    OK = "ok"
    DIFFERS = "differs"
    FIXED = "read-only"
    ABSENT = "not in this drive"
    UNKNOWN = "not known"
    """There, but only the drive itself can say which value it holds."""

    @property
    def refuses(self) -> bool:
        """Forbids enabling the axis."""
        return self is ParameterVerdict.DIFFERS


class ParameterRow(NamedTuple):
    """Parameter with set value, actual value and verdict."""

    place: str
    name: str
    want: str
    have: str
    verdict: ParameterVerdict
    meaning: str
    value: int | None = None
    """What the drive holds; None where it does not say."""

    @property
    def line(self) -> str:
        """For a list of refusals."""
        return f"{self.place} {self.name}: want {self.want}, have {self.have} · {self.meaning}"
