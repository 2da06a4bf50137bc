"""Machine file to engine: the only place that chooses concrete parts."""

from gantryctl.wiring.compensation import check_calibration, compensation
from gantryctl.wiring.drives import delivered_zero_counts, drive_around, ideal_drive, sim_drive
from gantryctl.wiring.engine import ProgramFactory, RecorderFactory, build_engine
from gantryctl.wiring.plant import (
    counts_per_turn,
    drive_params,
    eccentric_moment_nm,
    fit_load_encoder,
    gantry_sim,
    motion_limits,
    plant_params,
    position_law,
    ramps_deg,
    total_ratio,
)
from gantryctl.wiring.settings import axis_settings

__all__ = [
    "ProgramFactory",
    "RecorderFactory",
    "axis_settings",
    "build_engine",
    "check_calibration",
    "compensation",
    "counts_per_turn",
    "delivered_zero_counts",
    "drive_around",
    "drive_params",
    "eccentric_moment_nm",
    "fit_load_encoder",
    "gantry_sim",
    "ideal_drive",
    "motion_limits",
    "plant_params",
    "position_law",
    "ramps_deg",
    "sim_drive",
    "total_ratio",
]
