"""Hardware behind the virtual drive: name plates and plant parameters in SI at the motor, and units on the bus."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from gantryctl import _core
from gantryctl.drives.od.velocity_units import VELOCITY_UNITS
from gantryctl.drives.virtual.personality import Personality
from gantryctl.units import DriveVelocityUnit, r_min_from_rad_s, rad_s_from_r_min


class LoadEncoder(NamedTuple):
    """Encoder on the ring: of the simulated gantry, and the steps of a turn that its bus reading has."""

    step_rad: float
    noise_rad: float
    latency_s: float
    scale: tuple[tuple[float, float, float], ...]
    """Scale error: waves per turn, amplitude in rad, phase in rad."""
    counts: int
    offset: int
    """Count at 0 rad."""
    inverted: bool
    """It counts down where the gantry goes forward."""


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
    motor_sign: float
    """-1.0: the drive's positive direction turns the axis negative; its counts, speeds and torques are its own."""
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
    limit_switches_rad: tuple[float, float]
    """Lower and upper limit switch, at the gantry."""
    brake_owner: Literal["drive", "object_60FE", "controller_output"] = "drive"
    output_bits: tuple[tuple[str, int], ...] = ()
    """Outputs of the cabinet that are wired to bits of 60FE, by name."""
    enable_relay: bool = False
    """An output of the I/O node holds the safe-torque-off circuit and the supply of the brake closed."""
    watchdog_s: float = 0.0
    """Time after which the watchdog relay opens; 0: none is fitted."""
    load_encoder: LoadEncoder | None = None
    start_angle_rad: float = 0.0
    encoder_serial: str = "SIM-0001"
    serial_number: int = 1
    tick_s: float = 1e-3
    """Period of the drive's own state machine; a whole number of speed-loop cycles."""


_I32: Final = 1 << 31


def wrap_i32(value: int) -> int:
    """Value of a 32-bit counter that wraps."""
    return (value + _I32) % (2 * _I32) - _I32


def clamp_int(value: float, low: int, high: int) -> int:
    """Value rounded and limited to a range; 0 if not finite."""
    if not math.isfinite(value):
        return 0
    return max(low, min(high, round(value)))


class Scaling:
    """Conversions of one drive: increments, velocity units, per mille of torque; nothing else converts.

    Args:
        hardware: name plates.
        kind: units of the drive model.
    """

    def __init__(self, hardware: Hardware, kind: Personality) -> None:
        self._kind, self.counts_per_turn = kind, kind.counts_per_turn
        self._fine = hardware.fine_counts_per_turn
        self.count_speed_in(kind.velocity_unit)
        self.torque_unit_nm = hardware.torque_rated_nm * kind.torque_reference / 1000.0

    def count_speed_in(self, unit: DriveVelocityUnit) -> None:
        """Take another unit of speed, by 60A9."""
        self.velocity_unit = unit
        self.per_rad_s = VELOCITY_UNITS[unit].per_rad_s(self.counts_per_turn)
        self.ramp_per_rad_s2 = (
            VELOCITY_UNITS[self._kind.ramp_unit or unit].per_rad_s(self.counts_per_turn)
            / self._kind.ramp_size
        )

    def increments(self, fine_counts: float) -> int:
        """Whole increments of 6064, unwrapped."""
        # An encoder counts completed increments: the fraction is cut towards minus infinity on both sides of zero.
        return math.floor(fine_counts * self.counts_per_turn / self._fine)

    def velocity(self, rad_s: float) -> int:
        """Velocity in units of 606C."""
        return clamp_int(rad_s * self.per_rad_s, -_I32, _I32 - 1)

    def rad_s(self, units: int) -> float:
        """Velocity from units of 60FF."""
        return units / self.per_rad_s

    def unsigned(self, rad_s: float) -> int:
        """607F: at least 1."""
        return clamp_int(rad_s * self.per_rad_s, 1, 2 * _I32 - 1)

    def rad_s2(self, units: int) -> float:
        """Acceleration from units of 6083 to 6085."""
        return units / self.ramp_per_rad_s2

    def ramp(self, rad_s2: float) -> int:
        """6083 to 6085: at least 1."""
        return clamp_int(rad_s2 * self.ramp_per_rad_s2, 1, 2 * _I32 - 1)

    def torque(self, nm: float) -> int:
        """6077, 1/1000 of the reference."""
        return clamp_int(nm / self.torque_unit_nm, -32768, 32767)

    def nm(self, units: int) -> float:
        """6072 and 60B2."""
        return units * self.torque_unit_nm


def r_min(rad_s: float) -> int:
    """Units of 6080, r/min in every drive."""
    return clamp_int(r_min_from_rad_s(rad_s), 1, 2 * _I32 - 1)


def rad_s_of_r_min(speed: int) -> float:
    """6080 to rad/s."""
    return rad_s_from_r_min(float(speed))
