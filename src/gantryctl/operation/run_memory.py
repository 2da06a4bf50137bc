"""What one run adds to the retained memory: its power-ups and moves, its brake test, where it rests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial

from gantryctl.machine import Machine
from gantryctl.operation.brake_policy import after_test, judge_due
from gantryctl.operation.store import StateStore
from gantryctl.program import Axis, BrakeTestResult
from gantryctl.runtime import Retained


class RunMemory:
    """Retained memory of a run.

    Args:
        retained: as the last run left it.
        store: the state directory; None where nothing is kept.

    Attributes:
        retained: with the brake tests of this run.
        power_ups, moves: of this run.
        brake_due: when the next brake test is due.
    """

    def __init__(self, machine: Machine, axis: Axis, retained: Retained, store: StateStore | None) -> None:
        self._machine, self._axis, self._store = machine, axis, store
        self.retained = retained
        self.power_ups = self.moves = 0
        self.brake_due = judge_due(machine, axis, retained, retained.power_ups)

    def brake_tested(self, result: BrakeTestResult) -> None:
        """Keep the result of a brake test, and judge when the next one is due."""
        power_ups = self.retained.power_ups + self.power_ups
        self.retained = after_test(self.retained, result, power_ups, datetime.now(UTC))
        self.brake_due = judge_due(self._machine, self._axis, self.retained, power_ups)

    def rest_keeper(self, rest_counts: int) -> Callable[[], None]:
        """Work that keeps where the axis stands.

        Args:
            rest_counts: of the encoder, within all its turns.
        """
        store = self._store
        # A simulated plant of this process is killed with the run, and comes back where it was before.
        if store is None or self._machine.plant_is_local:
            return lambda: None
        return partial(store.store_retained, replace(self.retained, rest_position_counts=rest_counts))
