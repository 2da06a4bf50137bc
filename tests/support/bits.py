"""Instruction set, and digests of what the core and the engine compute: equal wherever the core was compiled well.

python bits.py          # plants in a batch, their logs, one logged run, one scan from outside
python bits.py move     # beside it the trace of a move, scan by scan
"""

import hashlib
import sys

import numpy as np

from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop, Leg, log_legs, run_legs
from gantryctl.machine import default_machine, with_values
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.operation.scripting import move
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
columns = [
    *figures[0],
    *(each[name] for each in (log, *rows) for name in each.columns),
    np.array(loops[0].sim.truth()),
]
print(_core.isa(), hashlib.sha256(b"".join(np.ascontiguousarray(c).tobytes() for c in columns)).hexdigest())
if "move" in sys.argv:
    print(move(machine, 10.0).trace.hash())
