"""[can]: a CiA 402 drive on a CANopen bus."""

from __future__ import annotations

from typing import Literal

from gantryctl.machine.tables.fields import Table, choice, number, switch, table, text
from gantryctl.units import DriveVelocityUnit


class CanInputsTable(Table):
    """[can.inputs]: bits of object 60FD; -1 = not wired, the input then counts as good."""

    estop_ok: int = number(16, -1, 31, "Bit that is 1 while the emergency-stop chain is closed.")
    enabling_switch: int = number(17, -1, 31, "Bit that is 1 while the enabling switch is held.")
    mains_ready: int = number(18, -1, 31, "Bit that is 1 while the mains are ready.")
    brake_open: int = number(19, -1, 31, "Bit that is 1 while the brake's contact says open.")
    limit_minus: int = number(0, -1, 31, "Bit that is 1 at the negative limit switch.", "standard")
    limit_plus: int = number(1, -1, 31, "Bit that is 1 at the positive limit switch.", "standard")
    # Not on every machine: without a bit there is no such input, and nothing is watched.
    collision_ok: int = number(-1, -1, 31, "Bit that is 1 while no collision sensor is touched.")
    door_ok: int = number(-1, -1, 31, "Bit that is 1 while the room door is closed.")
    motion_permit: int = number(-1, -1, 31, "Bit that is 1 while the room permits motion.")
    estop_ok_2: int = number(-1, -1, 31, "The same as `estop_ok` for a second channel of the chain.")

    watchdog_closed: int = number(
        -1,
        -1,
        31,
        "Bit that is 1 while the contact of the watchdog or enable relay is closed, for its proof.",
    )


class CanOutputsTable(Table):
    """[can.outputs]: bits of object 60FE; -1 = not wired. All are 1 for on, and 0 when the controller is gone."""

    # Bit 0 is the brake of CiA 402, which `[brake] owner = "object_60FE"` works.
    brake_release: int = number(-1, -1, 31, "Relay that gives the brake its current, so that it opens.")
    watchdog: int = number(-1, -1, 31, "Retriggerable watchdog relay: toggled while the controller is well.")
    horn: int = number(-1, -1, 31, "Horn: the load moves, or has moved, without a command.")
    lamp: int = number(-1, -1, 31, "Warning lamp: power is on, the axis may move.")
    in_position: int = number(-1, -1, 31, "The axis stands at its target, within the window.")
    at_rest: int = number(-1, -1, 31, "The axis stands.")


class IoInputsTable(Table):
    """[can.io.inputs]: bits of object 6000 of the I/O node; -1 = not wired there. As in [can.inputs]."""

    estop_ok: int = number(-1, -1, 63, "Emergency-stop chain closed.")
    enabling_switch: int = number(-1, -1, 63, "Enabling switch held.")
    mains_ready: int = number(-1, -1, 63, "Mains ready.")
    brake_open: int = number(-1, -1, 63, "Contact of the brake says open.")
    limit_minus: int = number(-1, -1, 63, "At the negative limit switch.")
    limit_plus: int = number(-1, -1, 63, "At the positive limit switch.")
    collision_ok: int = number(-1, -1, 63, "No collision sensor touched.")
    door_ok: int = number(-1, -1, 63, "Room door closed.")
    motion_permit: int = number(-1, -1, 63, "The room permits motion.")
    estop_ok_2: int = number(-1, -1, 63, "Second channel of the emergency-stop chain closed.")
    watchdog_closed: int = number(-1, -1, 63, "Contact of the watchdog or enable relay closed.")


class IoOutputsTable(Table):
    """[can.io.outputs]: bits of object 6200 of the I/O node; -1 = not wired there. As in [can.outputs]."""

    brake_release: int = number(-1, -1, 63, "Relay that gives the brake its current.")
    watchdog: int = number(-1, -1, 63, "Watchdog relay.")
    drive_enable: int = number(
        -1,
        -1,
        63,
        "Relay of the drive's hardware enable (safe torque off) and of the brake's supply: on while the controller is "
        "well, taken off by the node itself when the controller is gone.",
    )
    horn: int = number(-1, -1, 63, "Horn.")
    lamp: int = number(-1, -1, 63, "Warning lamp.")
    in_position: int = number(-1, -1, 63, "In position.")
    at_rest: int = number(-1, -1, 63, "At rest.")


class CanIoTable(Table):
    """[can.io]: node with digital inputs and outputs (CiA 401) on the SYNC of the drive."""

    node: int = number(0, 0, 127, "Node id, 0 = there is none.")
    inputs: IoInputsTable = table("Bits of object 6000.", IoInputsTable)
    outputs: IoOutputsTable = table("Bits of object 6200.", IoOutputsTable)


class CanLoadEncoderTable(Table):
    """[can.load_encoder]: encoder on the ring, read by the drive or by a node of its own on the same SYNC."""

    source: Literal["none", "60E4", "node"] = choice(
        "none", "Second feedback of the drive (60E4:01), or an encoder node (CiA 406); none = not fitted."
    )
    node: int = number(0, 0, 127, 'Node id of the encoder; only with source = "node".')
    # The virtual ring has 2^26 steps.
    counts_per_turn: int = number(67_108_864, 64, 2**32, "Steps of a turn of the axis.", "catalogue")
    zero_counts: int = number(0, -(2**32), 2**32, "Reading at 0 deg, steps.")
    inverted: bool = switch(False, "true = its positive direction is the axis's negative one.")


class CanEncoderTable(Table):
    """[can.encoder]: the drive's object for the status of its encoder; CiA 402 has none."""

    index: int = number(0, 0, 65_535, "Index of the object, 0 = the drive has none. Decimal: 2110h is 8464.")
    sub: int = number(0, 0, 255, "Sub-index.")
    length: int = number(2, 1, 4, "Bytes of the object.")
    checksum_error: int = number(-1, -1, 31, "Bit that is 1 for a reading with a checksum error, -1 = none.")
    alarm: int = number(-1, -1, 31, "Bit that is 1 while the encoder reports an alarm.")
    warning: int = number(-1, -1, 31, "Bit that is 1 while the encoder warns.")
    battery: int = number(-1, -1, 31, "Bit that is 1 while its battery is empty or missing.")


class CanTable(Table):
    """[can]: bus and drive; read only with [drive] kind = "canopen"."""

    interface: str = text(
        "simulated",
        40,
        'python-can interface (socketcan, udp_multicast, slcan, pcan ...), or "simulated": a virtual drive in this '
        "process, in virtual time.",
    )
    channel: str = text("", 200, "Channel of the interface: can0, a serial port, a multicast address.")
    bitrate: int = number(1_000_000, 10_000, 1_000_000, "Where the interface sets it.", unit="bit/s")
    stepped: bool = switch(
        False, "true = a virtual drive that is stepped by SYNC: virtual time. Never for a real drive."
    )
    node: int = number(2, 1, 127, "Node id of the drive.")
    master_node: int = number(127, 1, 127, "Node id of the controller's heartbeat.")
    eds: str = text("", 200, "EDS of the drive, for `gantryctl can scan` and `drive objects`.")
    # 19 bits, what drives with such an encoder make of a turn; 6064 has 32 bits, so 8192 turns fit.
    increments_per_turn: int = number(524_288, 64, 2**24, "Increments of 6064 per motor turn.", "catalogue")
    # Without a sign most absolute encoders count; a drive whose position was set to 0 somewhere shows both signs.
    position_range: Literal["from 0", "around 0"] = choice(
        "from 0",
        'Where 6064 of the encoder wraps: "from 0" = it runs from 0 to the multiturn range, "around 0" = from minus '
        "half the range to plus half.",
        "catalogue",
    )
    velocity_unit: Literal[DriveVelocityUnit, "profile"] = choice(
        "inc/s",
        "Unit of 60FF, 606C and, where the profile says nothing else, of 6085 per second; "
        '"profile": that of the profile.',
        "catalogue",
    )
    profile: str = text(
        "",
        200,
        "Profile of the drive: a name of `gantryctl drive profiles`, or FILE.toml; empty = chosen by 1018.",
    )
    torque_reference: float = number(
        1.0, 0.1, 10.0, "What 1000 in 6072, 6077 and 60B2 means, as part of the rated torque.", "catalogue"
    )
    torque_limit_in_drive_nm: float = number(
        0.0,
        0.0,
        10_000.0,
        "Torque limit set with the maker's tool, for a drive without 6072, 0 = none; commissioning shows it.",
    )
    inverted: bool = switch(False, "true = the motor's positive direction turns the axis negative.")
    follows_bit: bool = switch(True, "Bit 12 of 6041 says that the drive follows 60FF.", "standard")
    remote_bit: bool = switch(True, "Bit 9 of 6041 says that the drive obeys the bus.", "standard")
    # Three heartbeats must be missing before the other side counts as lost.
    heartbeat_ms: float = number(50.0, 10.0, 1000.0, "Period of both heartbeats.")
    heartbeat_timeout_ms: float = number(
        150.0, 20.0, 5000.0, "Without a heartbeat for this long the other one is lost (1016)."
    )
    # 6 deg/s for 150 ms and the quick stop are 4.23 deg, for 100 ms 3.93 deg. A controller that is 30 ms late stops the
    # axis by itself (SYS-02), so it holds a time of its heartbeat's period and 30 ms.
    heartbeat_alone_ms: float = number(
        100.0,
        20.0,
        5000.0,
        "The same in a drive without a deadline of its commands (1400:05), where it takes the time: two heartbeats at "
        "least, heartbeat_timeout_ms at most.",
    )
    # The drive itself must stop the axis of a controller that is gone: proven when commissioning and after each
    # boot-up of the drive (decision 0012).
    rpdo_deadline_ms: float = number(
        50.0, 2.0, 1000.0, "Without a command for this long the drive stops the axis (1400:05)."
    )
    # A proof shows what the relay really takes.
    watchdog_ms: float = number(
        100.0,
        10.0,
        1000.0,
        "Without an edge for this long the watchdog relay opens; only with such an output.",
    )
    # Reading the answers of the previous SYNC would need no waiting, but feedback would be a period old: 0.024 deg at
    # 6 deg/s and 4 ms (decision 0012).
    answer_ms: float = number(2.0, 0.1, 50.0, "How long a scan waits for the answers to its SYNC.")
    sdo_timeout_ms: float = number(500.0, 10.0, 10_000.0, "For the answer to one SDO request.")
    virtual_drive: str = text(
        "",
        200,
        'Virtual drive of interface "simulated": personalities joined by "+", an EDS, or DRIVE@TABLE.csv with the '
        "shipped table where TABLE is left out; empty = the plain one.",
    )
    side_channel: str = text(
        "", 100, "Socket of a virtual drive's side channel: the true load angle. Never for a real drive."
    )
    commissioning_required: bool = switch(
        True, "false = move without a commissioning record: for virtual drives only."
    )
    # The upper half of 60FD is free for the maker of the drive (CiA 402); bits 0 and 1 are the limit switches.
    inputs: CanInputsTable = table("Bits of object 60FD.", CanInputsTable)
    outputs: CanOutputsTable = table("Bits of object 60FE.", CanOutputsTable)
    encoder: CanEncoderTable = table("Status of the encoder.", CanEncoderTable)
    io: CanIoTable = table("Digital inputs and outputs on a node of their own.", CanIoTable)
    load_encoder: CanLoadEncoderTable = table("Encoder on the ring.", CanLoadEncoderTable)

    def input_place(self, name: str) -> str:
        """Where an input comes from, for people: an object, a bit, a node; "" for one that is not wired."""
        node, drive = getattr(self.io.inputs, name), getattr(self.inputs, name)
        if self.io.node and node >= 0:
            return f"6000 bit {node} of node {self.io.node}"
        return f"60FD bit {drive}" if drive >= 0 else ""

    def output_place(self, name: str) -> str:
        """Where an output goes to, for people; "" for one that is not wired."""
        # No bit of 60FE falls by itself: `drive_enable` is one of the I/O node only.
        node, drive = getattr(self.io.outputs, name), getattr(self.outputs, name, -1)
        if self.io.node and node >= 0:
            return f"6200 bit {node} of node {self.io.node}"
        return f"60FE bit {drive}" if drive >= 0 else ""

    @property
    def lone_heartbeat_ms(self) -> float:
        """Time-out of the controller's heartbeat in a drive that watches nothing else."""
        return min(self.heartbeat_timeout_ms, max(self.heartbeat_alone_ms, 2.0 * self.heartbeat_ms))

    @property
    def simulated(self) -> bool:
        """The drive is a virtual one in this process."""
        return self.interface == "simulated"
