"""Gains under tuning: both loops, and the acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from gantryctl.engineering.analysis.models.sampled import LoopSettings, loop_settings
from gantryctl.machine import Machine, with_values

_DIGITS: Final = 4


@dataclass(frozen=True)
class Gains:
    """Both loops, and the acceleration of normal moves.

    Attributes:
        kvp_nm_s_per_rad, tvi_s: PI speed loop of the drive. kpp_per_s, kvf: position loop of the controller.
        acc_deg_s2: highest acceleration of the set-point, at the gantry.
    """

    kvp_nm_s_per_rad: float
    tvi_s: float
    kpp_per_s: float
    kvf: float
    acc_deg_s2: float

    @property
    def stiffness(self) -> float:
        """Kvp Kpp/Tvi, N m/(rad s): how fast torque grows behind an angle that is off; 1/this is eq. (5)'s error
        behind a torque ramp.
        """
        return self.kvp_nm_s_per_rad * self.kpp_per_s / self.tvi_s

    def rounded(self) -> Gains:
        """Gains with the digits that a machine file needs."""
        values = (self.kvp_nm_s_per_rad, self.tvi_s, self.kpp_per_s, self.kvf, self.acc_deg_s2)
        return Gains(*(_significant(value) for value in values))


# What the paper ended with.
# 450 deg/s2 at the motor shaft are 0.393 deg/s2 at the gantry.
PAPER: Final = Gains(77.6959, 0.010, 10.0, 1.0, 450.0 / 1144.0)

# Where the procedure starts: soft, slow, no feed-forward; on the reference machine.
POOR: Final = Gains(10.0, 0.5, 1.0, 0.0, 0.05)
# Rotor with reducer input of the machine that absolute gains here were found on: with `POOR` a speed loop of 36 ms.
FAST_INERTIA_KG_M2: Final = 0.362


def poor(fast_inertia_kg_m2: float, acc_deg_s2: float) -> Gains:
    """Gains as poor as `POOR` for an axis with this inertia at the motor shaft, and this acceleration in its file."""
    kvp = POOR.kvp_nm_s_per_rad * (fast_inertia_kg_m2 / FAST_INERTIA_KG_M2)
    return replace(POOR, kvp_nm_s_per_rad=kvp, acc_deg_s2=min(POOR.acc_deg_s2, 0.25 * acc_deg_s2))


def configured(machine: Machine) -> Gains:
    """Gains of a machine file."""
    loop, control = machine.drive.speed_loop, machine.control
    return Gains(
        loop.kvp_nm_s_per_rad,
        loop.tvi_ms * 1e-3,
        control.kpp_per_s,
        control.kvf,
        machine.virtual_axis.acc_deg_s2,
    )


def machine_with(machine: Machine, gains: Gains) -> Machine:
    """The machine with other gains.

    Raises:
        ConfigError: a value outside what the machine file allows.
    """
    changes = {
        "drive.speed_loop.kvp_nm_s_per_rad": gains.kvp_nm_s_per_rad,
        # Seconds times 1e3 may end in a stray last bit: twelve digits keep the file readable.
        "drive.speed_loop.tvi_ms": _significant(gains.tvi_s * 1e3, 12),
        "control.kpp_per_s": gains.kpp_per_s,
        "control.kvf": gains.kvf,
    }
    # A machine may slow down otherwise than it speeds up; only a tuned value sets both.
    if gains.acc_deg_s2 != machine.virtual_axis.acc_deg_s2:
        changes |= {"virtual_axis.acc_deg_s2": gains.acc_deg_s2, "virtual_axis.dec_deg_s2": gains.acc_deg_s2}
    return with_values(machine, changes)


def settings_with(machine: Machine, gains: Gains) -> LoopSettings:
    """The loop of a machine file with other gains, for the linear model."""
    return replace(
        loop_settings(machine),
        kvp_nm_s_per_rad=gains.kvp_nm_s_per_rad,
        tvi_s=gains.tvi_s,
        kpp_per_s=gains.kpp_per_s,
        kvf=gains.kvf,
    )


def _significant(value: float, digits: int = _DIGITS) -> float:
    """Rounded to so many significant digits."""
    return round(value, digits - 1 - math.floor(math.log10(abs(value)))) if value else 0.0
