"""Swinging modes, with the motor held and in the closed loop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gantryctl.engineering.analysis.models.linear import ComplexArray
from gantryctl.engineering.analysis.models.sampled import SampledLoop

# By rising frequency: the load on transmission and base, and the base under it.
NAMES = ("load mode", "base mode")


class Oscillation(NamedTuple):
    """Natural frequency, Hz, and damping ratio of a pair of poles."""

    hz: float
    zeta: float

    @classmethod
    def of(cls, pole: complex) -> Oscillation:
        """|s|/2 pi and -Re(s)/|s|."""
        return cls(abs(pole) / (2.0 * math.pi), -pole.real / abs(pole))


class SwingMode(NamedTuple):
    """One mode of the mechanics, motor held and in the closed loop."""

    name: str
    held: Oscillation
    closed: Oscillation

    @property
    def followed(self) -> bool:
        """The closed loop has a swing within a factor of 2 of it; a slower loop has none, its motor gives way."""
        return 0.5 <= self.closed.hz / self.held.hz <= 2.0

    @property
    def damping_taken(self) -> float:
        """Damping ratio that the loop takes away; negative when it adds."""
        return self.held.zeta - self.closed.zeta


def modes(loop: SampledLoop) -> list[SwingMode]:
    """The modes of the plant in a loop; each is followed to the nearest closed-loop pole. None for a rigid
    plant.
    """
    found = []
    # 2.00 Hz with 1.6 % damping for the load of the reference machine, motor held.
    for name, pole in zip(NAMES, loop.plant.held_poles().tolist(), strict=False):
        found.append(SwingMode(name, Oscillation.of(pole), Oscillation.of(nearest(loop.poles, pole))))
    return found


def nearest(poles: ComplexArray, pole: complex) -> complex:
    """The pole nearest to a given one."""
    return complex(poles[np.argmin(np.abs(poles - pole))])


def least_damped(poles: ComplexArray) -> Oscillation:
    """The oscillating pair with the smallest damping ratio; (0, 1) when nothing swings."""
    swinging = [Oscillation.of(pole) for pole in poles.tolist() if pole.imag > 0.0]
    return min(swinging, key=lambda mode: mode.zeta, default=Oscillation(0.0, 1.0))
