"""One step of commissioning, run against a drive of a few lines; a desk of commissioning."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from gantryctl.commissioning import Commissioning
    from gantryctl.commissioning.results import StepResult
    from unit.commissioning.desk_room import Room
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


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Commissioning]:
    """Set up; no step has been run."""
    from gantryctl.commissioning import Commissioning
    from gantryctl.operation.store import StateStore
    from unit.commissioning.desk_room import MACHINE

    folder = tmp_path_factory.mktemp("work")
    with StateStore(MACHINE, folder) as store:
        made = Commissioning(MACHINE, store, folder, lambda line: None, lambda step: True)
        made.start(again=False)
        yield made


@pytest.fixture
def room(work: Commissioning) -> Room:
    from unit.commissioning.desk_room import Room

    return Room(work)


@pytest.fixture
def free_room(room: Room, monkeypatch: pytest.MonkeyPatch) -> Room:
    """Every step's turn has come."""
    monkeypatch.setattr(room.board, "check_turn", lambda step: None)
    return room
