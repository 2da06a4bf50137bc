"""What is measured of gantryctl itself: each job returns axis seconds per second of processor time, or a duration."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Final

import numpy as np

from gantryctl import _core
from gantryctl.engineering.batch import Leg, run_legs
from gantryctl.engineering.bench.rigid_machine import standing
from gantryctl.errors import DeviceError
from gantryctl.machine import default_machine, with_values
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.operation.run import AxisRun
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits


def rate(axis_s: float, run: Callable[[], object]) -> float:
    """Axis seconds per second of processor time."""
    begin = time.process_time()
    run()
    return axis_s / (time.process_time() - begin)


# --- the full plant -----------------------------------------------------------------------------------------------


def full(scheme: str, seconds: int, *, moving: bool = True) -> float:
    """Rate of the compiled loop on the whole plant, in motion or standing."""
    machine = default_machine()
    loop = standing(machine, scheme)
    target = plan_move(SetPoint(0.0, 0.0, 0.0), rad(90.0), motion_limits(machine))
    plan = target if moving else hold(0.0)
    out = np.empty((len(_core.LOG_COLUMNS), seconds * 1000))
    _core.run_closed_loop(loop.sim, loop.law, hold(0.0), loop.zero_counts, out[:, :1000].copy())
    return rate(seconds, lambda: _core.run_closed_loop(loop.sim, loop.law, plan, loop.zero_counts, out))


def many(plants: int, threads: int, seconds: float, clock: Callable[[], float] = time.perf_counter) -> float:
    """Axis seconds of all plants per second of the clock: a move of so many full plants at once."""
    machine = default_machine()
    loops = [standing(machine) for _ in range(plants)]
    plan = plan_move(SetPoint(0.0, 0.0, 0.0), rad(90.0), motion_limits(machine))
    begin = clock()
    run_legs(loops, [Leg(plan, seconds, 0.1)], threads)
    return plants * seconds / (clock() - begin)


def operations() -> float:
    """Additions, multiplications and divisions of one drive cycle of that move, all that the loop does counted."""
    loop = standing(default_machine())
    plan = plan_move(SetPoint(0.0, 0.0, 0.0), rad(90.0), motion_limits(default_machine()))
    add, multiply, divide, _ = _core.count_operations(loop.sim, loop.law, plan, loop.zero_counts, 5000)
    return add + multiply + divide


def cycles_per_s() -> float:
    """Drive cycles in a second of axis time."""
    return 1e6 / default_machine().drive.speed_loop.cycle_us


def arithmetic_limit(rounds: int) -> float:
    """Additions and multiplications per second of one core without fusing them, and without doing anything else."""
    begin = time.process_time()
    done = _core.arithmetic(rounds)
    return done / (time.process_time() - begin)


# --- scan by scan -------------------------------------------------------------------------------------------------


def engine(scan_ms: float, seconds: float, *, moving: bool = True) -> float:
    """Rate of the engine with the shipped program: every scan through the Python program and the drive port."""
    session = AxisRun(with_values(default_machine(), {"control.scan_period_ms": scan_ms}))
    try:
        session.power_up()
        command = session.operator.command
        if moving:
            session.operator.command = command._replace(
                move=True, target_rad=rad(170.0), speed_rad_s=rad(6.0)
            )
        session.engine.run_for(1.0)
        return rate(seconds, lambda: session.engine.run_for(seconds))
    finally:
        session.close("benchmark")


# --- whole commands -----------------------------------------------------------------------------------------------


def command_s(*arguments: str) -> float:
    """Wall time of a command line in a fresh state directory."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"XDG_STATE_HOME": folder, "HOME": folder}
        environment.pop("GANTRYCTL_STATE", None)
        begin = time.perf_counter()
        _run([sys.executable, "-m", "gantryctl", *arguments], folder, environment)
        return time.perf_counter() - begin


def python_s() -> float:
    """Wall time of a Python that does nothing: what no command can be faster than."""
    begin = time.perf_counter()
    _run([sys.executable, "-c", "pass"], None, None)
    return time.perf_counter() - begin


def _run(command: list[str], folder: str | None, environment: dict[str, str] | None) -> str:
    done = subprocess.run(  # noqa: S603 - this Python with arguments of this file, no shell
        command, check=False, capture_output=True, text=True, cwd=folder, env=environment
    )
    if done.returncode:
        raise DeviceError(
            f"{' '.join(command[1:])} ended with {done.returncode}: {done.stderr.strip()[:400]}"
        )
    return done.stdout


_CHORD: Final = """
import resource, time
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure
from gantryctl.engineering.accuracy.procedure.on_batch import run_procedure
from gantryctl.machine import default_machine
begin = time.perf_counter()
readings = run_procedure([default_machine()], chord_procedure("A"))
print(time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def chord_test() -> tuple[float, float]:
    """Wall time and peak of memory in MB of the compiled chord test, in a process of its own."""
    spent, memory = map(float, _run([sys.executable, "-c", _CHORD], None, None).split())
    return spent, memory
