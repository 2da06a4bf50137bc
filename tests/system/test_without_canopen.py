"""With drives/canopen removed everything but the bus works (decision 0003: a drive is a stranger to all others)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent.parent
NO_CANOPEN = TESTS / "support" / "without_canopen"

EVERY_MODULE = """
import importlib, pkgutil, gantryctl

lacking = []
for found in pkgutil.walk_packages(gantryctl.__path__, "gantryctl."):
    if found.name.endswith("__main__") or found.name.startswith("gantryctl.drives.canopen"):
        continue
    try:
        importlib.import_module(found.name)
    except ModuleNotFoundError as fault:
        if fault.name is None or not fault.name.startswith("gantryctl.drives.canopen"):
            raise
        lacking.append(found.name)
print(*lacking)
"""


def without_canopen(*arguments: str) -> subprocess.CompletedProcess[str]:
    """A Python in which the package of the master does not exist."""
    path = os.pathsep.join([str(NO_CANOPEN), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run(
        [sys.executable, *arguments],
        env=os.environ | {"PYTHONPATH": path},
        cwd=TESTS.parent,
        capture_output=True,
        text=True,
        check=False,
    )


def test_only_the_wiring_of_the_bus_and_commissioning_miss_it() -> None:
    done = without_canopen("-c", EVERY_MODULE)
    assert done.returncode == 0, done.stderr
    lacking = done.stdout.split()
    assert "gantryctl.wiring.canopen" in lacking
    assert [
        name
        for name in lacking
        if not name.startswith(("gantryctl.wiring.canopen", "gantryctl.commissioning"))
    ] == []


def test_a_move_in_simulation_needs_no_bus(tmp_path: Path) -> None:
    done = without_canopen("-m", "gantryctl", "move", "1", "--fresh")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_unit_tests_pass_without_it() -> None:
    """The command of the documentation: `pytest tests/unit -m "not can and not slow"`."""
    done = without_canopen("-m", "pytest", "tests/unit", "-q", "-m", "not can and not slow")
    assert done.returncode == 0, done.stdout[-4000:]
