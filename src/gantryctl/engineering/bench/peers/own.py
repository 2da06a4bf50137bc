"""gantryctl on the rigid job: the compiled closed loop with its whole log, and Python loops beside it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop
from gantryctl.engineering.bench import python_loop
from gantryctl.engineering.bench.rigid import ACC, HALF_S, TARGET, Run, Timed
from gantryctl.engineering.bench.rigid_machine import rigid_machine, standing

_MOTOR_COLUMN = _core.LOG_COLUMNS.index("pos_motor_rad")
_REPEATS = 5


def trapezoid() -> _core.Segments:
    """The set-point of the job as a plan."""
    half = 0.5 * TARGET
    return _core.Segments(
        [0.0, HALF_S], [0.0, half], [0.0, ACC * HALF_S], [ACC, -ACC], [0.0, 0.0], 2.0 * HALF_S, TARGET, 0.0
    )


def compiled_loop(seconds: int, _folder: Path) -> Run:
    """`run_closed_loop`, five plants one after the other: one is over in a fraction of a second."""
    machine, plan = rigid_machine(), trapezoid()
    log = np.empty((len(_core.LOG_COLUMNS), 1000 * seconds))

    def loop() -> ClosedLoop:
        return standing(machine)

    def run() -> Timed:
        loops = [loop() for _ in range(_REPEATS)]
        begin = time.process_time()
        for each in loops:
            _core.run_closed_loop(each.sim, each.law, plan, each.zero_counts, log)
        spent = (time.process_time() - begin) / _REPEATS
        # Row k is the state at the beginning of scan k.
        angles = [*log[_MOTOR_COLUMN, 1000::1000], loops[-1].sim.truth()[2]]
        return Timed(angles, spent)

    return run


def _timed(job: Callable[[int], list[float]], seconds: int) -> Run:
    def run() -> Timed:
        begin = time.process_time()
        angles = job(seconds)
        return Timed(angles, time.process_time() - begin)

    return run


def python_functions(seconds: int, _folder: Path) -> Run:
    """Pure Python, one function a law."""
    return _timed(python_loop.rigid_job, seconds)


def python_inlined(seconds: int, _folder: Path) -> Run:
    """Pure Python, everything in one loop."""
    return _timed(python_loop.rigid_job_inlined, seconds)
