"""Requests judged before anything is switched on: what cannot be done is refused with power off and the brake closed.

The axis judges every command again; these checks only spare a power cycle that would end in a refusal.
"""

from __future__ import annotations

from typing import Final

from gantryctl.errors import CommandRefused
from gantryctl.machine import Machine
from gantryctl.program import Code
from gantryctl.program.alarms.log import refusal

_ABSURD_DEG: Final = 1e6
"""From here on a target is answered with the range, not with the way that is left."""
_NO_WAY_DEG: Final = 1e-7


def check_target(machine: Machine, here_deg: float, target_deg: float) -> None:
    """Inside the travel, or at least nearer to it.

    Raises:
        CommandRefused: it is not.
    """
    low, high = machine.axis.pos_min_deg, machine.axis.pos_max_deg
    if not -_ABSURD_DEG <= target_deg <= _ABSURD_DEG:
        allowed = f"within {low:.2f} and {high:.2f} deg"
        raise CommandRefused(
            refusal(Code.CTL_01, name="target", allowed=allowed, measured=f"{target_deg:.6g} deg").text
        )
    if target_deg > max(high, here_deg):
        limit, left = high, high - here_deg
    elif target_deg < min(low, here_deg):
        limit, left = low, here_deg - low
    else:
        return
    raise CommandRefused(
        refusal(
            Code.CTL_09,
            measured=target_deg,
            limit=limit,
            position=shown(here_deg, 2),
            left=shown(max(0.0, left), 2),
        ).text
    )


def check_direction(machine: Machine, here_deg: float, forward: bool) -> None:
    """Whether there is any way left in this direction.

    Raises:
        CommandRefused: the axis stands at the end of its travel.
    """
    end_reached = (
        here_deg >= machine.axis.pos_max_deg - _NO_WAY_DEG
        if forward
        else here_deg <= machine.axis.pos_min_deg + _NO_WAY_DEG
    )
    if end_reached:
        side = "reverse" if forward else "forward"
        raise CommandRefused(refusal(Code.LIM_05, measured=here_deg, side=side).text)


def check_speed(machine: Machine, speed_deg_s: float) -> None:
    """Within the range of the speed setting.

    Raises:
        CommandRefused: it is not; never clamped.
    """
    low, high = machine.speed.setting_min_deg_s, machine.speed.setting_max_deg_s
    if not low <= speed_deg_s <= high:
        allowed = f"within {low:.2f} and {high:.2f} deg/s"
        raise CommandRefused(
            refusal(Code.CTL_01, name="speed", allowed=allowed, measured=f"{speed_deg_s:.10g} deg/s").text
        )


def way_note(machine: Machine, here_deg: float, target_deg: float) -> str | None:
    """A remark when a rotary table would go the other way round; this axis has a cable."""
    way = abs(target_deg - here_deg)
    inside = machine.axis.pos_min_deg <= target_deg <= machine.axis.pos_max_deg
    return f"{way:.0f} deg the long way: cable" if inside and way > 180.0 + _NO_WAY_DEG else None


def shown(value: float, digits: int) -> float:
    """Rounded for showing, without a minus in front of zero."""
    return round(value, digits) + 0.0
