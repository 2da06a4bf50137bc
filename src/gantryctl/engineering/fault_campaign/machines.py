"""Machines of scenarios: made once for all scenarios of a drive and a scan period, then varied."""

from __future__ import annotations

import functools
from typing import Final

from gantryctl.engineering.comparison.ensemble import random_plant_values
from gantryctl.engineering.drafting.choice import draft_with
from gantryctl.engineering.drafting.sheets import Answered, drafted_sheet, sheet_values
from gantryctl.engineering.drafting.templates import load_template
from gantryctl.engineering.fault_campaign.scenario import Scenario
from gantryctl.engineering.faults.bench import BrakeOwner
from gantryctl.engineering.faults.run import DriveKind, fault_machine
from gantryctl.engineering.sizing.motors import delivered_motors, load_motors
from gantryctl.machine import Machine, configs_folder, effective_values, load_machine, with_values

KEEPS_RAMPS_DEG_S: Final = 0.6
"""A speed at which the machine keeps its own ramps (`faults.bench.bench_machine`)."""


@functools.lru_cache(maxsize=32)
def base_machine(drive: DriveKind, beside: bool, brake_owner: BrakeOwner, scan_ms: float) -> Machine:
    """The reference gantry with its own plant and ramps."""
    return fault_machine(None, drive, KEEPS_RAMPS_DEG_S, scan_ms, brake_owner, beside=beside)


@functools.lru_cache(maxsize=64)
def drafted_machine(template: str, answers: tuple[tuple[str, float], ...]) -> Machine:
    """Machine that `gantryctl new` drafts from a template with these answers in place of its own.

    Raises:
        ConfigError: no motor does it, or an answer is refused. UsageError: no such template.
    """
    values = sheet_values(Answered.of(load_template(template), dict(answers)), template)
    return draft_with(drafted_sheet(values, template), load_motors(delivered_motors()), template).machine()


@functools.lru_cache(maxsize=32)
def _at_scan(machine: Machine, scan_ms: float) -> Machine:
    return with_values(machine, {"control.scan_period_ms": scan_ms})


@functools.lru_cache(maxsize=32)
def _on_bus(machine: Machine, owner: BrakeOwner, scan_ms: float) -> Machine:
    """A machine whose drive is on the bus of the reference gantry: its telegrams, inputs and times."""
    bus = effective_values(base_machine("bus", False, owner, scan_ms))
    wired = {path: value for path, value in bus.items() if path.startswith("can.")}
    return with_values(machine, {**wired, "drive.kind": "canopen", "brake.owner": owner})


def axis_of(scenario: Scenario) -> Machine | None:
    """The other axis of a scenario as its file or its draft has it; None for the reference gantry."""
    if scenario.template:
        return drafted_machine(scenario.template, tuple(sorted(scenario.answers.items())))
    return _improved() if scenario.improved else None


@functools.lru_cache(maxsize=1)
def _improved() -> Machine:
    return load_machine(configs_folder() / "hust_improved.toml")


def base_of(scenario: Scenario) -> Machine:
    """The machine that a scenario varies."""
    axis = axis_of(scenario)
    if axis is not None:
        axis = _at_scan(axis, scenario.scan_ms)
        on_bus = scenario.drive == "bus"
        return _on_bus(axis, scenario.brake_owner, scenario.scan_ms) if on_bus else axis
    return base_machine(scenario.drive, scenario.beside, scenario.brake_owner, scenario.scan_ms)


def machine_of(scenario: Scenario) -> Machine:
    """The machine of a scenario.

    Raises:
        ConfigError: its checks refuse the values.
    """
    machine = base_of(scenario)
    values: dict[str, object] = {}
    if scenario.drive == "bus":
        values |= {"can.answer_ms": scenario.answer_ms, "can.inverted": scenario.inverted}
    if scenario.ramp_deg_s2 is not None:
        values |= {
            "virtual_axis.acc_deg_s2": scenario.ramp_deg_s2,
            "virtual_axis.dec_deg_s2": scenario.ramp_deg_s2,
        }
    if scenario.hold_s is not None:
        values |= {"brake.hold": "brake", "brake.hold_brake_after_s": scenario.hold_s}
    if scenario.plant_seed is not None:
        values |= random_plant_values(machine, scenario.plant_seed, edge=scenario.edge)
    if scenario.second_pinion:
        values["plant.switches.second_pinion"] = True
    return with_values(machine, values)
