"""Machine file to engine: the only place that chooses concrete parts."""

from gantryctl.wiring.canopen import (
    can_link,
    canopen_drive,
    canopen_settings,
    read_only_drive,
)
from gantryctl.wiring.compensation import check_calibration, compensation, lead_deg
from gantryctl.wiring.drives import delivered_zero_counts, drive_around, drive_of, ideal_drive, sim_drive
from gantryctl.wiring.engine import ProgramFactory, RecorderFactory, build_engine, build_program
from gantryctl.wiring.program import axis_settings, speed_settings, travel_settings, untestable
from gantryctl.wiring.simulator import (
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

__all__ = [
    "ProgramFactory",
    "RecorderFactory",
    "axis_settings",
    "build_engine",
    "build_program",
    "can_link",
    "canopen_drive",
    "canopen_settings",
    "check_calibration",
    "compensation",
    "counts_per_turn",
    "delivered_zero_counts",
    "drive_around",
    "drive_of",
    "drive_params",
    "eccentric_moment_nm",
    "fit_load_encoder",
    "gantry_sim",
    "ideal_drive",
    "lead_deg",
    "motion_limits",
    "plant_params",
    "position_law",
    "ramps_deg",
    "read_only_drive",
    "sim_drive",
    "speed_settings",
    "total_ratio",
    "travel_settings",
    "untestable",
]
