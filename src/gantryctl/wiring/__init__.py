"""Machine file to engine: the only place that chooses concrete parts."""

from gantryctl.wiring.plant import (
    counts_per_turn,
    drive_params,
    eccentric_moment_nm,
    gantry_sim,
    motion_limits,
    plant_params,
    position_law,
    total_ratio,
)

__all__ = [
    "counts_per_turn",
    "drive_params",
    "eccentric_moment_nm",
    "gantry_sim",
    "motion_limits",
    "plant_params",
    "position_law",
    "total_ratio",
]
