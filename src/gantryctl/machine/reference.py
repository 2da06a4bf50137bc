"""The reference machine, recognised by its axis and its plant: only it has printed figures to be compared with."""

from __future__ import annotations

from typing import Final

from gantryctl.machine.loading import default_machine
from gantryctl.machine.specs import value_at
from gantryctl.machine.tables.model import Machine

# What the source paper prints of its machine. What it does not print (gears, friction, stiffness) may vary: another
# gear in the same gantry is still that gantry. Names and gains tell nothing.
_PRINTED: Final = (
    "axis.kind",
    "axis.pos_min_deg",
    "axis.pos_max_deg",
    "axis.reducer_ratio",
    "axis.ring_ratio",
    "plant.load.inertia_kg_m2",
    "motor.power_rated_kw",
    "motor.torque_rated_nm",
    "motor.speed_rated_r_min",
    "motor.inertia_kg_m2",
)


def is_reference_machine(machine: Machine) -> bool:
    """True for the axis of the source paper, whatever its name, its gains and its drive."""
    reference = default_machine()
    return all(value_at(machine, path) == value_at(reference, path) for path in _PRINTED)
