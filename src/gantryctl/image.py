"""Images of a scan: the frozen `InputImage` and the whole `OutputImage`, whose defaults are safe."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, IntFlag
from types import MappingProxyType
from typing import NamedTuple


# All images are NamedTuples: cheap to build in a scan of some 10 us, and impossible to change by accident.
class DriveState(IntEnum):
    """Drive states of CiA 402; UNKNOWN leads to a safe controlword."""

    UNKNOWN = 0
    NOT_READY_TO_SWITCH_ON = 1
    SWITCH_ON_DISABLED = 2
    READY_TO_SWITCH_ON = 3
    SWITCHED_ON = 4
    OPERATION_ENABLED = 5
    QUICK_STOP_ACTIVE = 6
    FAULT_REACTION_ACTIVE = 7
    FAULT = 8


class DriveRequest(IntEnum):
    """Request of the program to the drive, which walks the CiA 402 states; the program never sees a controlword."""

    DISABLE = 0
    """Torque off; a brake owned by the drive closes."""
    ENABLE = 1
    """Operation enabled, following `vel_cmd_rad_s`."""
    QUICK_STOP = 2
    """The drive's own ramp to zero at its quick-stop deceleration, then held at zero speed until DISABLE.

    A drive that owns its brake closes it instead, and leaves for Switch on disabled by itself.
    """
    FAULT_RESET = 3
    """Clear a drive fault; never enables."""


# A checksum error is bridged by a prediction once; an alarm takes the torque off (ENC-03 to ENC-05).
class EncoderFlag(IntFlag):
    """Status of the encoder reading (EnDat style)."""

    NONE = 0
    CRC_ERROR = 1
    ALARM = 2
    WARNING = 4
    BATTERY = 8
    """The battery that keeps the turns is empty or missing; only an encoder with a battery shows it."""


class LinkFlag(IntFlag):
    """Faults of the connection to a drive on a bus."""

    NONE = 0
    HEARTBEAT_LOST = 1
    RESTARTED = 2
    """The drive has booted by itself and lost its mapping."""
    NOT_OPERATIONAL = 4
    BUS_DOWN = 8
    OTHER_MASTER = 16
    """Another node sends frames that only the controller may send."""
    IGNORES_COMMAND = 32
    """The drive is enabled and does not follow the speed command."""
    LATE = 64
    """A telegram of the drive is missing in this scan: see the ages."""
    WRONG_LENGTH = 128
    """Several telegrams of the drive in a row have another length than was mapped."""
    SYNC_UNSEEN = 256
    """Our own SYNC does not appear on the bus."""
    SYNC_JITTER = 512
    """Several SYNC periods in a row are off by more than half."""
    EMERGENCY_FLOOD = 1024
    OVERLOADED = 2048
    """The bus has no room for our frames."""
    WRONG_MODE = 4096
    """The mode display of the drive (6061) is not CSV."""
    LOCAL_CONTROL = 8192
    """The drive does not obey the bus (bit 9 of 6041)."""
    EMERGENCY = 16384
    """The drive complains (EMCY) and shows no fault; `error_code` is its code."""
    STALE_TARGET = 32768
    """The target speed in a drive that is not enabled is not 0 (60FF)."""
    TWO_SENDERS = 65536
    """Telegrams of the drive contradict each other within a SYNC period: another node uses their identifier."""
    BUS_OFF = 131072
    """The controller of the bus has taken itself off it, after too many errors of its own frames."""
    QUEUE_FULL = 262144
    """The transmit queue of the interface is full (ENOBUFS): nobody acknowledges, or the bus is held."""
    ERROR_PASSIVE = 524288
    """The controller of the bus has counted so many errors that it only listens to those of others."""
    IO_LOST = 1048576
    """The node with digital inputs and outputs is not heard: its inputs show their safe state."""
    LOAD_ENCODER_LOST = 2097152
    """The encoder node on the ring is not heard."""
    NEVER_FOLLOWED = 4194304
    """The drive is enabled, and the bit for "follows the command" has not come since (bit 12 of 6041)."""


class DigitalInputs(NamedTuple):
    """Hard-wired inputs; False is the safe state of each, None an input that the machine does not have."""

    estop_ok: bool = True
    enabling_switch: bool = True
    limit_minus_ok: bool = True
    limit_plus_ok: bool = True
    mains_ready: bool = True
    collision_ok: bool | None = None
    """Collision sensors of gantry and couch free."""
    door_ok: bool | None = None
    """Room door closed."""
    estop_ok_2: bool | None = None
    """Second channel of the emergency-stop chain."""
    motion_permit: bool | None = None
    """The room permits motion; without it nothing moves, and torque may stay on."""

    @property
    def estop_closed(self) -> bool:
        """Every channel of the emergency-stop chain is closed."""
        return self.estop_ok and self.estop_ok_2 is not False


class DriveFeedback(NamedTuple):
    """Feedback of a drive in one scan, motor side; the unit of position is the fine count of the encoder."""

    state: DriveState
    pos_act_counts: float
    """Continuous count since the zero of the encoder, `DriveIdentity.counts_per_turn` to a motor turn."""
    # A whole number, exact up to 2^53; only the ideal encoder of a simulator gives fractions.
    vel_act_rad_s: float
    torque_act_nm: float
    # Without a contact the drive reports what the brake must have done.
    brake_open: bool
    """Brake feedback contact: True when the brake is open."""
    torque_limited: bool
    overload: float
    """Part of the drive's I2t budget used, 0..1."""
    encoder: EncoderFlag = EncoderFlag.NONE
    error_code: int = 0
    warning: bool = False
    age_scans: int = 0
    """Age of state, position and torque in scans: 0 when they belong to this scan."""
    inputs: DigitalInputs = DigitalInputs()
    pos_ring_rad: float = 0.0
    """Second, load-side encoder at the gantry, zeroed at 0 deg; 0 without one, NaN for an invalid reading."""
    link: LinkFlag = LinkFlag.NONE
    changed: str = ""
    """Parameter of the drive that differs from its set value: which, want, have."""
    motor_temp_c: float | None = None
    """Temperature of the winding; None without a sensor, out of any range for one that is open or shorted."""
    speed_age_scans: int = 0
    inputs_age_scans: int = 0
    """Age of inputs and brake contact."""
    brake_contact: bool = True
    """False without a contact: `brake_open` is what the brake must have done."""
    spread_scans: float = 0.0
    """Time between this sample and the one before, beyond that between their scans, in scans; 0 where it keeps time."""
    foreign_id: int = -1
    """Identifier of the first frame from elsewhere that only the controller may send; -1 before."""


class DriveIdentity(NamedTuple):
    """Identity of the drive behind a port; read once, before the first scan."""

    name: str
    encoder_serial: str
    counts_per_turn: int
    """Fine counts per motor turn (2048 lines x 2048 for the simulated drive)."""
    turns: int
    """Multiturn range in motor turns; the absolute reading wraps after `turns` turns."""
    error_texts: Mapping[int, str] = MappingProxyType({})
    """The maker's words for error codes of its own."""


class NodeHealth(NamedTuple):
    """Node beside the drive on its bus; ages in scans."""

    node: int
    key: str
    """Vendor, product and serial number."""
    received: int
    missed: int
    longest_age_scans: int


class LinkHealth(NamedTuple):
    """State of the connection to a drive on a bus; ages in scans, one figure per telegram (TPDO) of the drive."""

    drive_key: str
    """Vendor, product and serial number, which distinguish one drive from another."""
    software: str = ""
    """Firmware version of the drive, "" where it has none."""
    restart_marker: int | None = None
    """Number that the controller has left in the drive; a restart of the drive erases it."""
    heartbeat_age_scans: int = 0
    scans: int = 0
    received: tuple[int, ...] = ()
    missed: tuple[int, ...] = ()
    late: tuple[int, ...] = ()
    duplicated: tuple[int, ...] = ()
    wrong_length: tuple[int, ...] = ()
    contradicted: tuple[int, ...] = ()
    """Telegrams that contradict the answer to the same SYNC."""
    longest_age_scans: tuple[int, ...] = ()
    boots: int = 0
    foreign: int = 0
    """Frames on identifiers that only the controller may send."""
    unknown: int = 0
    """Frames on identifiers without a meaning here, those included that a filter in the kernel kept away."""
    refused: int = 0
    """Frames that the bus did not take."""
    queue_full: int = 0
    """Of these, for a full transmit queue."""
    bus_offs: int = 0
    passives: int = 0
    """Times that the controller of the bus went error passive."""
    emergencies: int = 0
    messages: tuple[str, ...] = ()
    """The last emergency messages of the drive, in words."""
    nodes: tuple[NodeHealth, ...] = ()

    @property
    def node_keys(self) -> tuple[str, ...]:
        """The nodes beside the drive, each with its id, vendor, product and serial number."""
        return tuple(f"{node.node} {node.key}" for node in self.nodes)

    def lines(self) -> tuple[str, ...]:
        """For people: a row per telegram, totals, and the complaints of the drive."""
        columns = (
            self.received, self.missed, self.late, self.duplicated, self.wrong_length, self.contradicted,
            self.longest_age_scans,
        )  # fmt: skip
        rows = [
            f"TPDO {n}: {got} of {self.scans} in time or late, {missed} missed, {late} late, {twice} twice, "
            f"{length} of a wrong length, {other} contradicted, oldest {age} scans"
            for n, (got, missed, late, twice, length, other, age) in enumerate(
                zip(*columns, strict=True), start=1
            )
        ]
        rows += [
            f"node {node.node}: {node.received} of {self.scans} in time or late, {node.missed} missed, "
            f"oldest {node.longest_age_scans} scans"
            for node in self.nodes
        ]
        rest = (
            f"emergency messages {self.emergencies}, telegrams refused by the bus {self.refused}, "
            f"frames of others {self.unknown}, frames that only the controller may send {self.foreign}"
        )
        return (*rows, rest, *self._adapter(), *self.messages)

    def _adapter(self) -> tuple[str, ...]:
        """What went wrong at the controller of the bus; empty where nothing did."""
        found = {
            "bus-off": self.bus_offs,
            "error passive": self.passives,
            "transmit queue full (ENOBUFS)": self.queue_full,
        }
        told = ", ".join(f"{what} {count} times" for what, count in found.items() if count)
        return (f"CAN controller: {told}",) if told else ()


# The mode is not retained: after a start the operator chooses it again.
class Mode(IntEnum):
    """Motion mode of `GantryProgram`. After a start the mode is NONE and nothing moves."""

    NONE = 0
    CONTINUOUS = 1
    INCREMENTAL = 2


class Direction(IntEnum):
    """Way of a modulo axis to an angle, with the names and numbers of PLCopen's Direction input."""

    POSITIVE = 1
    SHORTEST = 2
    NEGATIVE = 3
    CURRENT = 4
    """That of the motion under way; at rest, of the last one since the start, which begins as positive."""


class BufferMode(IntEnum):
    """When a motion begins, with the names and numbers of PLCopen's BufferMode input; there is no blending."""

    ABORTING = 0
    """At once; the motion under way is aborted."""
    BUFFERED = 1
    """After the motion under way: once that is done, or, without an end, once it has its speed."""


class OperatorCommand(NamedTuple):
    """Command levels of the operator, angles at the gantry."""

    # Levels, not events: the program finds the edges, so a command that is read twice acts once.

    power: bool = False
    mode: Mode = Mode.NONE
    forward: bool = False
    reverse: bool = False
    speed_rad_s: float = 0.0
    increment_rad: float = 0.0
    move: bool = False
    """A rising edge starts MoveAbsolute to `target_rad` (any mode, at standstill or aborting a move)."""
    target_rad: float = 0.0
    direction: Direction | None = None
    """Of `move`; None takes the shortest way of a modulo axis, and the only one of a linear axis."""
    relative: bool = False
    """`target_rad` is a way from the set-point, of a modulo axis also beyond a turn: `move` starts MoveRelative."""
    halt: bool = False
    """Controlled stop on the normal ramp; the axis stays enabled."""
    stop: bool = False
    """Stop on the jog-release ramp, held in Stopping while TRUE."""
    quick_stop: bool = False
    reset: bool = False
    brake_test: bool = False
    """A rising edge tests the brake; power must be off."""
    override: float = 1.0
    """Speed override 0..1."""
    lease: int = 0
    """Hold-to-run: a new value renews the lease ([monitors] lease_ms); an unchanged value lets it run out."""
    lease_age_s: float = 0.0
    """So much of the lease had passed when it was renewed: age of what the person saw who holds the key."""
    remote: bool = False
    """The operator sits at a remote screen: moves need the enabling switch as motion by hand does."""


class StopCause(IntEnum):
    """Cause of a stop that the engine asks for, because of itself and not of the axis."""

    SCAN_LATE = 1
    """A scan began later than permitted, s."""
    OVERRUNS = 2
    """Too many scans of the last second ended after the next one was due."""
    FROZEN = 3
    """The controller did not run at all for some time, s."""


class SystemStop(NamedTuple):
    """Stop that the engine asks for: the cause, what was measured, and its limit."""

    cause: StopCause
    measured: float
    limit: float
    time_s: float
    """Nominal time of the scan that began it."""


class InputImage(NamedTuple):
    """Everything one scan may know; with the retained state it determines the outputs."""

    # Scan k stands for t = k x period, never for a sum of periods (decision 0005).
    scan: int
    """One more than before; more than one where scans were missed while the axis went on (decision 0005)."""
    time_s: float
    """Nominal time of this scan: `scan * scan period`."""
    drive: DriveFeedback
    operator: OperatorCommand
    system_stop: SystemStop | None = None
    """What the engine stops the axis for; the same object in every scan until somebody has acknowledged it."""


class OutputImage(NamedTuple):
    """Outputs of one scan to the drive; the defaults are safe: torque off, brake closed, no speed."""

    request: DriveRequest = DriveRequest.DISABLE
    vel_cmd_rad_s: float = 0.0
    """Speed command, motor side."""
    torque_ff_nm: float = 0.0
    """Torque preload or feed-forward, motor side (CiA 402: 60B2)."""
    brake_open: bool = False
    """Brake release command; a drive that owns the brake may ignore it while not enabled."""
    horn: bool = False
    """The load moves, or has moved, without a command: people must leave. Until service resets."""
    lamp: bool = False
    """Power is on or goes on: the load may move."""
    in_position: bool = False
    """The load stands at its target, within the window."""
    at_rest: bool = False
    """The load is commanded to stand, and the motor stands."""
    torque_holds: bool = False
    """Torque at zero speed holds the load alone: its brake is not trusted. No output of the machine."""
    at_once: bool = False
    """With DISABLE: the torque goes now, whatever order its way down has begun in. No output of the machine."""


SAFE_OUTPUT = OutputImage()
