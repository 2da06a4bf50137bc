"""The controller killed in motion, its drive on a CAN bus: the drive's own supervision stops the axis."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from support.controller_death import judge

TESTS = Path(__file__).parents[1]
WITH_HELPERS = {
    **os.environ,
    "PYTHONPATH": os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")]),
}
# Multicast stays on the loopback of a network namespace of its own.
OWN_NETWORK = [
    "unshare",
    "-n" if os.geteuid() == 0 else "-rn",  # root keeps real-time scheduling
    "sh",
    "-c",
    'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo; exec "$@"',
    "sh",
]


def possible() -> bool:
    if shutil.which("unshare") is None or shutil.which("ip") is None:
        return False
    return subprocess.run([*OWN_NETWORK, "true"], capture_output=True, check=False).returncode == 0


BUSY = ("SYS-02", "SYS-03", "CAN-03")
"""Controller late, controller frozen, drive late: both are processes of this computer."""


@pytest.mark.slow
@pytest.mark.skipif(not possible(), reason="no network namespace for CAN over multicast")
def test_the_drive_stops_the_axis_of_a_killed_controller(
    tmp_path: Path, evidence: Callable[[str, dict[str, object]], None]
) -> None:
    """Within what deadline, clock and ramp of the drive add up to, counted from the controller's last telegram."""
    found = []
    for number, speed_deg_s in enumerate((1.0, 3.0, 3.0, 3.0, 6.0)):
        root = tmp_path / str(number)
        root.mkdir()
        command = [*OWN_NETWORK, sys.executable, str(TESTS / "support" / "killed_on_bus.py")]
        # A computer that is late stops the axis before the kill, and the first alarm says so: no measurement.
        for attempt in range(5):
            place = root / str(attempt)
            place.mkdir()
            done = subprocess.run(
                [*command, str(place), str(speed_deg_s)],
                capture_output=True,
                text=True,
                check=False,
                env=WITH_HELPERS,
            )
            if not any(f"before the kill: {code} STOP" in done.stderr for code in BUSY):
                break
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout))
        judge(found[-1])
        assert found[-1]["speed_deg_s"] == pytest.approx(speed_deg_s, rel=0.02)
    evidence("service_killed_on_bus", {"runs": found})


@pytest.mark.slow
@pytest.mark.skipif(not possible(), reason="no network namespace for CAN over multicast")
def test_after_a_restart_of_the_drive_a_reset_of_the_service_is_enough(tmp_path: Path) -> None:
    """DRV-11 in motion: torque off; a reset with power off sets the drive up anew, and the next move goes on."""
    command = [*OWN_NETWORK, sys.executable, str(TESTS / "support" / "lost_on_bus.py"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=WITH_HELPERS)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    assert seen["axis_state_lost"] == "error_stop"
    assert not seen["position_valid_lost"]
    # What the drive sent before it fell silent is not told as the present: it had 2.5 deg/s and an open brake then.
    assert (seen["angle_lost_deg"], seen["speed_lost_deg_s"], seen["brake_open_lost"]) == (None, None, None)
    assert seen["codes_lost"][0] == "DRV-11"
    assert (
        "DRV-14" not in seen["codes_lost"]
    )  # a torque reading of before is no torque of a drive that is off
    assert not seen["power_after_reset"]
    assert abs(seen["moved_by_reset_deg"]) < 0.1  # the load swings on the brake
    assert seen["shown_after_reset_deg"] == pytest.approx(seen["load_after_reset_deg"], abs=0.1)
    assert seen["shown_at_end_deg"] == pytest.approx(seen["shown_after_reset_deg"] + 1.0, abs=0.01)
    assert seen["load_at_end_deg"] == pytest.approx(seen["shown_at_end_deg"], abs=0.05)
