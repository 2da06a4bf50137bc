"""Rules between keys: what two right values may not say together. Each line names every key it is about."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple, TypeAlias


class Limit(NamedTuple):
    """A limit that the first key of a rule does not keep, in the unit of that key."""

    relation: str
    value: float
    why: str

    def text(self, unit_text: str) -> str:
        """The demand in words; `unit_text` is the unit with a space before it."""
        return f"must be {self.relation} {self.value:.6g}{unit_text}: {self.why}"


Broken: TypeAlias = "Limit | str | None"
"""What is wrong, as a limit or in words; None when the rule holds."""
Check: TypeAlias = Callable[[Any], Broken]


@dataclasses.dataclass(frozen=True, slots=True)
class Rule:
    """Condition on the keys `paths`; `check` gives what is wrong, or None."""

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


# Filled by the chapters beside this file when they are imported: the model's validator knows this list and no chapter.
REGISTERED: Final[list[Rule]] = []
# What is told and not refused: a search of gains, and who tries what happens, come by such a machine.
ADVISED: Final[list[Rule]] = []


def rule(*paths: str) -> Callable[[Check], Check]:
    """Register a check; the first path is the key that the message begins with."""

    def register(check: Check) -> Check:
        REGISTERED.append(Rule(paths, check))
        return check

    return register


def advice(*paths: str) -> Callable[[Check], Check]:
    """Register a check whose message is a warning: the machine is taken as it is."""

    def register(check: Check) -> Check:
        ADVISED.append(Rule(paths, check))
        return check

    return register


def linear_rule(*paths: str) -> Callable[[Check], Check]:
    """Register a check of an axis with two ends; a modulo axis has none."""

    def register(check: Check) -> Check:
        @functools.wraps(check)
        def of_linear(machine: Any) -> Broken:
            return None if machine.axis.modulo else check(machine)

        return rule(*paths, "axis.kind")(of_linear)

    return register


def violations(machine: object, rules: Iterable[Rule] = REGISTERED) -> list[tuple[Rule, Limit | str]]:
    """Rules that a machine breaks, with what is wrong."""
    return [(each, wrong) for each in rules if (wrong := each.check(machine)) is not None]


def at_least(value: float, limit: float, why: str) -> Broken:
    """Say what is wrong unless `value` is at or above `limit`, rounding forgiven (6 x 1.05 is not 6.3)."""
    return None if value >= limit - _rounding(value, limit) else Limit("at least", limit, why)


def at_most(value: float, limit: float, why: str) -> Broken:
    """Say what is wrong unless `value` is at or below `limit`, rounding forgiven."""
    return None if value <= limit + _rounding(value, limit) else Limit("at most", limit, why)


def above(value: float, limit: float, why: str) -> Broken:
    """Say what is wrong unless `value` is clearly above `limit`."""
    return None if value > limit + _rounding(value, limit) else Limit("above", limit, why)


def below(value: float, limit: float, why: str) -> Broken:
    """Say what is wrong unless `value` is clearly below `limit`."""
    return None if value < limit - _rounding(value, limit) else Limit("below", limit, why)


def _rounding(value: float, limit: float) -> float:
    # 6 x 1.05 is 6.300000000000001: a value that is written as it should be must not be refused.
    return 1e-9 * max(abs(value), abs(limit))
