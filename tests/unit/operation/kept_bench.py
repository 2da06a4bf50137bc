"""Machines as an earlier run has left them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.operation.opening import keep_machine, new_machine
from gantryctl.operation.store import StateStore
from gantryctl.program import Axis
from gantryctl.runtime import Retained
from gantryctl.wiring.program import axis_settings

MACHINE = default_machine()
IDEAL = with_values(MACHINE, {"drive.kind": "ideal"})
REAL = with_values(
    MACHINE,
    {
        "drive.kind": "canopen",
        "control.scan_period_ms": 4.0,
        "can.interface": "socketcan",
        "can.channel": "can0",
    },
)
NEW = Retained(machine=MACHINE.name, config_hash="")


def an_axis(machine: Machine = IDEAL) -> Axis:
    return Axis(axis_settings(machine), 0.0)


@contextmanager
def kept_machine(machine: Machine = MACHINE, **values: Any) -> Iterator[StateStore]:
    found = new_machine(machine, 10.0)
    with StateStore(machine) as store:
        keep_machine(machine, store, found.drive, replace(found.retained, **values))
        yield store
