"""Machine file to engine: the only place that chooses concrete parts."""

from gantryctl.wiring.canopen import (
    SIMULATED,
    SimulatedCanDrive,
    can_link,
    canopen_drive,
    canopen_settings,
    in_virtual_time,
    look_at_drive,
    virtual_node,
)
from gantryctl.wiring.compensation import check_calibration, compensation, lead_deg
from gantryctl.wiring.drives import delivered_zero_counts, drive_around, drive_of, ideal_drive, sim_drive
from gantryctl.wiring.engine import ProgramFactory, RecorderFactory, build_engine
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
    "SIMULATED",
    "ProgramFactory",
    "RecorderFactory",
    "SimulatedCanDrive",
    "axis_settings",
    "build_engine",
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
    "in_virtual_time",
    "lead_deg",
    "look_at_drive",
    "motion_limits",
    "plant_params",
    "position_law",
    "ramps_deg",
    "sim_drive",
    "speed_settings",
    "total_ratio",
    "travel_settings",
    "untestable",
    "virtual_node",
]
