"""Facts of the drive as it was last set up, kept with the machine: for whoever asks while the drive is not open."""

from __future__ import annotations

import json
from pathlib import Path

from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.errors import StateError
from gantryctl.files import indented_json, write_whole
from gantryctl.machine import Machine


def facts_path(directory: Path, machine: Machine) -> Path:
    """File of the facts, beside the commissioning record."""
    return directory / f"{machine.name}.facts.json"


def load_facts(path: Path) -> DriveFacts | None:
    """Read the facts; None without a file.

    Raises:
        StateError: the file is damaged.
    """
    if not path.exists():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        objects = {_place(name): ObjectFact(*values) for name, values in data.pop("objects").items()}
        return DriveFacts(**data, objects=objects)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as fault:
        raise StateError(
            f"{path}: cannot be read ({fault}); remove it, the next set-up of the drive writes it"
        ) from None


def store_facts(path: Path, facts: DriveFacts) -> None:
    """Write the facts, whole or not at all; nothing where they stand there already."""
    objects = {
        f"{index:04X}:{sub:02X}": [fact.writable, fact.mappable, fact.default, fact.low, fact.high]
        for (index, sub), fact in sorted(facts.objects.items())
        if not isinstance(fact.default, bytes)
    }
    plate = {
        "vendor": facts.vendor,
        "product": facts.product,
        "revision": facts.revision,
        "serial": facts.serial,
        "software": facts.software,
    }
    text = indented_json({**plate, "objects": objects}) + "\n"
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        write_whole(path, text)


def _place(name: str) -> tuple[int, int]:
    index, _, sub = name.partition(":")
    return int(index, 16), int(sub, 16)
