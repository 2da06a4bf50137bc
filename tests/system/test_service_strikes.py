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

import pytest

from support.strikes import FROZEN_S, STATES, VICTIMS, strikes
from system.test_service_can import OWN_NETWORK, TESTS, WITH_HELPERS, possible

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]
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
    command = [*OWN_NETWORK, sys.executable, "-m", "support.strikes", str(tmp_path), "can"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=WITH_HELPERS, cwd=TESTS)
    assert done.returncode == 0, done.stderr[-2000:]
    judge(json.loads(done.stdout), "service_struck_on_bus", evidence)
