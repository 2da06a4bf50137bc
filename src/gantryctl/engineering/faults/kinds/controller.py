"""Kinds that act on the controller: its process, its clock, its operator."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.kinds.kind import Argument, Place, Table, enters
from gantryctl.engineering.faults.target import Target
from gantryctl.image import Mode
from gantryctl.units import rad

KINDS: Final[Table] = {}
kind = enters(KINDS)

# --- process and clock -----------------------------------------------------------------------------------------------


@kind(Place.PROCESS, "killed", needs_bus=True)
def _killed(target: Target) -> None:
    """Controller makes no scan any more."""
    target.silent = True


@kind(Place.CLOCK, "stall", late_s=Argument(float, 1e-3, 60.0))
def _stall(target: Target, late_s: float) -> None:
    """Next scan is this late; the axis goes on meanwhile."""
    target.clock.stall_s = float(late_s)


# --- operator --------------------------------------------------------------------------------------------------------


@kind(Place.OPERATOR, "move", target_deg=Argument(float), speed_deg_s=Argument(float))
def _move(target: Target, target_deg: float, speed_deg_s: float) -> None:
    """Operator asks for a move, sensible or not."""
    operator = target.operator
    operator.command = operator.command._replace(
        move=True, target_rad=rad(target_deg), speed_rad_s=rad(speed_deg_s), mode=Mode.CONTINUOUS
    )


@kind(Place.OPERATOR, "quick_stop")
def _quick_stop(target: Target) -> None:
    """Operator asks for a quick stop."""
    target.operator.command = target.operator.command._replace(quick_stop=True)


@kind(Place.OPERATOR, "power_off")
def _power_off(target: Target) -> None:
    """Operator switches power off."""
    target.operator.command = target.operator.command._replace(power=False)


@kind(Place.OPERATOR, "override", value=Argument(float))
def _override(target: Target, value: float) -> None:
    """Operator sets the override, sensible or not."""
    target.operator.command = target.operator.command._replace(override=value)
