"""Commissioning of a virtual drive takes at most 5 commands, 12 typed values, and 3 minutes before the whole travel."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from support.command_line import cli

SUPPORT = Path(__file__).parents[1] / "support"
PRIVATE = [str(SUPPORT / "private_network.sh")]

pytestmark = [pytest.mark.slow, pytest.mark.can]


def test_commands_values_and_minutes_on_a_bus(tmp_path: Path) -> None:
    """In real time, the drive and the tracker as processes of their own."""
    found = subprocess.run([*PRIVATE, "true"], capture_output=True, text=True, check=False)
    if found.returncode:
        pytest.skip(f"no network namespace: {found.stderr.strip()}")
    script = str(Path(__file__).with_name("commissioning_effort.py"))
    done = subprocess.run(
        [*PRIVATE, sys.executable, script, str(tmp_path)],
        capture_output=True,
        text=True,
        check=True,
    )
    took = json.loads(done.stdout)
    print({key: took[key] for key in ("commands", "typed", "seconds")})
    assert "5 stops, largest" in took["out"], took
    # Each reach is asked for once, and the command goes through at once.
    assert took["answers"] == 3
    assert "  left out" in took["out"]
    assert took["commands"] <= 5
    assert took["typed"] <= 12
    assert took["seconds"] <= 180.0


def test_the_whole_of_it_in_virtual_time(tmp_path: Path) -> None:
    """One command with a virtual drive in the process, turn and chord test by the simulated tracker included."""
    begun_s = time.process_time()
    answer = cli("commission", "--with-sim", "--out", tmp_path / "report")
    took_s = time.process_time() - begun_s
    print({"processor_s": took_s})
    assert answer.code == 0, answer.out
    assert (
        "chord test E by simulated tracker, seed 0, simulated: A as measured of the whole test" in answer.out
    )
    axis_min = float(answer.out.rpartition("time of the axis, all steps: ")[2].partition(" min")[0])
    print({"axis_min": axis_min})
    # What the steps take on a machine beside setting the drive up.
    assert axis_min <= 10.0
    assert (tmp_path / "report" / "accuracy" / "report.html").is_file()
    assert took_s <= 600.0
    page = (tmp_path / "report" / "commissioning.html").read_text(encoding="utf-8")
    # Every step that moved is drawn: the chord errors of three bases, the torque over the angle, every stop.
    for title in (
        "Chord errors",
        "Torque over the angle",
        "Quick stop from +3°/s",
        "Jog release from 0.6°/s",
    ):
        assert title in page
