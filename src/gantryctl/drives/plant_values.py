"""Change of one parameter of a simulated plant that runs, and the watch over what comes of it.

The compiled plant computes with whatever it is given. Negative friction drives the shaft on, something is divided by
an inertia of zero, a spring that is far too stiff for the cycle of the drive swings up: the state would be NaN for
good, and everything behind it would be judged by a reading that no axis can have.
"""

from __future__ import annotations

import math
from typing import Final

from gantryctl import _core
from gantryctl.errors import DeviceError, UsageError

# Something is divided by each of them.
_POSITIVE: Final = frozenset(
    {
        "ratio", "reducer_ratio", "inertia_load_kg_m2", "inertia_motor_kg_m2", "stiffness_1_nm_per_rad",
        "stiffness_2_nm_per_rad", "stiffness_3_nm_per_rad", "hysteresis_length_rad", "roller_stribeck_rad_s",
        "roller_presliding_rad", "motor_stribeck_rad_s", "motor_presliding_rad", "base_inertia_kg_m2",
        "base_stiffness_nm_per_rad", "ripple_full_torque_nm", "brake_presliding_rad", "gear_temp_time_s",
        "motor_temp_time_s", "torque_constant_ratio", "roller_ageing_time_s", "roller_ageing_length_rad",
        "motor_ageing_time_s", "motor_ageing_length_rad", "cable_presliding_rad", "pinion_teeth", "ripple_order",
        "cogging_order",
    }
)  # fmt: skip
# What takes energy out of the plant, or is the size of something.
_NOT_NEGATIVE: Final = frozenset(
    {
        "torque_1_nm", "torque_2_nm", "damping_nm_s_per_rad", "half_backlash_rad", "hysteresis_torque_nm",
        "hysteresis_load_ratio", "roller_coulomb_nm", "roller_breakaway_nm", "roller_viscous_nm_s_per_rad",
        "roller_micro_damping", "motor_coulomb_nm", "motor_breakaway_nm", "motor_viscous_nm_s_per_rad",
        "motor_load_ratio", "motor_micro_damping", "base_damping_nm_s_per_rad", "ripple_torque_nm", "brake_torque_nm",
        "current_bandwidth_rad_s", "roller_ageing_nm", "motor_ageing_nm", "cogging_torque_nm", "cable_friction_nm",
        "friction_ep_ratio", "ring_teeth",
    }
)  # fmt: skip
# Where sliding begins, as a part of where it is complete: the blend between both divides by what is left of 1.
_BELOW_ONE: Final = frozenset({"friction_ep_ratio"})
FARTHEST_RAD: Final = 1e9
"""Of the motor, rad: a sound axis of 10 rad/s would take three years to get there."""


def with_value(plant: _core.PlantParams, name: str, value: float) -> _core.PlantParams:
    """A copy with one parameter changed.

    Raises:
        UsageError: no such parameter, or a value that no plant can have.
    """
    present = getattr(plant, name, None)
    if name.startswith("_") or not isinstance(present, bool | int | float):
        raise UsageError(f"the plant has no parameter '{name}' that is a number")
    if not math.isfinite(value):
        raise UsageError(f"plant parameter '{name}' must be finite, got {value:g}")
    if name in _POSITIVE and not value > 0.0:
        raise UsageError(f"plant parameter '{name}' must be above 0, got {value:g}")
    if name in _NOT_NEGATIVE and not value >= 0.0:
        raise UsageError(f"plant parameter '{name}' must not be below 0, got {value:g}")
    if name in _BELOW_ONE and not value < 1.0:
        raise UsageError(f"plant parameter '{name}' must be below 1, got {value:g}")
    if name == "lost_motor" and value not in (0.0, 1.0, 2.0):
        raise UsageError(f"plant parameter '{name}' must be 0 (neither), 1 or 2, got {value:g}")
    if name == "second_pinion" and bool(value) is not present:
        raise UsageError(
            f"plant parameter '{name}' cannot change while the plant runs: it has no second motor"
        )
    changed = plant.copy()
    try:
        setattr(changed, name, type(present)(value))
        if changed.tooth_pitch:
            _core.pitch_error(changed, 0.0, 0.0)  # knows how many teeth there may be
    except (TypeError, OverflowError, ValueError) as wrong:
        raise UsageError(f"plant parameter '{name}' cannot be {value:g}: {wrong}") from None
    return changed


def lost(motor_rad: float) -> DeviceError:
    """What to raise where the simulated motor has no angle within `FARTHEST_RAD` any more."""
    return DeviceError(
        f"simulated plant: the motor is at {motor_rad:g} rad, beyond {FARTHEST_RAD:g} rad: the plant cannot be "
        "computed with the parameters that it was changed to; change one of them less"
    )
