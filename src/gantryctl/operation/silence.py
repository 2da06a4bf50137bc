"""That a drive stops the axis of a silent controller: proven when commissioning, and after each boot-up of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from gantryctl.errors import CommandRefused
from gantryctl.files import write_whole
from gantryctl.image import LinkHealth
from gantryctl.machine import Machine
from gantryctl.operation.state import now_text


class SilenceProof(NamedTuple):
    """The last proof that was passed.

    Attributes:
        drive: vendor, product and serial number of 1018.
        mark: what was left in the drive, and is gone after a boot-up; None where it takes no mark.
    """

    drive: str
    mark: int | None
    date: str


def silence_path(directory: Path, machine: Machine) -> Path:
    """Beside the commissioning record."""
    return directory / f"{machine.name}.silence.json"


def store_silence(path: Path, drive_key: str, restart_marker: int | None) -> SilenceProof:
    """Keep that the proof was passed just now, with the marker that was left in the drive.

    Raises:
        StateError: it cannot be written.
    """
    proof = SilenceProof(drive_key, restart_marker, now_text())
    write_whole(path, json.dumps(proof._asdict()) + "\n")
    return proof


def check_silence(path: Path, health: LinkHealth) -> None:
    """Whether the proof still speaks of this drive as it is now.

    Raises:
        CommandRefused: it was never passed with this drive, or the drive has restarted since.
    """
    again = "`gantryctl commission --only silence --config FILE` proves it in some seconds, at standstill"
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        proof = SilenceProof(str(data["drive"]), data["mark"], str(data["date"]))
    except (OSError, ValueError, KeyError, TypeError):
        proof = SilenceProof("", None, "")
    if proof.drive != health.drive_key:
        raise CommandRefused(
            f"nobody has proven that this drive stops the axis when its controller falls silent · {again}"
        )
    if proof.mark is not None and proof.mark != health.restart_marker:
        raise CommandRefused(
            f"the drive has restarted since it was proven on {proof.date} that it stops the axis when its controller "
            f"falls silent · {again}"
        )
