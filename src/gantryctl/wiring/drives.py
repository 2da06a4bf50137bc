"""Drives by their kind in the machine file."""

from __future__ import annotations

from collections.abc import Mapping

from gantryctl import _core
from gantryctl.drives.ideal import IdealDrive
from gantryctl.drives.simulated import SimDrive
from gantryctl.machine import Machine
from gantryctl.ports import Drive
from gantryctl.units import rad
from gantryctl.wiring.canopen import canopen_drive
from gantryctl.wiring.compensation import lead_deg
from gantryctl.wiring.simulator import counts_per_turn, fine_counts_per_turn, gantry_sim, total_ratio


def sim_drive(machine: Machine, angle_deg: float = 0.0, state: Mapping[str, float] | None = None) -> SimDrive:
    """The simulated drive with its gantry, torque off and the brake closed.

    Args:
        angle_deg: where the gantry stands.
        state: a state kept by `SimDrive.sim.state`, to go on from; `angle_deg` is ignored then.

    Raises:
        ValueError: a state that lacks a value or has a non-finite one.
    """
    sim = gantry_sim(machine)
    if state is None:
        sim.static_start(rad(angle_deg), False)
    else:
        sim.state = dict(state)
    return drive_around(machine, sim)


def drive_around(machine: Machine, sim: _core.GantrySim) -> SimDrive:
    """The simulated drive around a plant in any state."""
    return SimDrive(
        sim,
        serial=machine.plant.encoder.serial,
        counts_per_turn=fine_counts_per_turn(machine),
        turns=machine.encoder.turns,
        limit_switch_rad=rad(machine.axis.limit_switch_deg),
    )


def drive_of(machine: Machine) -> Drive:
    """A new drive of the kind that the machine file names; a real one on a bus as it stands."""
    match machine.drive.kind:
        case "ideal":
            return ideal_drive(machine)
        case "sim":
            return sim_drive(machine)
        case "canopen":
            return canopen_drive(machine)


def delivered_zero_counts(machine: Machine, angle_deg: float = 0.0) -> int:
    """Encoder reading at gantry angle 0 of a new machine, zeroed with the load standing at `angle_deg`."""
    if machine.drive.kind == "ideal":
        return _ideal_zero_counts(machine)
    drive = sim_drive(machine, angle_deg)
    at_angle = drive.read().pos_act_counts
    motor_deg = angle_deg + lead_deg(machine, angle_deg)
    per_turn = fine_counts_per_turn(machine)
    fine = round(at_angle - motor_deg / 360.0 * total_ratio(machine) * per_turn)
    return round(fine * counts_per_turn(machine) / per_turn)


def ideal_drive(machine: Machine, angle_deg: float = 0.0) -> IdealDrive:
    """The drive whose actual speed is the command, for trying programs without any plant."""
    return IdealDrive(
        machine.control.scan_period_ms * 1e-3,
        counts_per_turn(machine),
        total_ratio(machine),
        pos_rad=rad(angle_deg),
        zero_counts=float(_ideal_zero_counts(machine)),
        turns=machine.encoder.turns,
        quick_dec_rad_s2=rad(machine.virtual_axis.quick_dec_deg_s2),
    )


def _ideal_zero_counts(machine: Machine) -> int:
    """The middle of the encoder's range."""
    return machine.encoder.turns * counts_per_turn(machine) // 2
