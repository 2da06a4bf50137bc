"""Values as the text of a machine file: in the order of the schema, without comments of people."""

from __future__ import annotations

from collections.abc import Mapping

from gantryctl.machine.effective import effective_values
from gantryctl.machine.problems import show_value
from gantryctl.machine.specs import Value, field_specs
from gantryctl.machine.tables.model import Machine


def to_toml(machine: Machine) -> str:
    """Text that `parse_machine` turns back into an equal machine with the same hash."""
    return toml_tables(effective_values(machine))


def toml_tables(values: Mapping[str, Value], *, units: bool = False) -> str:
    """Values by dotted path as tables of a machine file; with `units` each has its unit in a comment."""
    lines: list[str] = []
    table = ""
    for path, value in values.items():
        spec = field_specs()[path]
        if spec.table != table:
            table = spec.table
            lines += ["", f"[{table}]"] if lines else [f"[{table}]"]
        unit = f"  # {spec.unit}" if units and spec.unit != "-" else ""
        lines.append(f"{spec.key} = {_toml(value)}{unit}")
    return "\n".join(lines) + "\n"


def _toml(value: Value) -> str:
    return f'"{"".join(map(_escaped, value))}"' if isinstance(value, str) else show_value(value, None)


def _escaped(character: str) -> str:
    # A TOML string in quotes: what is not printable becomes a code point.
    if character in '"\\':
        return "\\" + character
    return character if character.isprintable() else f"\\U{ord(character):08X}"
