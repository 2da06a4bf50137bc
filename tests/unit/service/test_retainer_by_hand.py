"""What the controller keeps of its run, and when: by hand, on a disk that is slow."""

from __future__ import annotations

import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.machine import default_machine
from gantryctl.operation.run_memory import RunEnd
from gantryctl.program import AxisState
from gantryctl.runtime import Retained
from gantryctl.service.controller import retainer as module
from gantryctl.service.controller.retainer import Retainer
from gantryctl.units import rad

BEFORE = Retained("hust_gantry", "hash")
PATIENCE_S = 20.0


def test_what_is_to_be_kept_while_the_disk_is_slow_is_kept_behind_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Power off, on, and off again before the disk has taken the first: the second state is the one that counts."""
    gates: list[threading.Event] = []
    written: list[tuple[str, float | None]] = []

    def slow(_machine: object, _store: object, _drive: object, record: Retained) -> None:
        gates.append(threading.Event())
        assert gates[-1].wait(PATIENCE_S)
        written.append((record.last_result, record.speed_rad_s))

    def after(_machine: object, before: Retained, _axis: object, _seen: object, end: RunEnd) -> Retained:
        return replace(before, last_result=end.result)

    monkeypatch.setattr(module, "keep_machine", slow)
    monkeypatch.setattr(module, "retained_after", after)
    law = SimpleNamespace(counts_per_turn=1.0, ratio=1.0)
    axis = SimpleNamespace(
        settings=SimpleNamespace(law=law),
        state=AxisState.DISABLED,
        turns=None,
        feedback=SimpleNamespace(counts=0.0),
    )
    levels = SimpleNamespace(speed_rad_s=1.0, increment_rad=0.1)
    operator: Any = SimpleNamespace(
        program=SimpleNamespace(axis=axis), levels=levels, permit=SimpleNamespace(blocked_by=())
    )
    engine: Any = SimpleNamespace(drive=object(), time_s=1.0)
    store: Any = object()
    kept = Retainer(default_machine(), store, engine, operator, BEFORE)
    kept.start("power off")
    levels.speed_rad_s = 2.0
    kept.start("power off again")
    for _ in range(10):
        kept.scan()
    assert len(gates) <= 1, "one write at a time"
    for number in (0, 1):
        while len(gates) <= number:
            kept.scan()
        gates[number].set()
    kept.join()
    kept.scan()
    assert written == [("power off", 1.0), ("power off again", 2.0)]
    assert len(gates) == 2, "nothing waits any more"


def test_a_shaft_between_two_steps_of_a_coarse_encoder_adds_up_to_no_travel() -> None:
    """Ten steps in a motor turn and 36 turns: 1 deg a step. It stands for 100 scans, and then turns by ten of them."""
    axis = SimpleNamespace(
        settings=SimpleNamespace(law=SimpleNamespace(counts_per_turn=10.0, ratio=36.0)),
        state=AxisState.STANDSTILL,
        feedback=SimpleNamespace(counts=0.0),
    )
    anything: Any = SimpleNamespace(program=SimpleNamespace(axis=axis), drive=None)
    kept = Retainer(default_machine(), anything, anything, anything, BEFORE)
    assert kept.count_rad == pytest.approx(rad(1.0))
    for number in range(100):
        axis.feedback.counts = float(number % 2)
        kept.scan()
    assert kept._way_rad == 0.0
    for number in range(11):
        axis.feedback.counts = float(number)
        kept.scan()
    assert kept._way_rad == pytest.approx(rad(10.0))
