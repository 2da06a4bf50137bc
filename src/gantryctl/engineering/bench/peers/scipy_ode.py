"""SciPy: the plant as an ODE between two drive cycles, the controllers as functions."""

from __future__ import annotations

import time
from pathlib import Path

from gantryctl.engineering.bench.rigid import (
    CYCLE_S,
    CYCLES,
    Run,
    Timed,
    acceleration,
    position_law,
    set_points,
    speed_loop,
)


def scipy_ode(seconds: int, _folder: Path) -> Run:
    """`ode` with dopri5, begun anew for every drive cycle: 9 us each, where `odeint` takes 12 and `solve_ivp` 75 us."""
    from scipy.integrate import ode

    points = set_points(seconds)

    def plant(_time: float, state: list[float], torque: float) -> tuple[float, float]:
        return state[1], acceleration(state[0], torque)

    solver = ode(plant).set_integrator("dopri5", rtol=1e-9, atol=1e-9)

    def run() -> Timed:
        begin = time.process_time()
        pos = vel = last = integral = 0.0
        angles = []
        for k, (pos_ref, vel_ref) in enumerate(points, start=1):
            command = position_law(pos_ref, vel_ref, pos)
            for _ in range(CYCLES):
                torque, integral = speed_loop(command, pos, last, integral)
                last = pos
                solver.set_initial_value((pos, vel), 0.0).set_f_params(torque)
                pos, vel = map(float, solver.integrate(CYCLE_S))
            if k % 1000 == 0:
                angles.append(pos)
        return Timed(angles, time.process_time() - begin)

    return run
