"""Settings of the master for its drive, in SI at the motor shaft; made by wiring from the machine file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from gantryctl.image import DriveIdentity
from gantryctl.units import DriveVelocityUnit

BrakeOwner = Literal["drive", "object_60FE"]


class InputBits(NamedTuple):
    """Bits of 60FD; None for an input that is not wired: the first five then count as good."""

    estop_ok: int | None = None
    enabling_switch: int | None = None
    mains_ready: int | None = None
    brake_open: int | None = None
    limit_minus: int | None = 0
    """CiA 402: 1 = limit reached."""
    limit_plus: int | None = 1
    collision_ok: int | None = None
    door_ok: int | None = None
    estop_ok_2: int | None = None


class EncoderStatus(NamedTuple):
    """Object of the drive for the status of its encoder, 0 without one, and its bits; -1 for a bit that it has not."""

    obj: int = 0
    sub: int = 0
    length: int = 2
    """Bytes."""
    checksum_error: int = -1
    alarm: int = -1
    warning: int = -1
    battery: int = -1


_NO_STATUS: Final = EncoderStatus()
_NOTHING_WIRED: Final = InputBits()


@dataclass(frozen=True, slots=True)
class CanopenSettings:
    """Settings of one drive on one bus."""

    period_s: float
    """Scan and SYNC period."""
    node: int
    master_node: int
    """Node id of the controller's heartbeat."""
    increments_per_turn: int
    """Of 6064, per motor turn."""
    turns: int
    """Multiturn range in motor turns."""
    velocity_unit: DriveVelocityUnit
    torque_rated_nm: float
    """For drives without 6076."""
    torque_reference: float
    """What 1000 in 6072, 6077 and 60B2 means, as part of the rated torque."""
    torque_max_nm: float
    quick_dec_rad_s2: float
    speed_ceiling_rad_s: float
    inverted: bool = False
    """The motor's positive direction is the gantry's negative one."""
    brake_owner: BrakeOwner = "drive"
    brake_close_s: float = 0.15
    heartbeat_s: float = 0.05
    heartbeat_timeout_s: float = 0.15
    rpdo_deadline_s: float = 0.05
    answer_s: float = 0.002
    """Longest time a scan waits for the answers to its SYNC."""
    sdo_timeout_s: float = 0.5
    follows_bit: bool = True
    """Bit 12 of 6041 says whether the drive follows 60FF."""
    remote_bit: bool = True
    """Bit 9 of 6041 says whether the drive obeys the bus."""
    bitrate: int = 1_000_000
    inputs: InputBits = _NOTHING_WIRED
    encoder: EncoderStatus = _NO_STATUS

    @property
    def heartbeat_scans(self) -> int:
        """Scans between two heartbeats of the controller."""
        return max(1, round(self.heartbeat_s / self.period_s))

    @property
    def timeout_scans(self) -> int:
        """Scans without a heartbeat of the drive until it counts as lost."""
        return max(2, round(self.heartbeat_timeout_s / self.period_s))


def drive_identity(settings: CanopenSettings, name: str, key: str) -> DriveIdentity:
    """Identity as the program sees it."""
    # CiA 402 has no object for the serial number of an encoder: that of the drive stands for it. And 6064 has 32 bits:
    # whatever the encoder counts beyond them is not on the bus.
    turns = min(settings.turns, (1 << 32) // settings.increments_per_turn)
    return DriveIdentity(name, f"CAN-{key}", settings.increments_per_turn, turns)
