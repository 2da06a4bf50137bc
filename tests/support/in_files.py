"""Gives whole files of tests to the workers of pytest-xdist: what a module or a folder makes once is made once.

`worksteal` cuts the collection wherever a worker falls idle, and both sides of the cut start the service, or simulate
the report, that their tests share. Here a file goes to one worker, and a folder whose tests share a service too. Files
of `tests/system`, which start processes and wait for them, go to two workers at a time; beside them the others compute.
"""

from __future__ import annotations

from typing import Any

from xdist.scheduler import LoadScopeScheduling

SHARED = ("tests/system/page", "tests/system/reports")
"""Folders with a service or a browser for all their tests."""
WAITING = "tests/system/"
WAITING_MAX = 2


class InFiles(LoadScopeScheduling):  # type: ignore[misc]
    """Scheduler of `--dist loadfile`: units in the order of the collection, see `conftest.LONGEST`."""

    def __init__(self, config: Any, log: Any = None) -> None:
        super().__init__(config, log)
        config.option.loadscopereorder = False
        self._numbers: dict[str, int] = {}

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.partition("::")[0]
        return next((folder for folder in SHARED if path.startswith(f"{folder}/")), path)

    def _assign_work_unit(self, node: Any) -> None:
        """Give the node the first unit that it may have now."""
        if not self._numbers:
            self._numbers = {nodeid: number for number, nodeid in enumerate(self.collection or ())}
        kinds: dict[bool, str] = {}
        for scope in self.workqueue:
            kinds.setdefault(scope.startswith(WAITING), scope)
        scope = kinds.get(self._may_wait(node)) or next(iter(kinds.values()))
        unit = self.workqueue.pop(scope)
        # What is done is no more counted after every test.
        going_on = {
            name: tests for name, tests in self.assigned_work[node].items() if not all(tests.values())
        }
        self.assigned_work[node] = {**going_on, scope: unit}
        node.send_runtest_some([self._numbers[nodeid] for nodeid, done in unit.items() if not done])

    def _may_wait(self, node: Any) -> bool:
        others = (units for other, units in self.assigned_work.items() if other is not node)
        waiting = sum(
            any(scope.startswith(WAITING) and not all(tests.values()) for scope, tests in units.items())
            for units in others
        )
        return waiting < WAITING_MAX
