"""One step of commissioning, run against a drive of a few lines."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from gantryctl.commissioning.results import StepResult
    from unit.commissioning.hand_drive import HandDrive


@pytest.fixture
def step(monkeypatch: pytest.MonkeyPatch) -> Callable[..., StepResult]:
    # Here, not above: modules without the bus are collected where drives/canopen is removed.
    from unit.commissioning.hand_drive import MACHINE, context, opens

    def run(module: Any, function: str, drive: HandDrive, **results: StepResult) -> StepResult:
        monkeypatch.setattr(module, "open_loop_axis", opens(drive))
        machine = getattr(drive, "machine", MACHINE)
        found: StepResult = getattr(module, function)(context(machine, **results))
        return found

    return run
