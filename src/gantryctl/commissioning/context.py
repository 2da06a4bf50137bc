"""What a step has at hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from gantryctl.commissioning.results import Outcome, StepResult
from gantryctl.machine import Machine
from gantryctl.operation.store import StateStore


@dataclass(frozen=True)
class Context:
    """One commissioning under way.

    Attributes:
        folder: for files that steps write.
        results: of the steps before.
        say: a line for the person who watches.
    """

    machine: Machine
    store: StateStore
    folder: Path
    results: Mapping[str, StepResult]
    say: Callable[[str], None]


def passed(key: str, proof: str, **figures: float) -> StepResult:
    """A step that has shown what it had to."""
    return StepResult(key, Outcome.PASSED, proof, figures)


def failed(key: str, proof: str, to_do: str, **figures: float) -> StepResult:
    """A step that has shown the contrary."""
    return StepResult(key, Outcome.FAILED, proof, figures, to_do)


def judged(ok: bool, key: str, proof: str, to_do: str, **figures: float) -> StepResult:
    """Passed or failed."""
    return passed(key, proof, **figures) if ok else failed(key, proof, to_do, **figures)
