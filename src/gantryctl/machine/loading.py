"""From a machine file to a `Machine`, or to the list of everything that is wrong with it."""

from __future__ import annotations

import functools
import json
import tomllib
from importlib import resources
from pathlib import Path

from pydantic import ValidationError

from gantryctl.errors import ConfigError
from gantryctl.machine.model import Machine

DEFAULT_FILE = "hust_gantry.toml"


def load_machine(path: Path | str) -> Machine:
    """Read and check a machine file.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError([f"{path}: cannot be read: {error}"]) from None
    return parse_machine(text, str(path))


def parse_machine(text: str, name: str = "machine file") -> Machine:
    """Check the text of a machine file; `name` stands in front of every problem."""
    try:
        return Machine.model_validate_json(json.dumps(tomllib.loads(text)), strict=True)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError([f"{name}: {error}"]) from None
    except ValidationError as error:
        raise ConfigError([f"{name}: {e['loc']}: {e['msg']}" for e in error.errors()]) from None


def default_machine_path() -> Path:
    """Where the reference machine's file lies: package data, or `configs/` of a working tree."""
    packaged = Path(str(resources.files("gantryctl").joinpath("configs", DEFAULT_FILE)))
    if packaged.is_file():
        return packaged
    return Path(__file__).resolve().parents[3] / "configs" / DEFAULT_FILE


@functools.cache
def default_machine() -> Machine:
    """The reference machine, the gantry of the source paper."""
    return load_machine(default_machine_path())
