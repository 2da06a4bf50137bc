"""Hardware behind the virtual drive: name plates and plant parameters, SI at the motor; made by wiring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gantryctl import _core


@dataclass(frozen=True)
class Hardware:
    """Motor, encoder, brake, drive and gantry of one axis.

    The plant comes as parameters, not as a ready `GantrySim`: torque limit and ramp of a `GantrySim` are fixed, and a
    bus writes 6072 and 6085 at any time.
    """

    plant: _core.PlantParams
    drive: _core.DriveParams
    scheme: str
    rk4_steps: int
    fine_counts_per_turn: int
    """Counts of the plant's own encoder evaluation."""
    turns: int
    """Multiturn range."""
    count_offset: float
    """How the encoder is mounted, fine counts."""
    torque_rated_nm: float
    torque_max_nm: float
    overload_time_s: float
    current_rated_a: float
    speed_max_rad_s: float
    """The motor's highest permitted speed."""
    quick_dec_rad_s2: float
    normal_acc_rad_s2: float
    brake_open_s: float
    brake_close_s: float
    limit_switch_rad: float
    """Both limit switches, at the gantry."""
    brake_owner: Literal["drive", "object_60FE"] = "drive"
    start_angle_rad: float = 0.0
    encoder_serial: str = "SIM-0001"
    serial_number: int = 1
    tick_s: float = 1e-3
    """Period of the drive's own state machine; a whole number of speed-loop cycles."""
