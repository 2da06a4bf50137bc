"""Whether the journals of running services have a change of users: what the command line waits for."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from gantryctl.errors import GantryctlError
from gantryctl.operation.store import SERVICE_SOCKET, PeerName
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.supervisor.users import Users

# A service looks for changes once a second, and has their event on the disk some milliseconds later.
WAIT_S: Final = 3.0
_LOOK_S: Final = 0.05
_NEWEST: Final = 200


def running(root: Path) -> list[Path]:
    """State directories below a state root whose service answers."""
    return [path.parent for path in sorted(root.glob(f"*/{SERVICE_SOCKET}")) if _answers(path.parent)]


def not_kept(users: Users, directories: list[Path], sleep: Callable[[float], None] = time.sleep) -> list[str]:
    """Wait until journals have the newest change of users, `WAIT_S` at most; names of those that have it not."""
    changed_ns = users.changed_ns()
    until_s = time.monotonic() + WAIT_S
    while True:
        left = [directory for directory in directories if not _has(directory, changed_ns)]
        if not left or time.monotonic() > until_s:
            return [directory.name for directory in left]
        sleep(_LOOK_S)


def _answers(directory: Path) -> bool:
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as made, PeerName(directory) as address:
            made.settimeout(1.0)
            made.connect(address)
    except OSError:
        return False
    return True


def _has(directory: Path, changed_ns: int) -> bool:
    """Whether an event of the journal on the disk stands for the file of users as it is, or a later one."""
    try:
        rows = read_journal(directory, limit=_NEWEST, newest=True)
    except GantryctlError:
        return False
    kept = (
        json.loads(row.values["detail"]).get("file_ns", 0) for row in rows if row.values["kind"] == "user"
    )
    return any(file_ns >= changed_ns for file_ns in kept)
