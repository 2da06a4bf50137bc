"""Controller and drive as two processes on a CAN bus of UDP multicast, in a network namespace of their own.

Ways and times are those of the drive's own account; nothing here measures how fast this computer is.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from gantryctl.machine import default_machine

TESTS = Path(__file__).parents[1]
PRIVATE = [str(TESTS / "support" / "private_network.sh")]
QUICK_DEC = default_machine().virtual_axis.quick_dec_deg_s2

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def namespace() -> None:
    """An error in CI, a skip elsewhere, where this system gives no network namespace."""
    try:
        found = subprocess.run([*PRIVATE, "true"], capture_output=True, text=True, check=False)
    except OSError as fault:
        pytest.skip(f"no network namespace: {fault}")
    if found.returncode:
        pytest.skip(f"no network namespace: {found.stderr.strip()}")


def scenario(name: str, folder: Path, *values: str) -> dict[str, Any]:
    script = str(Path(__file__).with_name("can_processes.py"))
    command = [*PRIVATE, sys.executable, script, name, str(folder), *values]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=110)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_a_move_over_the_bus_in_real_time(tmp_path: Path) -> None:
    found = scenario("move", tmp_path)
    assert found["out"]["result"] == "done", found
    assert found["out"]["summary"]["end_deg"] == pytest.approx(5.0, abs=0.005)  # the in-position window
    assert found["load_deg"] == pytest.approx(5.0, abs=0.02)  # gear errors of this grade and wind-up
    assert found["brake_open"] is False


def test_a_killed_controller_does_not_leave_the_gantry_turning(
    tmp_path: Path, evidence: Callable[[str, dict[str, object]], None]
) -> None:
    found = scenario("kill_master", tmp_path)
    speed = found["speed_deg_s"]
    computed = speed**2 / (2.0 * QUICK_DEC)
    found |= {"computed_deg": computed, "limit_deg": computed + 0.06 * speed}
    evidence("can_kill_master", found)
    assert speed == pytest.approx(6.0, abs=0.3)
    assert 0.0 < found["way_deg"] <= found["limit_deg"]
    assert found["state"] == "FAULT"
    assert found["error_code"] in (0x8130, 0x8250)
    assert found["brake_open"] is False


def test_a_killed_drive_is_an_alarm_within_three_syncs(
    tmp_path: Path, evidence: Callable[[str, dict[str, object]], None]
) -> None:
    found = scenario("kill_drive", tmp_path)
    evidence("can_kill_drive", {"alarms": found["out"]["alarms"]})
    assert found["out"]["exit_code"] == 4
    assert "CAN-03" in found["err"]
    assert "30 ms old" in found["err"]  # three SYNC periods of 10 ms


@pytest.mark.timeout(400)
def test_a_stall_of_the_controller_leaves_no_following_error(
    tmp_path: Path, evidence: Callable[[str, dict[str, object]], None]
) -> None:
    """F1, F2 at 250 Hz: up to 30 ms the axis goes on, later is a quick stop. 9 ms at 6 deg/s are 0.054 deg."""
    for attempt in range(
        3
    ):  # a busy computer adds stalls of its own, which stop the axis: not what is measured
        folder = tmp_path / str(attempt)
        folder.mkdir()
        with suppress(AssertionError):
            found = scenario("stall", folder, "0", "9", "20", "40")
            break
    else:
        pytest.fail("three times the computer was too busy")
    evidence("can_stall", found)
    for stall_ms in ("9", "20"):
        run = found[stall_ms]
        assert run["result"] == "done", run
        assert run["most_periods"] * 4.0 >= float(stall_ms) - 4.0
        assert run["following_error_deg"] < 0.03
        assert run["torque_nm"] < 0.9 * 385.0  # object 6072: a step of the speed command goes to the limit
    assert "SYS-02" in found["40"]["err"]
    assert found["40"]["most_periods"] * 4.0 > 30.0


def test_the_conformance_suite_between_two_processes() -> None:
    suite = TESTS / "conformance" / "udp_drive.py"
    command = [
        *PRIVATE,
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-n",
        "0",
        "-p",
        "no:cacheprovider",
        str(suite),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=115, cwd=TESTS.parent)
    assert done.returncode == 0, done.stdout[-4000:]
    assert " passed" in done.stdout
