"""Reasons why power cannot be switched on, as values."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Final, NamedTuple

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.encoder import ENCODER
from gantryctl.program.alarms.start import START
from gantryctl.program.alarms.table import ALARMS
from gantryctl.program.alarms.words import filled

# An earlier stop (SYS-12) casts doubt on the angle only if the encoder caused it, a fault of the drive (DRV-15) never.
_DOUBTS_POSITION: Final = frozenset(row.code for row in (*ENCODER, *START)) - {Code.SYS_12, Code.DRV_15}


class ClearedBy(StrEnum):
    """What takes a reason away."""

    # Who may clear a reason is a value: nothing is guessed from the beginning of a text.
    RESET = "reset"
    """A reset by an operator."""
    SERVICE = "service"
    """A reset by the service role."""
    RESTART = "restart"
    """Work on the machine with the controller stopped: encoder zero, drive parameters."""
    COMMISSIONING = "commissioning"
    """`gantryctl commission`, whole or in part."""


class Reason(NamedTuple):
    """Why power cannot be switched on.

    Attributes:
        values: fields of the message of `code`.
    """

    code: Code
    values: Mapping[str, object]
    cleared_by: ClearedBy

    @property
    def text(self) -> str:
        """Code, what is wrong and what to do, in one line."""
        row = ALARMS[self.code]
        return f"{self.code} · {filled(row.english.message, self.values)} · {row.english.to_do}"

    def __str__(self) -> str:
        return self.text

    @property
    def by_reset(self) -> bool:
        """A reset takes it away."""
        return self.cleared_by in (ClearedBy.RESET, ClearedBy.SERVICE)

    @property
    def doubts_position(self) -> bool:
        """The angle of the gantry is in doubt: the encoder's reading, the configuration or the bus is not as left."""
        return self.values.get("stopped_by", self.code) in _DOUBTS_POSITION


class Reasons(tuple[Reason, ...]):
    """Several reasons, the gravest first."""

    __slots__ = ()

    def __str__(self) -> str:
        return "; ".join(map(str, self))
