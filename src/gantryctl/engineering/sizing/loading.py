"""From a requirement sheet's file to a `Sheet`, or to the list of everything that is wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.engineering.sizing.sheet_rules import contradictions
from gantryctl.errors import ConfigError
from gantryctl.machine import configs_folder, load_table

DEFAULT_SHEET: Final = "hust_gantry.toml"


def default_sheet_path() -> Path:
    """Where the reference machine's requirement sheet lies."""
    return configs_folder() / "requirements" / DEFAULT_SHEET


def load_sheet(path: Path | str) -> Sheet:
    """Read and check a requirement sheet.

    Raises:
        ConfigError: one line per problem, all of them; an impossible requirement is a problem too.
    """
    sheet = load_table(Sheet, path)
    lines = contradictions(sheet)
    if lines:
        raise ConfigError([f"{path}: {line}" for line in lines])
    return sheet
