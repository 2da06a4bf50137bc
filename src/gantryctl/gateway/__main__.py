"""The gateway process: `python -m gantryctl.gateway SETTINGS HANDLE`; `gantryctl serve` starts it."""

from __future__ import annotations

import contextlib
import os
import sys

from gantryctl.gateway.app import build_app
from gantryctl.gateway.server import run_server
from gantryctl.gateway.settings import Settings
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.realtime import die_with_parent


def main(arguments: list[str]) -> int:
    """Entry point of the process."""
    settings, memory = Settings.from_json(arguments[0]), SharedMemory(int(arguments[1]))
    die_with_parent(memory.words[Word.SUPERVISOR])
    with contextlib.suppress(OSError):
        # The scan comes first: a web server in its process made it tens of milliseconds late (decision 0011).
        os.nice(5)
    run_server(build_app(settings, memory), settings)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
