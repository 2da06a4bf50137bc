"""Machine file to a virtual CANopen drive: its hardware, the bus that leads to it, its simulated gantry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from gantryctl.drives.od.object_table import ObjectTable, read_objects_of
from gantryctl.drives.od.velocity_units import unit_of_word
from gantryctl.drives.profiles.dictionary import profile_of_table
from gantryctl.drives.virtual.axis.hardware import Hardware
from gantryctl.drives.virtual.loop import DirectBus
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.group import Neighbours, group_of
from gantryctl.drives.virtual.personality import PLAIN_MODES, Personality, personality
from gantryctl.drives.virtual.side_channel.control import ControlClient, RemotePlant
from gantryctl.machine import Machine, configs_folder
from gantryctl.units import rad, rad_s_from_r_min
from gantryctl.wiring.bus_log import link_log
from gantryctl.wiring.plant_effects import expect_one_pinion
from gantryctl.wiring.simulator import drive_params, limit_switches_rad, plant_params, turned_back
from gantryctl.wiring.virtual_nodes import load_encoder, virtual_neighbours, watchdog_s, wired

if TYPE_CHECKING:
    from gantryctl.drives.canopen.bus.link import BusLink

TABLE_ENDINGS: Final = (".eds", ".dcf", ".csv")
"""How a name of a file with the objects of a drive ends."""


def drive_hardware(machine: Machine, angle_deg: float | None = None) -> Hardware:
    """Motor, brake, encoder and gantry of a machine, at rest at an angle with the brake closed; as `sim_drive`.

    Raises:
        ConfigError: the machine has two pinions: their two drives would be two nodes.
    """
    expect_one_pinion(machine, "a virtual drive on a bus")
    motor, encoder, ratio = machine.motor, machine.encoder, machine.axis.ratio
    return Hardware(
        plant=plant_params(machine),
        drive=drive_params(machine),
        scheme=machine.plant.integration.scheme,
        rk4_steps=machine.plant.integration.rk4_steps,
        fine_counts_per_turn=machine.encoder.fine_counts_per_turn,
        turns=encoder.turns,
        count_offset=float(machine.plant.encoder.mounting_turns * machine.encoder.fine_counts_per_turn),
        motor_sign=-1.0 if machine.can.inverted else 1.0,
        torque_rated_nm=motor.torque_rated_nm,
        torque_max_nm=motor.torque_max_nm,
        overload_time_s=machine.drive.speed_loop.overload_time_s,
        current_rated_a=motor.current_rated_a,
        speed_max_rad_s=rad_s_from_r_min(motor.speed_max_r_min),
        quick_dec_rad_s2=rad(machine.virtual_axis.quick_dec_deg_s2) * ratio,
        normal_acc_rad_s2=rad(machine.virtual_axis.acc_deg_s2) * ratio,
        brake_open_s=machine.brake.open_time_ms * 1e-3,
        brake_close_s=machine.brake.close_time_ms * 1e-3,
        limit_switches_rad=limit_switches_rad(machine),
        brake_owner=machine.brake.owner,
        output_bits=tuple(wired(machine.can.outputs).items()),
        watchdog_s=watchdog_s(machine),
        enable_relay=bool(machine.can.output_place("drive_enable")),
        load_encoder=load_encoder(machine),
        start_angle_rad=rad(machine.axis.start_angle_deg if angle_deg is None else angle_deg),
        encoder_serial=f"SIM-{machine.name}",
    )


def drive_kind(machine: Machine, quirks: Sequence[str] = ()) -> Personality:
    """Model of the virtual drive in this process: that of [can] virtual_drive, with further quirks.

    Raises:
        UsageError: there is no such personality, file, or drive in it.
    """
    named = machine.can.virtual_drive
    if not named:
        return personality(quirks)
    drive, at, file = named.rpartition("@")
    if not at and not named.lower().endswith(TABLE_ENDINGS):
        return personality((*named.split("+"), *quirks))
    table = read_objects_of(Path(file) if file else shipped_objects(), drive)
    return as_in_table(personality(quirks), table, machine)


def shipped_objects() -> Path:
    """Object table of real drives that is delivered with the program."""
    return configs_folder() / "drives" / "objects.csv"


def as_in_table(kind: Personality, table: ObjectTable, machine: Machine) -> Personality:
    """Drive with the dictionary of a real model, and with its profile where there is one.

    Args:
        kind: its quirks, and its unit of speed where neither 60A9 nor a profile says it.
        machine: increments of a turn, and what 1000 of a torque means, as the maker's tool has set them.
    """
    entry = table.entries.get((0x60A9, 0))
    word = entry.default if entry is not None else None
    said = unit_of_word(word) if isinstance(word, int) else None
    made = replace(
        kind,
        name=table.drive if kind.name == "plain" else f"{table.drive}+{kind.name}",
        summary=f"objects of {table.drive}",
        table=table,
        counts_per_turn=machine.can.increments_per_turn,
        torque_reference=machine.can.torque_reference,
        velocity_unit=said or kind.velocity_unit,
    )
    profile = profile_of_table(table)
    if profile is None:
        return made
    plate = (0x1018, 1, profile.match.vendor)
    return replace(
        made,
        defaults=(*kind.defaults, plate),
        modes=(0, *(mode for mode in profile.modes if mode in PLAIN_MODES)),
        velocity_unit=said or profile.units.velocity or kind.velocity_unit,
        ramp_unit=profile.units.ramp,
        ramp_size=profile.units.ramp_size,
        rated_torque_per_nm=profile.units.rated_torque_per_nm,
    )


def virtual_node(
    machine: Machine,
    angle_deg: float | None = None,
    state: Mapping[str, float] | None = None,
    quirks: Sequence[str] = (),
) -> tuple[BusLink, DriveNode]:
    """Bus and booted virtual drive in this process; the arguments of `virtual_bus`."""
    link, drive, _ = virtual_bus(machine, angle_deg, state, quirks)
    return link, drive


def virtual_bus(
    machine: Machine,
    angle_deg: float | None = None,
    state: Mapping[str, float] | None = None,
    quirks: Sequence[str] = (),
) -> tuple[BusLink, DriveNode, Neighbours]:
    """Bus in this process with a booted virtual drive and the nodes beside it.

    Args:
        angle_deg: angle of the standing gantry, as of `sim_drive`.
        state: plant state of an earlier run, to go on from.
        quirks: names of personalities, beside those of [can] virtual_drive.

    Raises:
        UsageError: [can] virtual_drive names no personality, and no table with such a drive.
    """
    # Only this pairing needs the master: the virtual drive itself knows it as little as a real one (decision 0008).
    from gantryctl.drives.canopen.bus.link import BusLink

    bus = DirectBus()
    drive = DriveNode(
        drive_hardware(machine, angle_deg),
        machine.can.node,
        bus.deliver,
        kind=drive_kind(machine, quirks),
        stepped=True,
    )
    if state is not None:
        drive.plant.restore(turned_back(machine, state))
    neighbours = virtual_neighbours(machine, drive, bus.deliver)
    nodes = group_of(drive, neighbours)
    bus.attach(nodes)
    nodes.boot()
    log = link_log("simulated", virtual=True)

    # The link knows the time that it waits; SYNC lets that of the drive go on too.
    def timed(_: float, can_id: int, data: bytes, sent: bool) -> None:
        if log is not None:
            log(nodes.time_us * 1e-6, can_id, data, sent)

    link = BusLink(
        bus,
        advance=lambda seconds: nodes.advance(round(seconds * 1e6)),
        log=None if log is None else timed,
    )
    return link, drive, neighbours


def remote_plant(machine: Machine) -> RemotePlant:
    """Gantry of a virtual drive in another process.

    Raises:
        DeviceError: no drive listens at [can] side_channel.
    """
    return RemotePlant(ControlClient(Path(machine.can.side_channel)))
