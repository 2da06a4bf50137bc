"""Loading of a machine file: a `Machine`, or the list of all its problems."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from gantryctl.errors import ConfigError
from gantryctl.machine.calibration import load_calibration
from gantryctl.machine.problems import contradictions, describe, unknown_path
from gantryctl.machine.reading import Data, parse_toml, printable, read_text
from gantryctl.machine.specs import field_specs
from gantryctl.machine.tables.fields import Table
from gantryctl.machine.tables.model import RULES_LATER, Machine

TableT = TypeVar("TableT", bound=Table)


def load_uncalibrated(path: Path | str) -> Machine:
    """Read and check a machine file alone: a calibration that cannot be read does not keep anybody from a new one.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    return parse_machine(read_text(Path(path)), str(path)).read_from(Path(path).resolve())


def load_machine(path: Path | str) -> Machine:
    """Read and check a machine file, with the calibration file it names if that exists.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    machine = load_uncalibrated(path)
    named = machine.control.compensation.calibration
    beside = Path(path).parent / named
    return machine.calibrated(load_calibration(beside)) if named and beside.exists() else machine


def parse_machine(text: str, name: str = "machine file") -> Machine:
    """Check the text of a machine file; `name` stands in front of every problem.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    return check(parse_toml(text, name), name)


def load_table(model: type[TableT], path: Path | str) -> TableT:
    """Read another kind of TOML file as strictly as a machine file, by the model of its whole.

    Raises:
        ConfigError: one line per problem, all of them; rules between keys are the caller's.
    """
    name = str(path)
    return check_table(model, parse_toml(read_text(Path(path), ""), name), name)


def check_table(model: type[TableT], data: Data, name: str) -> TableT:
    """Check plain data as strictly as a machine file; `name` stands in front of every problem.

    Raises:
        ConfigError: as `load_table`.
    """
    try:
        return model.model_validate_json(_as_json(data), strict=True)
    except ValidationError as error:
        errors = error.errors(include_url=False, include_input=False)
        lines = describe(errors, data, name, model)[0]
    raise ConfigError(lines)  # not inside: see `check`


def with_values(machine: Machine, changes: Mapping[str, object]) -> Machine:
    """Vary a machine by dotted path, `{"axis.ring_ratio": 12.0}`, checked like a file.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    name = f"{machine.name} with changes"
    unknown = [path for path in changes if path not in field_specs()]
    if unknown:
        raise ConfigError([f"{name}: {unknown_path(path)}" for path in unknown])
    data: Data = machine.model_dump(mode="json", exclude_unset=True)
    for path, value in changes.items():
        *tables, key = path.split(".")
        table = data
        for part in tables:
            table = table.setdefault(part, {})
        table[key] = list(value) if isinstance(value, tuple) else value
    return check(data, name).calibrated(machine.calibration).read_from(machine.source)


def check(data: Data, name: str) -> Machine:
    """Turn plain data into a machine, or into a `ConfigError` with every problem of fields and rules."""
    try:
        machine = _validate(_as_json(data))
    except ValidationError as error:
        # The rules run as well, with stand-ins for what was refused: one run reports all problems (decision 0004).
        lines, unusable = describe(error.errors(include_url=False, include_input=False), data, name)
        lines += contradictions(_without(error, data), printable(name, 300), unusable)
    else:
        lines = contradictions(machine, printable(name, 300))
        if not lines:
            return machine
    # Not inside: a `ValidationError` that a raised error keeps as its context is never collected, nor is any frame that
    # it reaches, for Python cannot look into it.
    raise ConfigError(lines)


def configs_folder() -> Path:
    """Folder of the files delivered with the program: package data, or `configs/` of a working tree."""
    packaged = Path(str(resources.files("gantryctl").joinpath("configs")))
    if packaged.is_dir():
        return packaged
    return Path(__file__).resolve().parents[3] / "configs"


def default_machine_path() -> Path:
    """Path of the reference machine's file."""
    return configs_folder() / "hust_gantry.toml"


@functools.cache
def default_machine() -> Machine:
    """Reference machine, the gantry of the source paper."""
    return load_machine(default_machine_path())


def _as_json(data: Data) -> str:
    # A date has no JSON form; null, which every field refuses, stands in for it.
    return json.dumps(data, default=lambda _: None)


def _validate(text: str) -> Machine:
    # JSON in strict mode: lax mode takes "5" and true as numbers, strict Python mode refuses arrays for tuples
    # (decision 0004).
    return Machine.model_validate_json(text, strict=True, context={RULES_LATER: True})


def _without(error: ValidationError, data: Data) -> Machine:
    """Machine without what was refused: defaults stand in, so that other rules can be checked."""
    data = json.loads(_as_json(data))  # a deep copy
    for problem in error.errors(include_url=False, include_input=False):
        _delete(data, [str(part) for part in problem["loc"] if isinstance(part, str)])
    for spec in field_specs().values():
        if spec.required:
            table: dict[str, Any] = data.setdefault(spec.table, {})
            table.setdefault(spec.key, spec.usual)
    return _validate(_as_json(data))


def _delete(data: Data, path: list[str]) -> None:
    """Remove a key if it is still there; an array goes as a whole."""
    table: Any = data
    for part in path[:-1]:
        table = table.get(part)
        if not isinstance(table, dict):
            return
    table.pop(path[-1], None)
