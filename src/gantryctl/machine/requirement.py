"""Requirements of a machine file as limits of verdicts, each with who asks for it and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from gantryctl.machine.tables.model import Machine

# Where the machine file leaves the value to the default of [required].
DEFAULT_SOURCE: Final = "a default, the machine file does not give it"
# 0.01 deg/s of 6 deg/s must not end in 0.010000000000000002.
_DIGITS: Final = 12


@dataclass(frozen=True)
class Requirement:
    """A limit that a verdict holds a figure against.

    Attributes:
        limit: in the unit of the figure, deg or deg/s.
        by: who requires it: a machine by its name, or an option of a command.
        source: where the requirement comes from; "" where nothing tells.
    """

    limit: float
    by: str
    source: str = ""

    @property
    def origin(self) -> str:
        """Who requires it, and the source: "dish (tender 4711)"."""
        return f"{self.by} ({self.source})" if self.source else self.by


def required_angle(machine: Machine) -> Requirement:
    """Required accuracy of the angle, deg."""
    return _requirement(machine, "angle_deg", machine.required.angle_deg)


def required_speed_error(machine: Machine) -> Requirement:
    """Permitted speed error at every speed, deg/s."""
    limit = round(machine.required.speed_error_ratio * machine.speed.setting_max_deg_s, _DIGITS)
    return _requirement(machine, "speed_error_ratio", limit)


def required_stopping_angle(machine: Machine) -> Requirement:
    """Permitted quick-stop angle from the highest speed, reaction included, deg."""
    return _requirement(machine, "stopping_angle_deg", machine.required.stopping_angle_deg)


def _requirement(machine: Machine, key: str, limit: float) -> Requirement:
    given = key in machine.required.model_fields_set
    return Requirement(limit, machine.name, machine.required.source if given else DEFAULT_SOURCE)
