"""Where the figures of a report come from."""

from __future__ import annotations

from enum import StrEnum

from gantryctl.machine import Machine


class Origin(StrEnum):
    """Origin of a figure: nobody shall take one of a model for one of the machine."""

    MEASURED = "measured"
    SIMULATED = "simulated"
    COMPUTED = "computed"


def origin_of(machine: Machine) -> Origin:
    """Whether readings of this machine are of a model; a virtual drive without a side channel looks like a real one."""
    modelled = machine.plant_is_local or bool(machine.can.side_channel)
    return Origin.SIMULATED if modelled else Origin.MEASURED
