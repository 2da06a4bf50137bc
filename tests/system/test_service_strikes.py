"""Each process of a service is frozen for 0.1 to 5 s, and killed: at rest, in a jog, in a move; alone and on a bus.

INV-8: the axis comes to rest within the stop table or goes on, nothing is lost, the journal tells it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from support.strikes import FROZEN_S, STATES, VICTIMS, strikes
from system.test_service_can import OWN_NETWORK, TESTS, WITH_HELPERS, possible

pytestmark = pytest.mark.slow
Evidence = Callable[[str, dict[str, object]], None]
BACK_S = 5.0


def judge(found: dict[str, object], name: str, evidence: Evidence) -> None:
    """Hold all strikes to what must be; how long it takes to be back is judged on a computer that is not overloaded."""
    load = os.getloadavg()
    evidence(name, {**found, "load_average": load})
    runs = found["runs"]
    assert isinstance(runs, list)
    assert len(runs) == len(VICTIMS) * len(STATES) * len(FROZEN_S)
    assert [run for run in runs if not run["right"]] == []
    assert sum(run["rows_lost"] for run in runs) == 0
    assert (found["journal"], found["gaps_in_numbers"]) == ("intact", 0)
    if load[1] < 1.5 * (os.cpu_count() or 1):
        assert max(run["back_s"] for run in runs) < BACK_S


@pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
def test_every_process_is_struck_on_the_virtual_gantry(tmp_path: Path, evidence: Evidence) -> None:
    judge(strikes(tmp_path, can=False), "service_struck", evidence)


@pytest.mark.skipif(not possible(), reason="no network namespace for CAN over multicast")
def test_every_process_is_struck_with_the_drive_on_a_bus(tmp_path: Path, evidence: Evidence) -> None:
    """The way is that of the motor by the account of the virtual drive."""
    judge(struck_on_bus(tmp_path), "service_struck_on_bus", evidence)


@pytest.mark.skipif(not possible(), reason="no network namespace for CAN over multicast")
def test_every_process_is_killed_with_the_drive_on_a_bus_and_all_is_back_in_time(
    tmp_path: Path, evidence: Evidence
) -> None:
    """Two minutes only, so that a computer with other work can be kept free for it."""
    found = struck_on_bus(tmp_path, "kills")
    evidence("service_back_on_bus", {**found, "load_average": os.getloadavg()})
    assert len(found["runs"]) == len(VICTIMS) * len(STATES)
    assert [run for run in found["runs"] if not run["right"] or run["rows_lost"]] == []
    assert found["journal"] == "intact"
    assert max(run["back_s"] for run in found["runs"]) < BACK_S


def struck_on_bus(root: Path, *options: str) -> dict[str, Any]:
    """What the strikes have found, in a network of their own."""
    command = [*OWN_NETWORK, sys.executable, "-m", "support.strikes", str(root), "can", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=WITH_HELPERS, cwd=TESTS)
    assert done.returncode == 0, done.stderr[-2000:]
    return dict(json.loads(done.stdout))
