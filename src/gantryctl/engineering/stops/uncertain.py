"""The uncertain plant of [plant.uncertainty]: corners of its bands, and plants drawn within them.

The eccentric moment has no band of its own: every stop is made with the moment of the check, which bounds it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

import numpy as np

from gantryctl.errors import ConfigError
from gantryctl.machine import Machine
from gantryctl.machine.specs import Value, value_at
from gantryctl.machine.tables.plant import PHASES
from gantryctl.machine.variation import RefusedValue, Variation

INERTIA: Final = "plant.load.inertia_kg_m2"
_FRICTION: Final = tuple(
    f"plant.{side}_friction.{name}"
    for side, names in (
        ("roller", ("coulomb_nm", "breakaway_nm", "viscous_nm_s_per_rad")),
        ("motor", ("coulomb_nm", "breakaway_nm", "viscous_nm_s_per_rad")),
    )
    for name in names
)
_STIFFNESS: Final = (
    *(f"plant.transmission.reducer_stiffness_{n}_nm_per_rad" for n in (1, 2, 3)),
    "plant.transmission.rest_stiffness_nm_per_rad",
)
_TORQUE_CONSTANT: Final = "plant.motor.torque_constant_ratio"
_PHASES: Final = "plant.gear_error.phases_rad"
_KEYS: Final = (INERTIA, *_FRICTION, *_STIFFNESS, _TORQUE_CONSTANT, _PHASES)


class Factors(NamedTuple):
    """A plant, as factors on the values of the machine file.

    Attributes:
        gear: seed of the phases of its gear error; 0 for the gear of the machine file.
    """

    inertia: float = 1.0
    friction: float = 1.0
    stiffness: float = 1.0
    torque_constant: float = 1.0
    gear: int = 0

    @property
    def text(self) -> str:
        """In words, as differences: "inertia +20 %, friction -20 %"."""
        parts = [
            f"{name.replace('_', ' ')} {100.0 * (value - 1.0):+.3g} %"
            for name, value in zip(self._fields[:4], self[:4], strict=True)
            if value != 1.0
        ]
        if self.gear:
            parts.append("another gear")
        return ", ".join(parts) or "as in the machine file"


class UncertainPlant(NamedTuple):
    """A machine with that plant, and how it differs."""

    factors: Factors
    machine: Machine


def bands(machine: Machine) -> dict[str, float]:
    """Half widths of the bands, by what they are of, in the order of `Factors`."""
    table = machine.plant.uncertainty
    return {
        "inertia": table.inertia_ratio,
        "friction": table.friction_ratio,
        "stiffness": table.stiffness_ratio,
        "torque_constant": table.torque_constant_ratio,
    }


def corners(machine: Machine) -> list[Factors]:
    """Both ends of every band, in all combinations; a band of no width has one."""
    ends = [(1.0 - half, 1.0 + half) if half > 0.0 else (1.0,) for half in bands(machine).values()]
    return [Factors._make((*corner, 0)) for corner in itertools.product(*ends)]


def drawn(machine: Machine, count: int, seed: int) -> list[Factors]:
    """Plants within the bands, uniformly, each with a gear of its own: a gear excites the swing before a stop."""
    half = np.array(list(bands(machine).values()))
    rows = 1.0 + half * np.random.default_rng(seed).uniform(-1.0, 1.0, (count, len(half)))
    return [Factors._make((*row, seed + 1 + k)) for k, row in enumerate(rows.tolist())]


def plants(machine: Machine, factors: Iterable[Factors]) -> Iterator[UncertainPlant]:
    """The machines of these factors.

    Raises:
        ConfigError: a factor leads out of the limits of a key or breaks a rule.
    """
    variation = Variation(machine, _KEYS)
    own = {key: value_at(machine, key) for key in _KEYS}
    for each in factors:
        values = dict(own)
        for keys, factor in (
            ((INERTIA,), each.inertia),
            (_FRICTION, each.friction),
            (_STIFFNESS, each.stiffness),
            ((_TORQUE_CONSTANT,), each.torque_constant),
        ):
            values |= {key: _times(own[key], factor) for key in keys}
        if each.gear:
            phases = np.random.default_rng(each.gear).uniform(0.0, 2.0 * np.pi, PHASES)
            values[_PHASES] = tuple(phases.tolist())
        found = variation.of(values)
        if isinstance(found, RefusedValue):
            raise ConfigError(
                [
                    f"{machine.name}: [plant.uncertainty]: the plant with {each.text} cannot be simulated: "
                    f"{found}; narrow the bands"
                ]
            )
        yield UncertainPlant(each, found)


def _times(value: Value, factor: float) -> float:
    assert isinstance(value, int | float)
    return float(value) * factor
