"""What an editor needs to complete and check a file while a person types: its JSON schema, and the line that names it.

Even Better TOML and other editors built on Taplo read the line: `#:schema`, before anything but comments, and a path
relative to the file (taplo.tamasfe.dev/configuration/directives). So the schema lies beside the file, and works
wherever both are copied to.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from gantryctl.files import unwritable
from gantryctl.machine.loading import configs_folder
from gantryctl.machine.tables.fields import Table
from gantryctl.machine.tables.model import Machine

_LINE: Final = re.compile(r"#:schema \./([a-z_]+\.schema\.json)\r?\n")
# Where the delivered schemas lie, by name, below `configs`.
_DELIVERED: Final = {"machine.schema.json": ".", "sheet.schema.json": "requirements"}

MACHINE_LINE: Final = "#:schema ./machine.schema.json\n"
SHEET_LINE: Final = "#:schema ./sheet.schema.json\n"


def json_schema(model: type[Table] = Machine, what: str = "machine file") -> dict[str, Any]:
    """JSON schema of a file: bounds, units, meanings. Rules between keys are not in it.

    Args:
        model: of the whole file. what: the kind of file, for the title.
    """
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **model.model_json_schema(mode="validation"),
        "title": f"gantryctl {what}",
    }


def put_schemas(written: Iterable[Path]) -> list[Path]:
    """Copy the delivered schema that each file names in its first line beside it.

    A schema of another version of gantryctl is replaced; a file of that name that is no schema of gantryctl's is left
    as it is.

    Args:
        written: machine files and sheets, and whatever was written with them.

    Returns:
        The schemas that lie there now, each once.

    Raises:
        UsageError: it cannot be written. DeviceError: the disk does not take it.
    """
    there = []
    for path in written:
        with path.open(encoding="utf-8", newline="") as file:
            named = _LINE.fullmatch(file.readline())
        if named is None or named[1] not in _DELIVERED:
            continue
        delivered = configs_folder() / _DELIVERED[named[1]] / named[1]
        beside = path.with_name(named[1])
        if beside in there:
            continue
        try:
            if beside.exists() and b'"title": "gantryctl ' not in beside.read_bytes():
                continue
            if not (beside.exists() and beside.samefile(delivered)):
                shutil.copyfile(delivered, beside)
        except OSError as fault:
            raise unwritable(beside, fault) from None
        there.append(beside)
    return there
