"""All settings of a machine as one document, for reading: nothing secret is in it."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from gantryctl.errors import StateError
from gantryctl.files import write_whole
from gantryctl.machine import Machine, config_hash, effective_values, field_specs, origins
from gantryctl.operation.store import now_text
from gantryctl.runtime import RetainedMemory
from gantryctl.service.supervisor.users import Users
from gantryctl.units import deg

SERVICE_FILE: Final = "service.json"
"""Options with which the service was started last, in the machine's directory."""

_ENCODER: Final = (
    "encoder_serial", "zero_offset_counts", "previous_offset_counts", "zero_set_by", "zero_set_at", "zero_witness",
)  # fmt: skip


def keep_service_options(directory: Path, options: dict[str, Any]) -> None:
    """Keep the options of a service that starts.

    Raises:
        StateError: the disk does not take it.
    """
    text = json.dumps({"started": now_text(), **options}, indent=1) + "\n"
    write_whole(directory / SERVICE_FILE, text, private=True, make_folder=True)


def settings_of(machine: Machine, root: Path) -> dict[str, Any]:
    """Collect the settings: of the machine file as in force, of the service, of its operator, of the encoder, accounts.

    Args:
        root: the state root.

    Raises:
        StateError: state or accounts cannot be read.
    """
    origin, specs = origins(machine), field_specs()
    return {
        "exported": now_text(),
        "version": version("gantryctl"),
        "machine": machine.name,
        "file": str(machine.source or ""),
        "hash": config_hash(machine),
        "values": {
            key: {"value": value, "unit": specs[key].unit, "origin": origin[key]}
            for key, value in effective_values(machine).items()
        },
        "service": _service(root / machine.name),
        **_kept(root / machine.name),
        "opcua_trusted": _names(root / machine.name / "opcua" / "trusted"),
        "opcua_revoked": _names(root / machine.name / "opcua" / "revoked"),
        "accounts": [
            {"name": user.name, "role": str(user.role), "person": user.person, "since": user.since}
            for user in Users(root).all().values()
        ],
    }


def _service(directory: Path) -> dict[str, Any]:
    """Options of the service as it was started last; {} before the first start."""
    path = directory / SERVICE_FILE
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as fault:
        raise StateError(f"{path}: cannot be read: {fault}") from fault
    return dict(found)


def _kept(directory: Path) -> dict[str, Any]:
    """What operator and service have set, from the retained memory; without a run, nothing."""
    # Read without the lock, because the service may run: each copy is whole.
    kept = RetainedMemory(directory).load()
    if kept is None:
        return {"operator": {}, "encoder": {}}
    speed_deg_s = None if kept.speed_rad_s is None else deg(kept.speed_rad_s)
    increment_deg = None if kept.increment_rad is None else deg(kept.increment_rad)
    return {
        "operator": {"speed_setting_deg_s": speed_deg_s, "increment_deg": increment_deg},
        "encoder": {name: getattr(kept, name) for name in _ENCODER},
    }


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
