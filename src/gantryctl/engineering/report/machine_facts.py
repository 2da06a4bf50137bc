"""What tells one machine from another, for the head of its reports."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from gantryctl.errors import StateError
from gantryctl.machine import Machine, config_hash
from gantryctl.operation.proofs import load_record, record_path
from gantryctl.runtime import RetainedMemory


class Serials(NamedTuple):
    """Serial numbers as far as they are known; "" where they are not.

    Attributes:
        drive: vendor, product and serial number of object 1018.
    """

    drive: str = ""
    encoder: str = ""


def known_serials(machine: Machine, directory: Path) -> Serials:
    """Serial numbers that earlier runs and commissioning have left in the directory of the machine's retained state."""
    if not directory.is_dir():
        return Serials()
    try:
        record = load_record(record_path(directory, machine))
        retained = RetainedMemory(directory).load()
    # A report needs no state: the commands that move tell what is damaged.
    except StateError:
        return Serials()
    return Serials(
        drive=record.drive if record else "",
        encoder=retained.encoder_serial if retained else "",
    )


def machine_facts(machine: Machine, serials: Serials) -> tuple[tuple[str, str], ...]:
    """Name and value of what identifies a machine."""
    motor, axis, calibration = machine.motor, machine.axis, machine.calibration
    rows = [
        ("Machine", machine.name),
        ("Description", machine.machine.description),
        ("Inertia of the load", f"{machine.plant.load.inertia_kg_m2:.6g} kg m²"),
        (
            "Motor",
            f"{motor.power_rated_kw:g} kW, {motor.torque_rated_nm:g} N m at {motor.speed_rated_r_min:g} r/min, "
            f"rotor {motor.inertia_kg_m2:g} kg m²",
        ),
        ("Transmission", f"{axis.reducer_ratio:g} × {axis.ring_ratio:g} = {axis.ratio:g}"),
        ("Drive", _drive(machine, serials)),
        ("Motor encoder", serials.encoder and f"serial number {serials.encoder}"),
        (
            "Calibration",
            "none"
            if calibration is None
            else f"{machine.control.compensation.calibration}, version {calibration.origin.version} of "
            f"{calibration.origin.date}, with {calibration.origin.instrument}",
        ),
        ("Machine file, SHA-256", config_hash(machine)),
    ]
    return tuple((name, value) for name, value in rows if value)


def _drive(machine: Machine, serials: Serials) -> str:
    kind = {"sim": "simulated", "ideal": "ideal", "canopen": "CANopen"}[machine.drive.kind]
    if machine.on_bus and machine.plant_is_local:
        kind = "CANopen, simulated"
    return f"{kind}, {serials.drive}" if serials.drive else kind
