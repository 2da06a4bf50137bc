"""Machine file to engine: the only place that chooses concrete parts."""

from gantryctl.wiring.drives import delivered_zero_counts, drive_around, sim_drive
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
from gantryctl.wiring.settings import axis_settings

__all__ = [
    "axis_settings",
    "counts_per_turn",
    "delivered_zero_counts",
    "drive_around",
    "drive_params",
    "eccentric_moment_nm",
    "gantry_sim",
    "motion_limits",
    "plant_params",
    "position_law",
    "sim_drive",
    "total_ratio",
]
