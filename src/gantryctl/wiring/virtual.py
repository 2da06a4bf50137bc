"""Machine file to a virtual CANopen drive: its hardware, the bus that leads to it, its simulated gantry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gantryctl.drives.virtual.axis.hardware import Hardware
from gantryctl.drives.virtual.loop import DirectBus
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.personality import personality
from gantryctl.drives.virtual.side_channel.control import ControlClient, RemotePlant
from gantryctl.errors import UsageError
from gantryctl.machine import Machine
from gantryctl.units import rad, rad_s_from_r_min
from gantryctl.wiring.simulator import drive_params, plant_params

if TYPE_CHECKING:
    from gantryctl.drives.canopen.bus.link import BusLink


def drive_hardware(machine: Machine, start_angle_rad: float = 0.0) -> Hardware:
    """Motor, brake, encoder and gantry of a machine, at rest at an angle with the brake closed.

    Raises:
        UsageError: an output of the controller works the brake, and no wire leads from it to a virtual drive.
    """
    owner = machine.brake.owner
    if owner == "controller_output":
        raise UsageError(
            '[brake] owner = "controller_output": there is no wire from a controller to a virtual drive; '
            'use "drive" or "object_60FE"'
        )
    motor, encoder, ratio = machine.motor, machine.encoder, machine.axis.ratio
    return Hardware(
        plant=plant_params(machine),
        drive=drive_params(machine),
        scheme=machine.plant.integration.scheme,
        rk4_steps=machine.plant.integration.rk4_steps,
        fine_counts_per_turn=machine.encoder.fine_counts_per_turn,
        turns=encoder.turns,
        count_offset=float(machine.plant.encoder.mounting_turns * machine.encoder.fine_counts_per_turn),
        torque_rated_nm=motor.torque_rated_nm,
        torque_max_nm=motor.torque_max_nm,
        overload_time_s=machine.drive.speed_loop.overload_time_s,
        current_rated_a=motor.current_rated_a,
        speed_max_rad_s=rad_s_from_r_min(motor.speed_max_r_min),
        quick_dec_rad_s2=rad(machine.virtual_axis.quick_dec_deg_s2) * ratio,
        normal_acc_rad_s2=rad(machine.virtual_axis.acc_deg_s2) * ratio,
        brake_open_s=machine.brake.open_time_ms * 1e-3,
        brake_close_s=machine.brake.close_time_ms * 1e-3,
        limit_switch_rad=rad(machine.axis.limit_switch_deg),
        brake_owner=owner,
        start_angle_rad=start_angle_rad,
        encoder_serial=f"SIM-{machine.name}",
    )


def virtual_node(
    machine: Machine,
    angle_deg: float = 0.0,
    state: Mapping[str, float] | None = None,
    quirks: Sequence[str] = (),
) -> tuple[BusLink, DriveNode]:
    """Bus and booted virtual drive in this process.

    Args:
        angle_deg: angle of the standing gantry.
        state: plant state of an earlier run, to go on from.
        quirks: names of personalities.
    """
    # Only this pairing needs the master: the virtual drive itself knows it as little as a real one (decision 0008).
    from gantryctl.drives.canopen.bus.link import BusLink

    bus = DirectBus()
    node = DriveNode(
        drive_hardware(machine, rad(angle_deg)),
        machine.can.node,
        bus.deliver,
        kind=personality(quirks),
        stepped=True,
    )
    if state is not None:
        node.plant.restore(state)
    bus.attach(node)
    node.boot()
    return BusLink(bus, advance=lambda seconds: node.advance(round(seconds * 1e6))), node


def remote_plant(machine: Machine) -> RemotePlant:
    """Gantry of a virtual drive in another process.

    Raises:
        DeviceError: no drive listens at [can] side_channel.
    """
    return RemotePlant(ControlClient(Path(machine.can.side_channel)))
