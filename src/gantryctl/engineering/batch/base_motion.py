"""How far the base rocks: its angle without the part that the eccentric moment makes at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gantryctl.machine import Machine
from gantryctl.wiring.simulator import plant_params

Floats = NDArray[np.float64]


def base_motion_rad(
    machine: Machine, base_rad: Floats, load_rad: Floats, moment_nm: float | None = None
) -> Floats:
    """Base angle minus T_u sin(theta - theta_u0)/K_b; `moment_nm`: another eccentric moment than the machine's."""
    plant = plant_params(machine)
    if not plant.base:
        return np.zeros_like(base_rad)
    moment = plant.eccentric_moment_nm if moment_nm is None else moment_nm
    return np.asarray(
        base_rad - moment * np.sin(load_rad - plant.eccentric_angle_rad) / plant.base_stiffness_nm_per_rad
    )
