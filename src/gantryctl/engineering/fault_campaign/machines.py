"""Machines of scenarios: made once for all scenarios of a drive and a scan period, then varied."""

from __future__ import annotations

import functools
from typing import Final, Literal

from gantryctl.engineering.comparison.ensemble import random_plant_values
from gantryctl.engineering.fault_campaign.scenario import Scenario
from gantryctl.engineering.faults.run import fault_machine
from gantryctl.machine import Machine, with_values

KEEPS_RAMPS_DEG_S: Final = 0.6
"""A speed at which the machine keeps its own ramps (`faults.bench.bench_machine`)."""


@functools.lru_cache(maxsize=32)
def base_machine(
    drive: Literal["sim", "bus"], beside: bool, brake_owner: Literal["drive", "object_60FE"], scan_ms: float
) -> Machine:
    """The reference gantry with its own plant and ramps."""
    return fault_machine(None, drive, KEEPS_RAMPS_DEG_S, scan_ms, brake_owner, beside=beside)


def base_of(scenario: Scenario) -> Machine:
    """The machine that a scenario varies."""
    return base_machine(scenario.drive, scenario.beside, scenario.brake_owner, scenario.scan_ms)


def machine_of(scenario: Scenario) -> Machine:
    """The machine of a scenario.

    Raises:
        ConfigError: its checks refuse the values.
    """
    machine = base_of(scenario)
    values: dict[str, object] = {}
    if scenario.drive == "bus":
        values["can.answer_ms"] = scenario.answer_ms
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
