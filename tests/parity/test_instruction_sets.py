"""One wheel for every processor: the instruction set is chosen at start, and the results do not show which."""

from __future__ import annotations

import os
import subprocess
import sys

from gantryctl import _core

# A batch of plants that differ, their logs, one logged run and one scan from outside: the digest of every byte.
_JOB = """
import hashlib
import numpy as np
from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop, Leg, log_legs, run_legs
from gantryctl.machine import default_machine, with_values
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim

machine = default_machine()
loops = []
for k in range(11):
    own = with_values(machine, {"plant.load.inertia_kg_m2": 2.18e6 + 1e4 * k})
    loops.append(ClosedLoop.standing_at(gantry_sim(own), position_law(own), 0.1 * k))
legs = [
    [Leg(plan_move(SetPoint(0.1 * k, 0.0, 0.0), 0.1 * k + 0.01, motion_limits(machine)), 0.5, 0.1)]
    for k in range(11)
]
figures = run_legs(loops, legs, 2)
log = loops[0].run(hold(0.0), 0.3)
rows = log_legs(loops, [Leg(hold(0.0), 0.2, added_rad_s=[1.0, -2.0])], _core.LOG_COLUMNS)
loops[0].sim.scan(1, 5.0, 0.0, True)
columns = [*figures[0], *(each[name] for each in (log, *rows) for name in each.columns), np.array(loops[0].sim.truth())]
print(_core.isa(), hashlib.sha256(b"".join(np.ascontiguousarray(c).tobytes() for c in columns)).hexdigest())
"""


def _forced(isa: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"GANTRYCTL_ISA": isa}
    return subprocess.run(
        [sys.executable, "-c", _JOB], capture_output=True, text=True, env=environment, check=False
    )


def test_every_instruction_set_gives_the_same_bytes() -> None:
    runs = [_forced(isa).stdout.split() for isa in _core.isas()]
    assert [isa for isa, _ in runs] == _core.isas()
    assert len({digest for _, digest in runs}) == 1


def test_an_unknown_instruction_set_is_refused_with_what_there_is() -> None:
    refused = _forced("avx1024")
    assert refused.returncode != 0
    assert "avx1024" in refused.stderr
    assert "baseline" in refused.stderr
