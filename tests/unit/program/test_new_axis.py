"""A new axis remembers nothing: no count has begun, nothing is suspected, no moment of before is near.

What a method changes is the memory of a part; it is found in the sources, so that a new attribute is judged too.
"""

from __future__ import annotations

import ast
import functools
import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gantryctl.image import DigitalInputs, OperatorCommand
from gantryctl.program import PowerPhase
from gantryctl.program.power.phases import Proof
from gantryctl.units import rad
from gantryctl.wiring.engine import build_program
from gantryctl.wiring.simulator import sim_drive
from states.snapshot import names_of
from support.improved import improved_machine

# What is not empty at the start. No scan was: -1 and before. A switch that is not wired is closed, and so was it.
BEGINS_WITH: dict[str, object] = {
    "Axis._settled": True,
    "Axis.scan": -1,
    "Feedback._late_scan": -10,
    "Feedback._let_go_scan": -1,
    "Feedback._speed_late_scan": -10,
    "Feedback._speed_scan": -10,
    "Feedback._turn_scan": -10,
    "Feedback._uneven_scan": -10,
    "Feedback.brake_contact": True,
    "Feedback.inputs": DigitalInputs(),
    "FlankSwing._count": -1,
    "GantryProgram._last": OperatorCommand(),
    # A key needs a renewal of its own: the lease of nobody is as old as it may become, 250 scans of 1 ms.
    "GantryProgram._lease_age": 250.0,
    "Interlocks._was_minus": True,
    "Interlocks._was_plus": True,
    "Interlocks.minus_open": True,
    "Interlocks.permitted": True,
    "Interlocks.plus_open": True,
    "Jog._released": True,
    "Liveness._scan": -2,
    "Liveness._torque_scan": -2,
    "Monitors._over_travel_minus": rad(-180.5),
    "Monitors._over_travel_plus": rad(180.5),
    "MotionCommands._sign": 1.0,
    "PowerSequence.phase": PowerPhase.OFF,
    "PowerSequence.proof": Proof.NOT_DONE,
    "SetOverride._asked": 1.0,
    "SiteInterlocks._inputs": DigitalInputs(),
    # Half a second of scans ago, so that a load swings only with a push each way.
    "TorqueWatch._minus_scan": -500,
    "TorqueWatch._plus_scan": -500,
    "Twist._sign": 1.0,
    "VirtualAxis._speed": rad(6.0),
    "VirtualAxis.at_rest": True,
    "VirtualAxis.override": 1.0,
}
# From the machine file, the maps or the core: tests of the wiring and of the virtual axis look at them.
GIVEN = {
    "Axis.zero_counts",
    "CalibrationWatch._moment",
    "VirtualAxis._ramps",
    "VirtualAxis._sample",
    "VirtualAxis.plan",
}
# The variance with which a fit begins.
GIVEN |= {"TorqueModel._cov"}


@functools.cache
def tree_of(file: str) -> ast.Module:
    return ast.parse(Path(file).read_text(encoding="utf-8"))


@functools.cache
def memory_of(kind: type) -> set[str]:
    """Attributes that a method sets after the start."""
    found = set()
    for base in kind.__mro__:
        file = inspect.getsourcefile(base) if base.__module__.startswith("gantryctl.program") else None
        tree = tree_of(file) if file else ast.Module([], [])
        methods = (
            method
            for body in ast.walk(tree)
            if isinstance(body, ast.ClassDef) and body.name == base.__name__
            for method in body.body
            if isinstance(method, ast.FunctionDef) and method.name != "__init__"
        )
        found |= {
            node.attr
            for method in methods
            for node in ast.walk(method)
            if isinstance(node, ast.Attribute)
            and isinstance(node.ctx, ast.Store)
            and ast.unparse(node.value) == "self"
        }
    return found


def parts_of(each: Any, found: dict[int, Any]) -> dict[int, Any]:
    """Every object of the program that it holds, at any depth."""
    if isinstance(each, list | tuple):
        for item in each:
            parts_of(item, found)
    elif type(each).__module__.startswith("gantryctl.program") and id(each) not in found:
        found[id(each)] = each
        for name in names_of(each):
            parts_of(getattr(each, name), found)
    return found


def empty(value: object) -> bool:
    """Nothing, zero or unknown."""
    if isinstance(value, list | tuple):
        return all(map(empty, value))
    return not value or (isinstance(value, float) and math.isnan(value))


def improved_parts() -> list[Any]:
    """Every part of a new axis with everything that can be had."""
    machine = improved_machine()
    return list(parts_of(build_program(machine, sim_drive(machine)), {}).values())


def test_a_new_axis_remembers_nothing() -> None:
    memory = {
        f"{type(part).__name__}.{name}": getattr(part, name)
        for part in improved_parts()
        for name in memory_of(type(part))
    }
    found = {name: value for name, value in memory.items() if not empty(value) and name not in GIVEN}
    assert found == BEGINS_WITH


ANEW: dict[str, tuple[Callable[[Any], object], set[str]]] = {
    # An axis that is beyond the end of its travel has the limits of there until it is back inside.
    "Monitors": (lambda part: part.reset(), {"_over_travel_minus", "_over_travel_plus"}),
    # Moments, not counts; what a drive that is off reports; and the error that is told beside a finding.
    "TorqueWatch": (lambda part: part.begin(), {"_minus_scan", "_plus_scan", "_off", "_pos_err_rad"}),
    "DragWatch": (lambda part: part.begin(), set()),
    "TorqueModel": (lambda part: part.forget(), set()),
    "HoldWatch": (lambda part: part.begin(), set()),
    "RampWatch": (lambda part: part.begin(), set()),
    "RestWatch": (lambda part: part.begin(), set()),
    "SlipWatch": (lambda part: part.begin(None, unwinds=False), set()),
    "Twist": (lambda part: part.begin(0.0), set()),
    "FlankSwing": (lambda part: part.abandon(), set()),
    # How many there were; the phase it is in now; and a mean that its first reading replaces.
    "BrakeTest": (lambda part: part.prepare(0.0), {"count", "phase", "_mean"}),
}


@pytest.mark.parametrize("kind", ANEW)
def test_who_begins_anew_remembers_nothing_of_before(kind: str) -> None:
    begin, kept = ANEW[kind]
    # The law of the brake test is a part of the axis; its block of the same name comes later.
    part = next(part for part in improved_parts() if type(part).__name__ == kind)
    new = {name: getattr(part, name) for name in memory_of(type(part))}
    numbers = {name: value for name, value in new.items() if isinstance(value, bool | int | float)}
    assert numbers
    for name, value in numbers.items():
        setattr(part, name, not value if isinstance(value, bool) else 7)
    begin(part)
    # `repr`: NaN is what it was.
    assert {name for name, value in numbers.items() if repr(getattr(part, name)) != repr(value)} == kept
