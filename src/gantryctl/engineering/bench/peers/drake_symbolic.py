"""Drake: a `SymbolicVectorSystem` with the time step of the drive, advanced by its simulator; no Python runs inside."""

from __future__ import annotations

import time
from pathlib import Path

from gantryctl.engineering.bench.rigid import (
    ACC,
    CYCLE_S,
    CYCLES,
    ECCENTRIC_NM,
    HALF_S,
    INERTIA_KG_M2,
    KPP,
    KVF,
    KVP,
    LIMIT_NM,
    RATIO,
    TARGET,
    TVI,
    Run,
    Timed,
)


def drake_symbolic(seconds: int, _folder: Path) -> Run:
    """State: angle, speed, last angle, integral, held command, cycle in the scan, number of the scan."""
    from pydrake.symbolic import Variable, if_then_else, logical_or, sin
    from pydrake.symbolic import max as largest
    from pydrake.symbolic import min as least
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.primitives import SymbolicVectorSystem

    names = ("pos", "vel", "last", "integral", "held", "cycle", "scan")
    state = [Variable(name) for name in names]
    pos, vel, last, integral, held, cycle, scan = state
    t = scan * (CYCLE_S * CYCLES)
    left = 2.0 * HALF_S - t
    pos_ref = if_then_else(
        t < HALF_S,
        0.5 * ACC * t * t,
        if_then_else(t < 2.0 * HALF_S, TARGET - 0.5 * ACC * left * left, TARGET + 0.0 * t),
    )
    vel_ref = if_then_else(t < HALF_S, ACC * t, if_then_else(t < 2.0 * HALF_S, ACC * left, 0.0 * t))
    command = if_then_else(cycle < 0.5, KPP * (RATIO * pos_ref - pos) + KVF * RATIO * vel_ref, held)
    error = command - (pos - last) / CYCLE_S
    wanted = KVP * (error + integral)
    torque = least(largest(wanted, -LIMIT_NM), LIMIT_NM)
    free = logical_or(torque == wanted, (wanted - torque) * error < 0.0)
    integral_next = if_then_else(free, integral + error * CYCLE_S / TVI, integral)
    load = ECCENTRIC_NM * sin(pos / RATIO) / RATIO
    vel_next = vel + CYCLE_S * (torque + load) / INERTIA_KG_M2
    ends = cycle > CYCLES - 1.5
    system = SymbolicVectorSystem(
        state=state,
        dynamics=[
            pos + CYCLE_S * vel_next,
            vel_next,
            pos,
            integral_next,
            command,
            if_then_else(ends, 0.0 * cycle, cycle + 1.0),
            if_then_else(ends, scan + 1.0, scan),
        ],
        output=[pos],
        time_period=CYCLE_S,
    )

    def run() -> Timed:
        simulator = Simulator(system)
        context = simulator.get_mutable_context()
        context.SetDiscreteState([0.0] * len(names))
        begin = time.process_time()
        angles = []
        for second in range(1, seconds + 1):
            # Half a cycle before the update at that second: the updates up to here have made the state at it.
            simulator.AdvanceTo(second - 0.5 * CYCLE_S)
            angles.append(float(context.get_discrete_state_vector().GetAtIndex(0)))
        return Timed(angles, time.process_time() - begin)

    return run
