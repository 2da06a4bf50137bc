"""Values in force: with their origin, the hash over them, differences, the JSON schema."""

from __future__ import annotations

import hashlib
import json
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from gantryctl.machine.specs import Value, field_specs, value_at
from gantryctl.machine.tables.fields import Table
from gantryctl.machine.tables.model import Machine

Origin: TypeAlias = Literal["file", "default"]

SHORT_HASH: Final = 12


class Difference(NamedTuple):
    """Key whose effective values differ between two machines."""

    path: str
    first: Value
    second: Value
    unit: str


def config_hash(machine: Machine) -> str:
    """SHA-256 over the effective values, given or default, as canonical JSON; 64 hexadecimal digits."""
    # How a value is written, its place, and whether it was given or is the default do not count (decision 0004).
    values = {path: _canonical(value_at(machine, path)) for path in field_specs()}
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def short_hash(machine: Machine) -> str:
    """The first digits of `config_hash`, for people."""
    return config_hash(machine)[:SHORT_HASH]


def origins(machine: Machine) -> dict[str, Origin]:
    """Origin of every value by dotted path: given in the file, or the default."""
    return {path: "file" if _given(machine, path) else "default" for path in field_specs()}


def effective_values(machine: Machine) -> dict[str, Value]:
    """Values in force by dotted path, in the order of the schema."""
    return {path: value_at(machine, path) for path in field_specs()}


def diff_machines(first: Machine, second: Machine) -> list[Difference]:
    """Keys whose effective values differ, in the order of the schema."""
    found = []
    for path, spec in field_specs().items():
        a, b = value_at(first, path), value_at(second, path)
        if a != b:
            found.append(Difference(path, a, b, spec.unit))
    return found


def json_schema() -> dict[str, Any]:
    """JSON schema of a machine file: bounds, units, meanings. Rules between keys are not in it."""
    schema = Machine.model_json_schema(mode="validation")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "gantryctl machine file",
    }


def _given(machine: Machine, path: str) -> bool:
    table: Table = machine
    *tables, key = path.split(".")
    for part in tables:
        if part not in table.model_fields_set:
            return False
        table = getattr(table, part)
    return key in table.model_fields_set


def _canonical(value: Value) -> Value:
    """Value with one form: -0.0 equals 0.0, so both must give the same text."""
    if isinstance(value, tuple):
        return tuple(item + 0.0 for item in value)
    return value + 0.0 if isinstance(value, float) else value
