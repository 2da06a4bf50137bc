"""Motors as data: one TOML file each, with where its figures come from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from pydantic import Field

from gantryctl.engineering.sizing.equations import power_kw
from gantryctl.errors import ConfigError
from gantryctl.machine import configs_folder, load_table
from gantryctl.machine.reading import parse_toml, read_text
from gantryctl.machine.tables.axis import IdentityTable
from gantryctl.machine.tables.fields import Table, number, required_number, table
from gantryctl.machine.tables.motor import MotorTable


class MotorIdentity(IdentityTable):
    """[identity]: what the motor is, and where its figures come from."""

    source: str = Field(
        min_length=1,
        max_length=300,
        examples=["paper"],
        description="Where the figures come from; which of them are estimates.",
    )
    mass_kg: float = required_number(230.0, 1e-3, 1e5, "Mass of the motor.")


class MotorDrive(Table):
    """[drive]: what motor and drive give together."""

    overload_time_s: float = number(60.0, 0.1, 600.0, "How long the highest torque may be drawn.", "estimate")


class MotorEncoder(Table):
    """[encoder]: the encoder that the motor comes with."""

    counts_per_turn: int = required_number(8192, 64, 2**25, "Absolute steps per motor turn.")
    turns: int = required_number(4096, 1, 2**24, "Motor turns told apart.")
    lines: int = required_number(2048, 1, 2**20, "Sine/cosine lines per motor turn.", unit="1/turn")
    interpolation: int = required_number(2048, 1, 65536, "Interpolated steps per line.")


class MotorBrake(Table):
    """[brake]: the holding brake that the motor comes with."""

    torque_nm: float = required_number(400.0, 1e-3, 1e6, "Torque of the closed brake at the motor.")
    close_time_ms: float = required_number(150.0, 1.0, 10000.0, "From command to full torque.")
    open_time_ms: float = required_number(100.0, 1.0, 10000.0, "From command to no torque.")


class MotorFile(Table):
    """One motor with its encoder and brake."""

    identity: MotorIdentity = table("What it is.")
    motor: MotorTable = table("Name plate; the same table as in a machine file.")
    drive: MotorDrive = table("Motor and drive together.", MotorDrive)
    encoder: MotorEncoder = table("Its encoder.")
    brake: MotorBrake = table("Its brake.")

    @property
    def name(self) -> str:
        """Name of the motor."""
        return self.identity.name

    def torque_at_nm(self, torque_nm: float, speed_r_min: float) -> float:
        """What is left of a torque at a speed: above the rated speed the power stays, the torque falls."""
        share = min(1.0, self.motor.speed_rated_r_min / speed_r_min) if speed_r_min > 0.0 else 1.0
        return torque_nm * share


def delivered_motors() -> list[Path]:
    """The motor files delivered with the program, by name."""
    return sorted((configs_folder() / "motors").glob("*.toml"))


# A shell expands `--motor motors/*.toml` to one option and further arguments: the content tells what each is.
def is_motor_file(path: Path) -> bool:
    """Whether a TOML file describes a motor (it has a table [motor]) and not a requirement sheet.

    Raises:
        ConfigError: the file cannot be read, or is a machine file.
    """
    data = parse_toml(read_text(path, ""), str(path))
    if "machine" in data:
        raise ConfigError(
            [
                f"{path}: is a machine file; `gantryctl size` takes a requirement sheet, machine files are its result"
            ]
        )
    return "motor" in data and "sheet" not in data


def load_motors(paths: Sequence[Path]) -> list[MotorFile]:
    """Read motor files.

    Raises:
        ConfigError: one line per problem of all files; two motors of one name are a problem.
    """
    motors: dict[str, MotorFile] = {}
    lines: list[str] = []
    for path in dict.fromkeys(paths):
        try:
            motor = load_table(MotorFile, path)
        except ConfigError as wrong:
            lines += wrong.problems
            continue
        if motor.name in motors:
            lines.append(
                f'{path}: [identity] name = "{motor.name}": another motor file has this name already'
            )
        motors[motor.name] = motor
        lines += [f"{path}: {line}" for line in _contradictions(motor)]
    if lines:
        raise ConfigError(lines)
    return list(motors.values())


def _contradictions(file: MotorFile) -> Iterator[str]:
    """What a name plate cannot say: the same as the machine file's rules on [motor] and [encoder]."""
    plate, encoder = file.motor, file.encoder
    for what, ending, unit in (("torque", "nm", "N m"), ("speed", "r_min", "r/min")):
        high, low = f"{what}_max_{ending}", f"{what}_rated_{ending}"
        most, rated = getattr(plate, high), getattr(plate, low)
        if most < rated:
            yield (f"[motor] {high} = {most:g} {unit}: must be at least {low} = {rated:g} {unit}")
    # Catalogue values are rounded: 10 %, as the machine file's rule on the name plate.
    power = power_kw(plate.torque_rated_nm, plate.speed_rated_r_min)
    if abs(plate.power_rated_kw - power) > 0.1 * power:
        yield (
            f"[motor] power_rated_kw = {plate.power_rated_kw:g} kW: must be {power:.4g} kW within 10 %: rated "
            "torque x rated speed"
        )
    for key in ("counts_per_turn", "turns"):
        value = getattr(encoder, key)
        if value & (value - 1):
            yield (f"[encoder] {key} = {value}: must be a power of two, as in every absolute encoder")
