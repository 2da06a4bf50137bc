"""The command line where what only Linux has is missing: the simulator and CAN adapters work, the service says no."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from gantryctl.machine import configs_folder

SCRIPT = Path(__file__).parents[1] / "support" / "on_windows.py"


def on_windows(place: Path, *lines: str) -> tuple[list[int], str]:
    """Exit codes of command lines there, and all that they print."""
    arguments = [json.dumps(line.split()) for line in lines]
    environment = {**os.environ, "GANTRYCTL_STATE": str(place / "state")}
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *arguments],
        env=environment,
        cwd=place,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert "Traceback" not in done.stdout
    assert "internal" not in done.stdout, done.stdout
    return [int(code) for code in re.findall(r"^code (\d) win32", done.stdout, re.MULTILINE)], done.stdout


def bus_machine(place: Path) -> None:
    """A machine on an adapter that python-can finds everywhere, with nobody on the bus."""
    text = (configs_folder() / "hust_can.toml").read_text(encoding="utf-8")
    for key, value in (("interface", "virtual"), ("channel", "nobody")):
        text = re.sub(rf'(?m)^{key} = "\w*"', f'{key} = "{value}"', text, count=1)
    (place / "bus.toml").write_text(text, encoding="utf-8")


@pytest.mark.can
def test_moves_records_and_reaches_for_a_bus_without_what_only_linux_has(tmp_path: Path) -> None:
    bus_machine(tmp_path)
    codes, said = on_windows(
        tmp_path,
        "move 0.2",
        "status",
        "config check",
        "there drive status --config bus.toml",
        "there can scan --config bus.toml",
    )
    assert codes == [0, 0, 0, 3, 1], said
    assert "node 2 does not answer" in said
    assert len(list((tmp_path / "state").rglob("*.parquet"))) == 2  # one of each system


def test_what_needs_the_service_says_where_it_runs(tmp_path: Path) -> None:
    lines = ("serve", "console", "user list", "journal show", "backup create x", "attach", "status --service")
    codes, said = on_windows(tmp_path, *(f"there {line}" for line in lines))
    assert codes == [2] * len(lines), said
    assert said.count("the service runs on Linux only") == len(lines)
