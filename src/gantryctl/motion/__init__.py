"""Set-point plans: computed when something changes, then only sampled.

A plan is a `gantryctl._core.Segments`, a table of constant-jerk pieces that ends at rest (or, with
`plan_velocity`, at a constant speed). Ruckig finds the times; every plan starts exactly at the given state,
ends exactly at its target, keeps the limits in the direction it travels, and never turns round without coming
to rest first.
"""

from gantryctl.motion.plans import cruise, hold, plan_move, plan_stop, plan_velocity, rest, stop_point
from gantryctl.motion.types import MotionLimits, SetPoint

__all__ = [
    "MotionLimits",
    "SetPoint",
    "cruise",
    "hold",
    "plan_move",
    "plan_stop",
    "plan_velocity",
    "rest",
    "stop_point",
]
