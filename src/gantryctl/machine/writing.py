"""A machine as the text of a machine file: every value in force, none of the comments."""

from __future__ import annotations

from gantryctl.machine.problems import show_value
from gantryctl.machine.specs import Value, field_specs, value_at
from gantryctl.machine.tables.model import Machine


def to_toml(machine: Machine) -> str:
    """Text that `parse_machine` turns back into an equal machine with the same hash."""
    lines: list[str] = []
    table = ""
    for path, spec in field_specs().items():
        if spec.table != table:
            table = spec.table
            lines += ["", f"[{table}]"] if lines else [f"[{table}]"]
        lines.append(f"{spec.key} = {_toml(value_at(machine, path))}")
    return "\n".join(lines) + "\n"


def _toml(value: Value) -> str:
    return f'"{"".join(map(_escaped, value))}"' if isinstance(value, str) else show_value(value, None)


def _escaped(character: str) -> str:
    """One character of a TOML string in quotes; what is not printable becomes a code point."""
    if character in '"\\':
        return "\\" + character
    return character if character.isprintable() else f"\\U{ord(character):08X}"
