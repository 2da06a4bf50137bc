"""Rules between keys: what two right values may not say together. Each line names every key it is about."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Final, TypeAlias

if TYPE_CHECKING:
    from gantryctl.machine.tables.model import Machine

Check: TypeAlias = "Callable[[Machine], str | None]"


@dataclasses.dataclass(frozen=True, slots=True)
class Rule:
    """One condition on the keys `paths`; `check` answers what is wrong in words, or None."""

    paths: tuple[str, ...]
    check: Check

    @property
    def name(self) -> str:
        """Name of the rule, for tests."""
        return self.check.__name__

    @property
    def sentence(self) -> str:
        """What the rule demands, for the reference page."""
        return (self.check.__doc__ or "").strip()


RATIO: Final = ("axis.reducer_ratio", "axis.ring_ratio")


class RuleBook:
    """An ordered collection of rules, filled by a decorator: `@book.rule("speed.setting_min_deg_s", ...)`."""

    def __init__(self) -> None:
        self.rules: list[Rule] = []

    def rule(self, *paths: str) -> Callable[[Check], Check]:
        """Register a check; the first path is the key that the message begins with."""

        def register(check: Check) -> Check:
            self.rules.append(Rule(paths, check))
            return check

        return register


def violations(machine: Machine, rules: Iterable[Rule]) -> list[tuple[Rule, str]]:
    """The rules that a machine breaks, with what is wrong."""
    found = []
    for rule in rules:
        wrong = rule.check(machine)
        if wrong is not None:
            found.append((rule, wrong))
    return found


def at_least(value: float, limit: float, unit: str, why: str) -> str | None:
    """Say what is wrong unless `value` is at or above `limit`, rounding forgiven (6 x 1.05 is not 6.3)."""
    if value >= limit - _rounding(value, limit):
        return None
    return f"must be at least {limit:.6g}{_suffix(unit)}: {why}"


def at_most(value: float, limit: float, unit: str, why: str) -> str | None:
    """Say what is wrong unless `value` is at or below `limit`, rounding forgiven."""
    if value <= limit + _rounding(value, limit):
        return None
    return f"must be at most {limit:.6g}{_suffix(unit)}: {why}"


def above(value: float, limit: float, unit: str, why: str) -> str | None:
    """Say what is wrong unless `value` is clearly above `limit`."""
    if value > limit + _rounding(value, limit):
        return None
    return f"must be above {limit:.6g}{_suffix(unit)}: {why}"


def below(value: float, limit: float, unit: str, why: str) -> str | None:
    """Say what is wrong unless `value` is clearly below `limit`."""
    if value < limit - _rounding(value, limit):
        return None
    return f"must be below {limit:.6g}{_suffix(unit)}: {why}"


def _rounding(value: float, limit: float) -> float:
    return 1e-9 * max(abs(value), abs(limit))


def _suffix(unit: str) -> str:
    return "" if unit == "-" else f" {unit}"
