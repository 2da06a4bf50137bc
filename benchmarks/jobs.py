"""What is measured: each job returns axis seconds per second of processor time, or a duration."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from python_loop import rigid_job, rigid_job_inlined

from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.operation.run import AxisRun
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import drive_params, plant_params

HERE: Final = Path(__file__).parent
RIGID_S: Final = 60
_EFFECTS: Final = (
    "gear_error", "backlash", "hysteresis", "roller_friction", "motor_friction", "base", "torque_ripple",
    "three_slopes",
)  # fmt: skip


def rate(axis_s: float, run: Callable[[], object]) -> float:
    """Axis seconds per second of processor time."""
    start = time.process_time()
    run()
    return axis_s / (time.process_time() - start)


# --- the rigid job: four times the same loop ---------------------------------------------------------------------


def compile_c(folder: Path) -> Path:
    """The yardstick, compiled like the core: no contraction to fused multiply-add."""
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise SystemExit("a C compiler is needed (cc, gcc, or CC=...)")
    program = folder / "rigid_loop"
    source = HERE / "rigid_loop.c"
    subprocess.run([compiler, "-O3", "-ffp-contract=off", str(source), "-o", str(program), "-lm"], check=True)
    return program


def rigid_c(program: Path) -> tuple[float, float]:
    """Rate and final motor angle of the C loop, which measures itself."""
    out = subprocess.run([str(program), "10"], check=True, capture_output=True, text=True).stdout.split()
    return float(out[0]), float(out[1])


def rigid_machine() -> Machine:
    """Rigid with eccentric moment, ideal encoder and current, no friction, no delay."""
    changes: dict[str, object] = {f"plant.switches.{name}": False for name in _EFFECTS}
    changes |= {
        "plant.switches.rigid": True,
        "drive.speed_loop.feedback": "ideal",
        "drive.speed_loop.delay_cycles": 0,
        "drive.current_loop.ideal": True,
        "plant.encoder.latency_us": 0.0,
    }
    return with_values(default_machine(), changes)


def standing(machine: Machine, scheme: str = "one_evaluation", steps: int = 2) -> ClosedLoop:
    """Servo on at 0 deg."""
    period_s = machine.control.scan_period_ms * 1e-3
    sim = _core.GantrySim(plant_params(machine), drive_params(machine), period_s, scheme, steps)
    return ClosedLoop.standing_at(sim, position_law(machine), 0.0)


def rigid_core() -> tuple[float, float]:
    """Rate and final motor angle of the compiled closed loop on the same job, five times over."""
    machine = rigid_machine()
    plan = plan_move(SetPoint(0.0, 0.0, 0.0), rad(90.0), motion_limits(machine))
    loops = [standing(machine) for _ in range(5)]
    out = np.empty((len(_core.LOG_COLUMNS), RIGID_S * 1000))

    def run() -> None:
        for loop in loops:
            _core.run_closed_loop(loop.sim, loop.law, plan, loop.zero_counts, out)

    return rate(5 * RIGID_S, run), loops[0].sim.truth()[2]


def rigid_python(*, inlined: bool = False) -> tuple[float, float]:
    """Rate and final motor angle of the same loop in Python, one function a law or all in one."""
    result: list[float] = []
    job = rigid_job_inlined if inlined else rigid_job
    speed = rate(RIGID_S, lambda: result.append(job(RIGID_S)))
    return speed, result[0]


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


# --- scan by scan -------------------------------------------------------------------------------------------------


def engine(scan_ms: float, *, moving: bool = True) -> float:
    """Rate of the engine with the shipped program: every scan through the Python program and the drive port."""
    session = AxisRun(with_values(default_machine(), {"control.scan_period_ms": scan_ms}))
    try:
        session.power_up()
        begin = session.engine.time_s
        start = time.process_time()
        if moving:
            session.move(20.0)
        else:
            session.engine.run_for(10.0)
        return (session.engine.time_s - begin) / (time.process_time() - start)
    finally:
        session.close("benchmark")


# --- whole commands -----------------------------------------------------------------------------------------------


def command_s(*arguments: str) -> float:
    """Wall time of a command line in a fresh state directory."""
    program = Path(sys.executable).with_name("gantryctl")
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"XDG_STATE_HOME": folder, "HOME": folder}
        start = time.perf_counter()
        subprocess.run(
            [str(program), *arguments], check=True, capture_output=True, cwd=folder, env=environment
        )
        return time.perf_counter() - start


_CHORD = """
import resource, time
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure
from gantryctl.engineering.accuracy.procedure.on_batch import run_procedure
from gantryctl.machine import default_machine
start = time.perf_counter()
readings = run_procedure([default_machine()], chord_procedure("A"))
print(time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, readings.axis_time_s)
"""


def chord_test() -> tuple[float, float, float]:
    """Wall time, peak of memory in MB and axis time of the compiled chord test in a process of its own."""
    out = subprocess.run(
        [sys.executable, "-c", _CHORD], check=True, capture_output=True, text=True
    ).stdout.split()
    return float(out[0]), float(out[1]), float(out[2])


def close_enough(a: float, b: float) -> bool:
    """The rigid loops did the same job: their motors stand at the same angle."""
    return math.isclose(a, b, rel_tol=0.0, abs_tol=1e-6)
