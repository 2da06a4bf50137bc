"""What of an axis decides which monitor sees a fault first."""

from __future__ import annotations

from typing import Final

from gantryctl.machine import Machine
from gantryctl.units import deg
from gantryctl.wiring.program import axis_settings
from gantryctl.wiring.simulator import eccentric_moment_nm

# DRV-13 asks for a torque of nothing for so long, off the command by a tenth of the permitted deviation
# (`program.monitors.torque`).
_LOST_S: Final = 0.050
_OFF_COMMAND_SHARE: Final = 0.1


def brake_outruns_the_reading(machine: Machine) -> bool:
    """Its brake changes the speed of the bare rotor by more in a scan than ENC-14 lets pass."""
    return _outruns_the_reading(machine, machine.brake.torque_nm)


def drive_outruns_the_reading(machine: Machine) -> bool:
    """Its drive, at the torque limit, changes the speed of the bare rotor by more in a scan than ENC-14 lets pass."""
    return _outruns_the_reading(machine, machine.motor.torque_max_nm)


def _outruns_the_reading(machine: Machine, torque_nm: float) -> bool:
    settings = axis_settings(machine)
    change = _rotor_acc_deg_s2(machine, torque_nm) * settings.period_s
    stop = machine.virtual_axis.quick_dec_deg_s2 * settings.period_s
    return change > deg(settings.monitors.speed_change_base_rad_s) + stop


def moment_turns_the_axis(machine: Machine) -> bool:
    """Its eccentric moment is above its friction."""
    return abs(eccentric_moment_nm(machine)) / machine.axis.ratio > friction_nm(machine)


def friction_stops_the_rotor(machine: Machine) -> bool:
    """Without torque it leaves the permitted deviation, for its time, before the 50 ms of DRV-13 are over."""
    monitors, dec = machine.monitors, _rotor_acc_deg_s2(machine, friction_nm(machine))
    left_s = monitors.velocity_deviation_deg_s / dec + 1e-3 * monitors.velocity_deviation_time_ms
    lost_s = _OFF_COMMAND_SHARE * monitors.velocity_deviation_deg_s / dec + _LOST_S
    return left_s < lost_s


def _rotor_acc_deg_s2(machine: Machine, torque_nm: float) -> float:
    return deg(torque_nm / (machine.motor.inertia_kg_m2 * machine.axis.ratio))


def friction_nm(machine: Machine, vel_motor_rad_s: float = 0.0) -> float:
    """Running friction of motor and bearing, where the plant has them, N m at the motor; of a slow motion where no
    speed is given.
    """
    plant, ratio = machine.plant, machine.axis.ratio
    motor, has_motor = plant.motor_friction, plant.switches.motor_friction
    roller, has_roller = plant.roller_friction, plant.switches.roller_friction
    viscous = motor.viscous_nm_s_per_rad * has_motor + roller.viscous_nm_s_per_rad / ratio**2 * has_roller
    return (
        motor.coulomb_nm * has_motor + roller.coulomb_nm / ratio * has_roller + viscous * abs(vel_motor_rad_s)
    )
