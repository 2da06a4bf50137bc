"""Controller and drive over a real vcan0: the tests of `tests/vcan`, all in one start of a user-mode Linux.

What is judged there does not depend on the speed of this computer: the drive's time goes on by SYNC.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")]),
    "VCAN_S": "1500",  # a quarter of a minute of processor
}
NO_KERNEL = 125

pytestmark = pytest.mark.can


def run_on_vcan(module: str) -> None:
    """Run the tests of a module there. An error in CI, a skip elsewhere, where such a kernel cannot be had."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "--durations=15",
    ]
    done = subprocess.run(
        [TESTS / "support" / "vcan.sh", *command, "--basetemp", "/dev/shm/tests", f"tests/vcan/{module}"],  # noqa: S108 - of its own namespace
        cwd=TESTS.parent,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=False,
    )
    print(done.stdout)
    if done.returncode == NO_KERNEL:
        pytest.skip(f"no kernel with CAN: {done.stderr}")
    assert done.returncode == 0, done.stderr
    # A run that collected nothing would pass too.
    assert re.search(r"^\d+ passed", done.stdout, re.MULTILINE), done.stdout


def test_controller_and_drive_over_a_real_vcan() -> None:
    run_on_vcan("on_vcan.py")


@pytest.mark.slow
def test_controller_and_drive_over_a_vcan_that_loses_delays_and_doubles_frames() -> None:
    run_on_vcan("slow_on_vcan.py")
