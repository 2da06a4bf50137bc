"""Each process of a service is frozen for 0.1 to 5 s, and killed: at rest, in a jog, in a move.

INV-8: the axis comes to rest within the stop table or goes on, nothing is lost, the journal tells it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from support.strikes import FROZEN_S, STATES, VICTIMS, strikes

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]
Evidence = Callable[[str, dict[str, object]], None]
BACK_S = 5.0


@pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
def test_every_process_is_struck(tmp_path: Path, evidence: Evidence) -> None:
    """How long it takes to be back is judged on a computer that is not overloaded."""
    found, load = strikes(tmp_path), os.getloadavg()
    evidence("service_struck", {**found, "load_average": load})
    runs = found["runs"]
    assert len(runs) == len(VICTIMS) * len(STATES) * len(FROZEN_S)
    assert [run for run in runs if not run["right"]] == []
    assert sum(run["rows_lost"] for run in runs) == 0
    assert (found["journal"], found["gaps_in_numbers"]) == ("intact", 0)
    if load[1] < 1.5 * (os.cpu_count() or 1):
        assert max(run["back_s"] for run in runs) < BACK_S
