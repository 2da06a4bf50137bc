"""Profiles against each other at equal base motion: how soon the short move is done when the base may shake as much."""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.engineering.comparison.key_figures import SHORT_DEG, MoveFigures, move_figures
from gantryctl.machine import Machine, with_values
from gantryctl.machine.places import fitted_stretch_deg

# Of the bisection: acceleration to 0.1 %.
_STEPS: Final = 12
_HIGHEST_DEG_S2: Final = 3.0


class ProfileRow(NamedTuple):
    """A profile with the acceleration at which its base motion is the permitted one."""

    name: str
    acc_deg_s2: float
    jerk_deg_s3: float
    move: MoveFigures


def profiles_at_equal_base_motion(machine: Machine, base_um: float, swing_hz: float) -> list[ProfileRow]:
    """The short move by trapezoid and by S-curve, both with `base_um` of base motion; compensations as in `machine`.

    Args:
        swing_hz: first mode; the S-curve takes one period of it for its acceleration ramp.
    """
    rows, quarter = [], fitted_stretch_deg(machine, *SHORT_DEG)
    for name, profile in (("trapezoid", "trapezoid"), ("S-curve, ramps of one swing period", "jerk_limited")):
        acc = _acceleration(machine, profile, base_um, swing_hz)
        move = move_figures(_with_profile(machine, profile, acc, swing_hz), *quarter)
        rows.append(ProfileRow(name, acc, acc * swing_hz if profile == "jerk_limited" else 0.0, move))
    return rows


def _acceleration(machine: Machine, profile: str, base_um: float, swing_hz: float) -> float:
    low, high, quarter = 0.1, _HIGHEST_DEG_S2, fitted_stretch_deg(machine, *SHORT_DEG)
    # Equal base motion, because a faster profile that shakes more is no better one.
    for _ in range(_STEPS):
        middle = (low * high) ** 0.5
        shaken = move_figures(_with_profile(machine, profile, middle, swing_hz), *quarter).base_um
        low, high = (middle, high) if shaken <= base_um else (low, middle)
    return low


def _with_profile(machine: Machine, profile: str, acc_deg_s2: float, swing_hz: float) -> Machine:
    changes: dict[str, object] = {
        "virtual_axis.profile": profile,
        "virtual_axis.acc_deg_s2": acc_deg_s2,
        "virtual_axis.dec_deg_s2": acc_deg_s2,
        "virtual_axis.jog_release_dec_deg_s2": max(acc_deg_s2, machine.virtual_axis.jog_release_dec_deg_s2),
    }
    if profile == "jerk_limited":
        # A ramp of one period of the first mode leaves no swing behind.
        changes["virtual_axis.jerk_deg_s3"] = acc_deg_s2 * swing_hz
    return with_values(machine, changes)
