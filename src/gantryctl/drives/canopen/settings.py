"""Settings of the master for its drive, in SI at the motor shaft; made by wiring from the machine file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple

from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.od.velocity_units import VELOCITY_UNITS
from gantryctl.drives.profiles import DriveProfile, profile_of
from gantryctl.errors import DeviceError
from gantryctl.image import DriveIdentity
from gantryctl.units import DriveVelocityUnit

BrakeOwner = Literal["drive", "object_60FE", "controller_output"]


class InputBits(NamedTuple):
    """Bits of 60FD, or of 6000 of an I/O node; None for an input that is not wired there."""

    estop_ok: int | None = None
    enabling_switch: int | None = None
    mains_ready: int | None = None
    brake_open: int | None = None
    limit_minus: int | None = 0
    """CiA 402: 1 = limit reached."""
    limit_plus: int | None = 1
    collision_ok: int | None = None
    door_ok: int | None = None
    motion_permit: int | None = None
    estop_ok_2: int | None = None
    watchdog_closed: int | None = None


class OutputBits(NamedTuple):
    """Bits of 60FE:01, or of 6200 of an I/O node; None for an output that is not wired there."""

    brake_release: int | None = None
    watchdog: int | None = None
    drive_enable: int | None = None
    """Of an I/O node only, which takes it off by itself (6206, 6207)."""
    horn: int | None = None
    lamp: int | None = None
    in_position: int | None = None
    at_rest: int | None = None

    @property
    def mask(self) -> int:
        """All bits in use."""
        return sum(1 << bit for bit in self if bit is not None)


class IoNodeSettings(NamedTuple):
    """Node with digital inputs and outputs (CiA 401)."""

    node: int
    inputs: InputBits
    outputs: OutputBits


class LoadEncoderSettings(NamedTuple):
    """Encoder on the ring: 60E4 of the drive, or a node by CiA 406."""

    node: int | None
    """None: 60E4 of the drive."""
    counts_per_turn: int
    zero_counts: int
    inverted: bool


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
_NO_OUTPUTS: Final = OutputBits()


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
    velocity_unit: DriveVelocityUnit | None
    """Of 60FF; None: that of the profile."""
    torque_rated_nm: float
    """For drives without 6076."""
    torque_reference: float
    """What 1000 in 6072, 6077 and 60B2 means, as part of the rated torque."""
    torque_max_nm: float
    quick_dec_rad_s2: float
    speed_ceiling_rad_s: float
    position_around_zero: bool = False
    """6064 runs from minus half the multiturn range to plus half, not from 0."""
    inverted: bool = False
    """The motor's positive direction is the gantry's negative one."""
    brake_owner: BrakeOwner = "drive"
    brake_close_s: float = 0.15
    heartbeat_s: float = 0.05
    heartbeat_timeout_s: float = 0.15
    lone_heartbeat_s: float = 0.15
    """Time-out of our heartbeat in a drive without a deadline of its commands, where it takes that."""
    watched_alone: bool = False
    """This drive is such a one."""
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
    outputs: OutputBits = _NO_OUTPUTS
    io: IoNodeSettings | None = None
    load_encoder: LoadEncoderSettings | None = None
    watchdog_s: float = 0.1
    """Time after which the watchdog relay opens, where one is wired."""
    profile: DriveProfile | None = None
    """What is known of the drive model; None: `of_drive` looks for one."""

    @property
    def brake_by_60fe(self) -> bool:
        """A bit of 60FE works the brake: that of CiA 402, or one that the machine file names."""
        return self.brake_owner == "object_60FE" or self.outputs.brake_release is not None

    @property
    def output_mask(self) -> int:
        """Bits of 60FE in use; bit 0 is the brake of CiA 402."""
        return self.outputs.mask | (self.brake_owner == "object_60FE")

    def of_drive(self, facts: DriveFacts) -> CanopenSettings:
        """The settings for this drive: its profile, unless the machine file names one, and what it watches.

        Args:
            facts: identity, and objects by which models are told apart.
        """
        profile = self.profile if self.profile is not None else profile_of(facts)
        return replace(self, profile=profile, watched_alone=self._watched_alone(facts))

    def _watched_alone(self, facts: DriveFacts) -> bool:
        """The drive holds, or takes, the short time-out of our heartbeat and no deadline of its commands."""
        short = replace(self, watched_alone=True).watched_heartbeat
        return facts.can_hold(0x1016, 1, short) and not facts.can_hold(
            0x1400, 5, round(self.rpdo_deadline_s * 1e3)
        )

    @property
    def watch_s(self) -> float:
        """Time after which this drive misses our heartbeat."""
        return self.lone_heartbeat_s if self.watched_alone else self.heartbeat_timeout_s

    @property
    def watched_heartbeat(self) -> int:
        """1016:01: our node id and the time-out in ms."""
        return self.master_node << 16 | round(self.watch_s * 1e3)

    @property
    def told_speed_unit(self) -> DriveVelocityUnit | None:
        """Unit of 60FF by machine file or profile; None where neither says it."""
        return self.velocity_unit or (None if self.profile is None else self.profile.units.velocity)

    @property
    def speed_unit(self) -> DriveVelocityUnit:
        """Unit of 60FF.

        Raises:
            DeviceError: neither the machine file nor a profile says it.
        """
        unit = self.told_speed_unit
        if unit is None:
            who = (
                "no profile fits this drive"
                if self.profile is None
                else f"profile {self.profile.name} has none"
            )
            raise DeviceError(
                f'the unit of 60FF is not known: [can] velocity_unit = "profile", and {who} · give the unit of the '
                "drive's manual there, or a profile as [can] profile (`gantryctl drive profiles`)"
            )
        return unit

    @property
    def speed_in_increments(self) -> bool:
        """60FF counts increments, so that speed and position agree whatever their number in a turn is."""
        return VELOCITY_UNITS[self.speed_unit].per_increment_s > 0.0

    @property
    def speed_per_rad_s(self) -> float:
        """Units of 60FF in one rad/s."""
        return VELOCITY_UNITS[self.speed_unit].per_rad_s(self.increments_per_turn)

    @property
    def ramp_per_rad_s2(self) -> float:
        """Units of 6085 in one rad/s2."""
        if self.profile is None:
            return self.speed_per_rad_s
        ramp, size = self.profile.units.ramp or self.speed_unit, self.profile.units.ramp_size
        return VELOCITY_UNITS[ramp].per_rad_s(self.increments_per_turn) / size

    @property
    def rated_torque_per_nm(self) -> float:
        """Units of 6076 in one N m."""
        return 1000.0 if self.profile is None else self.profile.units.rated_torque_per_nm

    @property
    def sets_speed_unit(self) -> bool:
        """The controller writes the unit to 60A9."""
        return self.profile is not None and self.profile.units.velocity_by_60A9

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
    texts = {} if settings.profile is None else settings.profile.texts_by_code
    return DriveIdentity(name, f"CAN-{key}", settings.increments_per_turn, turns, texts)
