"""What the physics tests share: a plant with chosen effects, a run under a given torque, a run under the controller.

`bare` starts from the reference machine and leaves every effect out that is not asked for, so that each test sees
the one thing it is about. `locked` makes a body so heavy that it does not move.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from gantryctl import _core
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import drive_params, gantry_sim, plant_params

CYCLE_S: Final = 125e-6
DEG: Final = math.pi / 180.0
LOCKED: Final = 1e18  # kg m2: torques of 1e5 N m move it by 1e-13 rad in a second
OFF, SPEED, QUICK_STOP = 0, 1, 2
SWITCHES: Final = (
    "gear_error", "backlash", "hysteresis", "roller_friction", "motor_friction", "eccentric_moment", "base",
    "torque_ripple", "three_slopes",
)  # fmt: skip

Arrays = dict[str, np.ndarray]


def machine(changes: dict[str, object] | None = None) -> Machine:
    """The reference machine, with other values by dotted path."""
    return with_values(default_machine(), changes or {})


def machine_with(*effects: str, **changes: object) -> Machine:
    """The reference machine with only these effects switched on; other values as `table__key=value`."""
    values: dict[str, object] = {f"plant.switches.{name}": name in effects for name in SWITCHES}
    values["plant.switches.rigid"] = "rigid" in effects
    values["drive.current_loop.ideal"] = "current_loop" not in effects
    if "damping" not in effects:
        values["plant.transmission.damping_ratio"] = values["plant.base.damping_ratio"] = 0.0
    return machine(values | {path.replace("__", "."): value for path, value in changes.items()})


def bare(*effects: str, **fields: Any) -> _core.PlantParams:
    """Plant parameters with only these effects; `fields` are set on top, in SI."""
    p = plant_params(machine_with(*effects))
    for name, value in fields.items():
        setattr(p, name, value)
    return p


def simulator(
    plant: _core.PlantParams, scheme: str = "rk4", steps: int = 2, scan_s: float = 1e-3, **drive: Any
) -> _core.GantrySim:
    """A simulator of the plant with the reference drive, fields of the drive set on top."""
    d = drive_params(default_machine())
    for name, value in drive.items():
        setattr(d, name, value)
    return _core.GantrySim(plant, d, scan_s, scheme, steps)


def released(
    plant: _core.PlantParams, theta_rad: float = 0.0, steps: int = 2, **state: float
) -> _core.GantrySim:
    """A simulator with the brake open, in static balance at an angle but for the states given."""
    sim = simulator(plant, steps=steps)
    sim.static_start(theta_rad, True)
    return put(sim, **state)


def put(sim: _core.GantrySim, **state: float) -> _core.GantrySim:
    """Change parts of the state."""
    sim.state = sim.state | state
    return sim


def at_instant(
    plant: _core.PlantParams, torque_nm: float = 0.0, **state: float
) -> tuple[float, dict[str, float]]:
    """Mesh torque and the time derivative of every state at one instant, brake open.

    The one-evaluation scheme adds dt times the acceleration at the start, however long dt is: one second gives the
    speeds without loss of digits. Friction states want a step in which nothing slides.
    """
    sim = simulator(plant, "one_evaluation")
    sim.static_start(0.0, True)
    before = put(sim, **state).state
    rates = {}
    for dt, names in (
        (1e-9, ("roller_z", "motor_z", "hysteresis")),
        (1.0, ("vel_motor", "vel_load", "vel_base")),
    ):
        sim.state = before
        sim.advance(torque_nm, dt)
        rates |= {name: (sim.state[name] - before[name]) / dt for name in names}
    return sim.truth()[6], rates


def follow(
    sim: _core.GantrySim, torque: Callable[[float], float] | float, seconds: float, dt: float = CYCLE_S
) -> Arrays:
    """Every state at every step under a torque set-point; the drive and its loops play no part."""
    law = torque if callable(torque) else lambda _: torque
    count = round(seconds / dt)
    rows = [sim.state]
    for k in range(count):
        sim.advance(law(k * dt), dt)
        rows.append(sim.state)
    names = [name for name in rows[0] if not name.startswith(("drive", "brake_c", "report", "count"))]
    result = {name: np.array([row[name] for row in rows]) for name in names}
    result["t"] = np.arange(count + 1) * dt
    result["torque_mesh"] = np.array([row["report_torque_mesh"] for row in rows])
    return result


def controlled(
    m: Machine, plan: _core.Segments, seconds: float, sim: _core.GantrySim | None = None
) -> dict[str, np.ndarray]:
    """Log of the paper's controller on a machine: servo on, standing where the plan begins, zeroed there."""
    law = position_law(m)
    start = plan.sample(0.0)[0]
    if sim is None:
        sim = gantry_sim(m)
    sim.static_start(start, True)
    counts = sim.feedback(law.rad_per_count)[0]
    scans = round(seconds / sim.scan_period_s)
    out = np.empty((len(_core.LOG_COLUMNS), scans))
    _core.run_closed_loop(sim, law, plan, counts - law.ratio * start / law.rad_per_count, out)
    log = dict(zip(_core.LOG_COLUMNS, out, strict=True))
    log["t"] = np.arange(scans) * sim.scan_period_s
    return log


def commanded(sim: _core.GantrySim, mode: int, vel_rad_s: float, seconds: float, brake_open: bool) -> Arrays:
    """Log of one command to the drive, without position loop."""
    scans = round(seconds / sim.scan_period_s)
    out = np.empty((len(_core.LOG_COLUMNS), scans))
    _core.run_command(sim, mode, vel_rad_s, brake_open, out)
    log = dict(zip(_core.LOG_COLUMNS, out, strict=True))
    log["t"] = np.arange(scans) * sim.scan_period_s
    return log


def trapezoid(
    start_deg: float,
    end_deg: float,
    vel_deg_s: float = 6.0,
    acc_deg_s2: float = 450.0 / 1144.0,
    rest_s: float = 0.0,
) -> _core.Segments:
    """The paper's profile after a rest: constant acceleration, constant speed, constant deceleration."""
    start, way = start_deg * DEG, (end_deg - start_deg) * DEG
    side, distance = math.copysign(1.0, way), abs(way)
    acc = acc_deg_s2 * DEG
    vel = min(vel_deg_s * DEG, math.sqrt(distance * acc))
    ramp = vel / acc
    # A short way is two ramps, and what is left between them a rounding of either sign.
    cruise = max(0.0, distance / vel - ramp)
    t = [0.0, rest_s, rest_s + ramp, rest_s + ramp + cruise]
    first = 0.5 * acc * ramp * ramp
    way_to = [0.0, 0.0, first, first + vel * cruise]
    return _core.Segments(
        t,
        [start + side * x for x in way_to],
        [0.0, 0.0, side * vel, side * vel],
        [0.0, side * acc, 0.0, -side * acc],
        [0.0] * 4,
        t[3] + ramp,
        start + way,
        0.0,
    )


def hold(angle_rad: float) -> _core.Segments:
    """Stand still."""
    return _core.Segments([], [], [], [], [], 0.0, angle_rad, 0.0)


def ramp(start_rad: float, vel_rad_s: float) -> _core.Segments:
    """Constant speed from the first instant on, without end."""
    return _core.Segments(
        [0.0], [start_rad], [vel_rad_s], [0.0], [0.0], 1e6, start_rad + vel_rad_s * 1e6, 0.0
    )


def frequency_and_damping(t: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Of a decaying oscillation around zero, from its zero crossings and its peaks between them: Hz, ratio."""
    at = np.nonzero(np.diff(np.sign(x)) != 0)[0]
    crossings = t[at] - x[at] * (t[at + 1] - t[at]) / (x[at + 1] - x[at])
    period = 2.0 * float(np.polyfit(np.arange(len(crossings)), crossings, 1)[0])
    peaks = [float(np.max(np.abs(x[a : b + 1]))) for a, b in itertools.pairwise(at)]
    decrement = -2.0 * float(np.polyfit(np.arange(len(peaks)), np.log(peaks), 1)[0])
    return 1.0 / period, decrement / math.hypot(2.0 * math.pi, decrement)
