"""Values in force: with their origin, the hashes over them, differences, as the text of a file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from gantryctl.errors import ConfigError
from gantryctl.machine.calibration import Calibration
from gantryctl.machine.problems import show_value
from gantryctl.machine.reading import printable
from gantryctl.machine.specs import Value, field_specs, value_at
from gantryctl.machine.tables.axis import ENDS
from gantryctl.machine.tables.fields import Table
from gantryctl.machine.tables.model import Machine

Origin: TypeAlias = Literal["file", "guess", "default"]

SHORT_HASH: Final = 12
# Longer lines are refused when the file is read (`reading.MAX_LINE`).
_LONGEST_ARRAY: Final = 300


class Difference(NamedTuple):
    """Key whose effective values differ between two machines."""

    path: str
    first: Value
    second: Value
    unit: str


def config_hash(machine: Machine) -> str:
    """SHA-256 over the effective values, given or default, as canonical JSON; 64 hexadecimal digits."""
    # How a value is written, its place, and whether it was given or is the default do not count (decision 0004).
    values = {path: _canonical(value) for path, value in effective_values(machine).items()}
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def short_hash(machine: Machine) -> str:
    """The first digits of `config_hash`, for people."""
    return config_hash(machine)[:SHORT_HASH]


def identity_hash(machine: Machine) -> str:
    """Hash of ratios, motor, reducer and encoder; not of gains, limits or [plant]."""
    # Gains, limits and [plant] may change without a new calibration; what was measured hangs on these parts.
    ratios = {"reducer_ratio": machine.axis.reducer_ratio, "ring_ratio": machine.axis.ring_ratio}
    tables = {
        name: getattr(machine, name).model_dump(mode="json") for name in ("motor", "reducer", "encoder")
    }
    text = json.dumps({"axis": ratios, **tables}, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode("ascii")).hexdigest()[:16]


def check_belongs(calibration: Calibration, machine: Machine, encoder_serial: str | None = None) -> None:
    """Refuse a calibration of another machine.

    Args:
        encoder_serial: what the drive says about its encoder; None where there is no drive to ask.

    Raises:
        ConfigError: ratios, motor, reducer or encoder differ, or the encoder has another serial number.
    """
    origin, wanted = calibration.origin, identity_hash(machine)
    if origin.identity != wanted:
        wrong = (
            f"on another machine (identity {origin.identity}, this one is {wanted}: ratios, motor, reducer or encoder "
            "differ)"
        )
    elif encoder_serial is not None and encoder_serial != origin.encoder_serial:
        known, found = printable(origin.encoder_serial), printable(encoder_serial)
        wrong = f"with encoder {known!r}, the drive has {found!r}"
    else:
        return
    what = f"calibration of {printable(origin.machine)}, {origin.date}"
    raise ConfigError([f"{what}: measured {wrong}; run `gantryctl identify` on this machine"])


def origins(machine: Machine) -> dict[str, Origin]:
    """Origin of every value by dotted path: given in the file, given there as a guess, or the default."""
    guesses = set(machine.machine.guesses)

    def origin(path: str) -> Origin:
        if not _given(machine, path):
            return "default"
        return "guess" if path in guesses else "file"

    return {path: origin(path) for path in field_specs()}


def effective_values(machine: Machine) -> dict[str, Value]:
    """Values in force by dotted path, in the order of the schema."""
    return {path: value_at(machine, path) for path in field_specs()}


def diff_machines(first: Machine, second: Machine) -> list[Difference]:
    """Keys whose effective values differ, in the order of the schema."""
    a, b = effective_values(first), effective_values(second)
    units = {path: spec.unit for path, spec in field_specs().items()}
    return [Difference(path, a[path], b[path], unit) for path, unit in units.items() if a[path] != b[path]]


def _given(machine: Machine, path: str) -> bool:
    table: Table = machine
    *tables, key = path.split(".")
    for part in tables:
        if part not in table.model_fields_set:
            return False
        table = getattr(table, part)
    return key in table.model_fields_set


def _canonical(value: Any) -> Any:
    """Value with one form: -0.0 equals 0.0, so both must give the same text."""
    if isinstance(value, tuple):
        return tuple(_canonical(item) for item in value)
    return value + 0.0 if isinstance(value, float) else value


def to_toml(machine: Machine) -> str:
    """Text that `parse_machine` turns back into an equal machine with the same hash."""
    values = effective_values(machine)
    # A modulo axis has values beside its turn, and refuses their keys.
    without = {f"axis.{key}" for key in ENDS} if machine.axis.modulo else set()
    return toml_tables({path: value for path, value in values.items() if path not in without})


def toml_tables(
    values: Mapping[str, Value], *, units: bool = False, comments: Mapping[str, str] | None = None
) -> str:
    """Values by dotted path as tables of a TOML file.

    Args:
        values: in the order of the file. units: each has its unit in a comment. comments: by path, behind the unit.
    """
    lines: list[str] = []
    table = ""
    for path, value in values.items():
        at, _, key = path.rpartition(".")
        if at != table:
            table = at
            lines += ["", f"[{table}]"] if lines else [f"[{table}]"]
        unit = field_specs()[path].unit if units else "-"
        words = [
            *([unit] if unit != "-" else []),
            *([comments[path]] if comments and path in comments else []),
        ]
        comment = f"  # {', '.join(words)}" if words else ""
        lines.append(f"{key} = {toml_value(value)}{comment}")
    return "\n".join(lines) + "\n"


def toml_value(value: Value) -> str:
    """Value as it stands in a TOML file; a long array takes a line per element."""
    if isinstance(value, str):
        return f'"{"".join(map(_escaped, value))}"'
    if isinstance(value, tuple) and len(text := show_value(value, None)) > _LONGEST_ARRAY:
        return "[\n" + "".join(f"    {show_value(item, None)},\n" for item in value) + "]"
    return text if isinstance(value, tuple) else show_value(value, None)


def _escaped(character: str) -> str:
    # A TOML string in quotes: what is not printable becomes a code point.
    if character in '"\\':
        return "\\" + character
    return character if character.isprintable() else f"\\U{ord(character):08X}"
