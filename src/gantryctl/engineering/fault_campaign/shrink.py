"""The smallest scenario that still breaks the same invariant: what a person reads, and what becomes a test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from pydantic import ValidationError

from gantryctl.engineering.fault_campaign.play import Played, play
from gantryctl.engineering.fault_campaign.scenario import Action, PlannedFault, Scenario, scenario_toml
from gantryctl.errors import UsageError

# A scenario takes a tenth of a second in process and one over the bus.
TRIALS_MAX: Final = 300
# s behind the violation that are still played.
_AFTER_S: Final = 0.2
_SIMPLER: Final[tuple[dict[str, Any], ...]] = (
    {"drive": "sim", "beside": False, "brake_owner": "drive", "inverted": False},
    {"inverted": False},
    {"beside": False},
    {"plant_seed": None},
    {"hold_s": None},
    {"ramp_deg_s2": None},
    {"brake_owner": "drive"},
    {"scan_ms": 4.0, "answer_ms": 2.0},
    {"scan_ms": 10.0, "answer_ms": 2.0},
    {"angle_deg": 0.0},
)
_SIMPLER_FAULTS: Final[tuple[dict[str, Any], ...]] = ({"args": {}}, {"for_s": None})
_DIGITS: Final = (0, 1, 2, 3)
T = TypeVar("T")


@dataclass(frozen=True)
class Shrunk:
    """What is left.

    Attributes:
        played: the smallest scenario, played. invariant: that it breaks. trials: scenarios that were played.
    """

    played: Played
    invariant: str
    trials: int


def shrink(scenario: Scenario, say: Callable[[str], None], trials_max: int = TRIALS_MAX) -> Shrunk:
    """Remove faults, deeds and digits as long as the first invariant that broke still breaks.

    Args:
        say: a line for each step that made it smaller.

    Raises:
        UsageError: nothing breaks in this scenario.
    """
    first = play(scenario)
    if first.ok:
        raise UsageError(f"{scenario.name}: nothing breaks, so there is nothing to shrink")
    return _Search(first, say, trials_max).run()


class _Search:
    def __init__(self, first: Played, say: Callable[[str], None], trials_max: int) -> None:
        self._best, self._say, self._left = first, say, trials_max
        self._all = trials_max
        self._invariant = first.violations[0].invariant
        self._tried: set[str] = {scenario_toml(first.scenario)}

    def run(self) -> Shrunk:
        before = None
        while self._best.scenario != before and self._left > 0:
            before = self._best.scenario
            self._try_each(self._shorter)
            self._try_each(self._fewer_faults)
            self._try_each(self._fewer_actions)
            self._try_each(self._simpler)
            self._try_each(self._rounder)
        return Shrunk(self._best, self._invariant, self._all - self._left + 1)

    def _try_each(self, smaller: Callable[[Scenario], Iterator[Scenario]]) -> None:
        """Take the first smaller one that still breaks, and go on from there, until none does."""
        taken = True
        while taken and self._left > 0:
            taken = any(self._breaks(each) for each in smaller(self._best.scenario))

    def _breaks(self, scenario: Scenario) -> bool:
        text = scenario_toml(scenario)
        if text in self._tried or self._left <= 0:
            return False
        self._tried.add(text)
        self._left -= 1
        played = play(scenario)
        if not any(each.invariant == self._invariant for each in played.violations):
            return False
        self._best = played
        self._say(
            f"{scenario.label}: {len(scenario.actions)} deeds, {scenario.duration_s:g} s, {self._left} trials left"
        )
        return True

    def _shorter(self, scenario: Scenario) -> Iterator[Scenario]:
        at_s = next(each.time_s for each in self._best.violations if each.invariant == self._invariant)
        end_s = round(at_s + _AFTER_S, 1)
        if end_s < scenario.duration_s:
            actions = tuple(each for each in scenario.actions if each.at_s < end_s)
            yield scenario.model_copy(update={"duration_s": end_s, "actions": actions})

    @staticmethod
    def _fewer_faults(scenario: Scenario) -> Iterator[Scenario]:
        for number in range(len(scenario.faults)):
            yield scenario.model_copy(update={"faults": _without(scenario.faults, number, 1)})

    @staticmethod
    def _fewer_actions(scenario: Scenario) -> Iterator[Scenario]:
        # Halves first, as delta debugging does (Zeller, Hildebrandt 2002), then ever smaller parts.
        count = len(scenario.actions)
        size = count // 2
        while size > 0:
            for at in range(0, count, size):
                yield scenario.model_copy(update={"actions": _without(scenario.actions, at, size)})
            size //= 2
        if count == 1:
            yield scenario.model_copy(update={"actions": ()})

    @staticmethod
    def _simpler(scenario: Scenario) -> Iterator[Scenario]:
        for change in _SIMPLER:
            yield scenario.model_copy(update=change)
        for number, fault in enumerate(scenario.faults):
            for simpler in _SIMPLER_FAULTS:
                changed = fault.model_copy(update=simpler)
                yield scenario.model_copy(update={"faults": _replaced(scenario.faults, number, changed)})

    @staticmethod
    def _rounder(scenario: Scenario) -> Iterator[Scenario]:
        for digits in _DIGITS:
            yield _rounded(scenario, digits)
        for number, action in enumerate(scenario.actions):
            for digits in _DIGITS:
                changed = _rounded(action, digits)
                yield scenario.model_copy(update={"actions": _replaced(scenario.actions, number, changed)})
        for number, fault in enumerate(scenario.faults):
            for digits in _DIGITS:
                rounder = _rounded(fault, digits)
                yield scenario.model_copy(update={"faults": _replaced(scenario.faults, number, rounder)})


def _without(rows: tuple[T, ...], at: int, count: int) -> tuple[T, ...]:
    return (*rows[:at], *rows[at + count :])


def _replaced(rows: tuple[T, ...], at: int, row: T) -> tuple[T, ...]:
    return (*rows[:at], row, *rows[at + 1 :])


M = TypeVar("M", Scenario, Action, PlannedFault)


def _rounded(model: M, digits: int) -> M:
    """Numbers to so many digits behind the point; the same where a number would leave its range."""
    plain = {
        name: round(value, digits)
        for name, value in model
        if isinstance(value, float) and name not in ("scan_ms", "answer_ms", "duration_s")
    }
    try:
        return type(model).model_validate({**dict(model), **plain})
    except ValidationError:
        return model
