"""Steps of commissioning with a virtual drive, and how far its true gantry was turned."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from gantryctl.commissioning import Commissioning, StepResult
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.store import StateStore
from gantryctl.wiring import virtual as virtual_wiring

MACHINE = load_machine(configs_folder() / "hust_can.toml")
BRAKE_BY_60FE = {"brake.owner": "object_60FE"}


class Done(NamedTuple):
    """One step with one drive.

    Attributes:
        way_deg: largest true angle of the gantry from where the step began.
        work: the commissioning that it belongs to.
    """

    result: StepResult
    way_deg: float
    work: Commissioning


class VirtualCommissioning:
    """Call it with a personality and the steps; the result is that of the last one."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self._folder, self._patch = folder, monkeypatch
        self._made = virtual_wiring.virtual_node
        self._far_deg = 0.0

    def __call__(
        self,
        quirk: str,
        *keys: str,
        changes: dict[str, object] | None = None,
        base: Machine = MACHINE,
        spoil: Callable[[DriveNode], None] = lambda node: None,
    ) -> Done:
        machine = with_values(base, changes) if changes else base

        def node_with(machine: Machine, angle_deg=0.0, state=None, _quirks=()):
            link, node = self._made(machine, angle_deg, state, (quirk,) if quirk else ())
            spoil(node)
            self._watch(node)
            return link, node

        self._patch.setattr(virtual_wiring, "virtual_node", node_with)
        with StateStore(machine, self._folder) as store:
            work = Commissioning(machine, store, self._folder, lambda line: None, lambda step: True)
            work.start(again=True)
            for key in keys:
                self._far_deg = 0.0
                result = work.do(work.left(key)[0])
        assert result is not None
        return Done(result, self._far_deg, work)

    def _watch(self, node: DriveNode) -> None:
        begun = node.truth()[0]

        def look() -> None:
            self._far_deg = max(self._far_deg, abs(math.degrees(node.truth()[0] - begun)))

        node.plant.watch = look
