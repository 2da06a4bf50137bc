"""Context of a commissioning step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from gantryctl.commissioning.results import Outcome, StepResult
from gantryctl.machine import Machine
from gantryctl.operation.store import StateStore


@dataclass(frozen=True)
class Context:
    """Commissioning in progress.

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
    """Result of a proof that succeeded."""
    return StepResult(key, Outcome.PASSED, proof, figures)


def failed(key: str, proof: str, to_do: str, **figures: float) -> StepResult:
    """Result of a proof that failed."""
    return StepResult(key, Outcome.FAILED, proof, figures, to_do)


def judged(ok: bool, key: str, proof: str, to_do: str, **figures: float) -> StepResult:
    """Result by the outcome of a proof."""
    return passed(key, proof, **figures) if ok else failed(key, proof, to_do, **figures)
