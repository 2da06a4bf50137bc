"""A plain C loop, as it is usually written."""

from __future__ import annotations

import subprocess
from pathlib import Path

from gantryctl.engineering.bench.peers.building import build
from gantryctl.engineering.bench.rigid import Run, Timed


def plain_c(seconds: int, folder: Path) -> Run:
    """Compile `rigid_loop.c`, a program that measures itself."""
    program = build(Path(__file__).with_name("rigid_loop.c"), folder / "rigid_loop")

    def run() -> Timed:
        answer = subprocess.run(  # noqa: S603 - the program built above, no shell
            [str(program), str(seconds), "5"], check=True, capture_output=True, text=True
        ).stdout.split()
        spent, *angles = map(float, answer)
        return Timed(angles, spent)

    return run
