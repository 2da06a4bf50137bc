"""python-control: plant and controllers as one discrete-time system."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from gantryctl.engineering.bench.rigid import (
    CYCLE_S,
    CYCLES,
    Run,
    Timed,
    acceleration,
    position_law,
    set_point,
    speed_loop,
)


def python_control(seconds: int, _folder: Path) -> Run:
    """`nlsys` with the time step of the drive, simulated by `input_output_response`."""
    import control
    import numpy as np

    def update(t: float, x: Any, _input: Any, _params: Any) -> Any:
        pos, vel, last, integral, command = map(float, x)
        cycle = round(t / CYCLE_S)
        # Two rates in one system: the position law acts in every eighth step.
        if cycle % CYCLES == 0:
            command = position_law(*set_point(cycle * CYCLE_S), pos)
        torque, integral = speed_loop(command, pos, last, integral)
        vel_next = vel + CYCLE_S * acceleration(pos, torque)
        return np.array([pos + CYCLE_S * vel_next, vel_next, pos, integral, command])

    def angle(_t: float, x: Any, _input: Any, _params: Any) -> Any:
        return x[:1]

    system = control.nlsys(update, angle, inputs=1, outputs=1, states=5, dt=CYCLE_S)
    steps = round(seconds / CYCLE_S)
    times = CYCLE_S * np.arange(steps + 1)

    def run() -> Timed:
        begin = time.process_time()
        found = control.input_output_response(system, times, np.zeros(steps + 1), np.zeros(5))
        spent = time.process_time() - begin
        per_second = round(1.0 / CYCLE_S)
        return Timed([float(a) for a in np.ravel(found.outputs)[per_second::per_second]], spent)

    return run
