"""A kind of fault: where it acts, with which arguments, and the function that does it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any, NamedTuple, Protocol

from gantryctl.drives.faults import default_of, set_fault
from gantryctl.engineering.faults.target import Target

Undo = Callable[[], None]
Value = bool | int | float | str


class Place(StrEnum):
    """Places where a fault acts."""

    ENCODER = "encoder"
    DRIVE = "drive"
    BRAKE = "brake"
    PLANT = "plant"
    INPUT = "input"
    FRAME = "frame"
    NODE = "node"
    PROCESS = "process"
    CLOCK = "clock"
    OPERATOR = "operator"


class Argument(NamedTuple):
    """Argument of a kind: its type, its range or its choices."""

    type: type
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    default: Value | None = None

    def fault_of(self, value: object) -> str | None:
        """What is wrong with a value, or None."""
        number = self.type is float and isinstance(value, int) and not isinstance(value, bool)
        if not number and type(value) is not self.type:
            return f"must be of type {self.type.__name__}, got {value!r}"
        if self.choices and value not in self.choices:
            return f"must be one of {', '.join(self.choices)}, got {value!r}"
        # NaN is in no range.
        if isinstance(value, int | float) and not self.low <= value <= self.high:
            return f"must be from {self.low:g} to {self.high:g}, got {value!r}"
        return None


class Kind(NamedTuple):
    """One way in which something fails."""

    place: Place
    name: str
    arguments: Mapping[str, Argument]
    needs_bus: bool
    act: Callable[..., Undo | None]

    @property
    def words(self) -> str:
        """What it does, in one line."""
        return (self.act.__doc__ or "").splitlines()[0]


Table = dict[tuple[Place, str], Kind]
"""Kinds by their place and name."""
Act = Callable[..., Undo | None]


class Entered(Protocol):
    """Enters functions into a table of kinds."""

    def __call__(
        self, place: Place, name: str, /, *, needs_bus: bool = False, **arguments: Argument
    ) -> Callable[[Act], Act]:
        """Enter a function (target, arguments) under its place and name."""
        ...


def enters(table: Table) -> Entered:
    """The decorator that enters functions into a table."""

    def kind(
        place: Place, name: str, /, *, needs_bus: bool = False, **arguments: Argument
    ) -> Callable[[Act], Act]:
        def entered(act: Act) -> Act:
            table[place, name] = Kind(place, name, arguments, needs_bus, act)
            return act

        return entered

    return kind


def standing(target: Target, name: str, value: Any) -> Undo:
    """Set a standing fault of the drive; what ends it."""
    set_fault(target.faults, name, value)
    return lambda: set_fault(target.faults, name, default_of(name))
