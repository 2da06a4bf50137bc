"""Origin of a drafted value, and the value with its origin and its rule."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple, TypeAlias

from gantryctl.machine.specs import Value


class Origin(Enum):
    """Where a value comes from, in the words of the files."""

    SHEET = "sheet"
    CATALOGUE = "catalogue"
    COMPUTED = "computed"
    CHOICE = "choice"
    GUESS = "guess"


class Drafted(NamedTuple):
    """A value with where it comes from.

    Attributes:
        rule: the equation or the reason, one line.
    """

    value: Value
    origin: Origin
    rule: str = ""

    @property
    def comment(self) -> str:
        """Origin and rule, as they stand behind the value in a file."""
        return f"{self.origin.value}: {self.rule}" if self.rule else self.origin.value


Values: TypeAlias = "dict[str, Drafted]"


def computed(value: Value, rule: str) -> Drafted:
    """A value that follows by an equation."""
    return Drafted(value, Origin.COMPUTED, rule)


def chosen(value: Value, rule: str = "") -> Drafted:
    """A decision of this product that fits any axis."""
    return Drafted(value, Origin.CHOICE, rule)


def guessed(value: Value, rule: str) -> Drafted:
    """A statement about the world that nobody has measured or decided."""
    return Drafted(value, Origin.GUESS, rule)


def guesses(values: Mapping[str, Drafted]) -> tuple[str, ...]:
    """Dotted paths of the guesses, in the order of the values."""
    return tuple(path for path, drafted in values.items() if drafted.origin is Origin.GUESS)


def significant(value: float, digits: int = 4) -> float:
    """Rounded to so many significant digits: what a rule gives is not known better."""
    return float(f"{value:.{digits - 1}e}")
