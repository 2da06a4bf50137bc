"""Random machines, laws and set-point plans: what engine, compiled loop and batch have to agree on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from gantryctl import _core
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import gantry_sim

_SWITCHES = (
    "gear_error", "backlash", "hysteresis", "roller_friction", "motor_friction", "eccentric_moment", "base",
    "torque_ripple", "three_slopes", "tooth_pitch", "thermal", "ageing", "cogging", "encoder_errors", "cable",
)  # fmt: skip


def factor(low: float, high: float) -> st.SearchStrategy[float]:
    """A number by which something is multiplied."""
    return st.floats(low, high, allow_nan=False)


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    """The reference machine with other gains, another plant, another drive and another scan."""
    base = default_machine()
    changes: dict[str, object] = {
        # The heaviest needs more than the reference machine permits itself.
        "required.stopping_angle_deg": 5.0,
        "control.scan_period_ms": draw(st.sampled_from([0.5, 1.0, 2.0, 4.0])),
        "control.kpp_per_s": 10.0 * draw(factor(0.1, 4.0)),
        "control.kvf": draw(factor(0.0, 1.2)),
        "drive.speed_loop.kvp_nm_s_per_rad": 77.7 * draw(factor(0.3, 1.3)),
        "drive.speed_loop.feedback": draw(st.sampled_from(["ideal", "interpolated", "counts"])),
        "drive.speed_loop.delay_cycles": draw(st.sampled_from([0, 1])),
        "drive.current_loop.ideal": draw(st.booleans()),
        "plant.load.inertia_kg_m2": 2.18e6 * draw(factor(0.5, 1.5)),
        "plant.load.eccentricity_m": draw(factor(0.0, 0.012)),
        "plant.transmission.backlash_mm": draw(factor(0.0, 0.4)),
        "plant.transmission.damping_ratio": draw(factor(0.005, 0.1)),
        "plant.gear_error.scale": draw(factor(0.0, 3.0)),
        "plant.gear_error.phases_rad": draw(st.tuples(*[factor(0.0, 6.28)] * 18)),
        "plant.roller_friction.coulomb_nm": (roller_nm := 6000.0 * draw(factor(0.1, 1.0))),
        "plant.roller_friction.breakaway_nm": roller_nm * draw(factor(1.0, 4.0)),
        "plant.motor_friction.coulomb_nm": (motor_nm := 5.5 * draw(factor(0.1, 1.0))),
        "plant.motor_friction.breakaway_nm": motor_nm * draw(factor(1.0, 4.0)),
        "plant.thermal.gears_start_k": draw(factor(-10.0, 10.0)),
        "plant.thermal.gears_end_k": draw(factor(-10.0, 10.0)),
        "plant.thermal.motor_end_k": draw(factor(-10.0, 90.0)),
        "plant.motor.torque_constant_ratio": draw(st.sampled_from([1.0, 0.9, 1.1])),
        "plant.tooth_pitch.seed": draw(st.integers(0, 3)),
        "plant.integration.scheme": draw(st.sampled_from(["one_evaluation", "rk4"])),
    }
    for name in _SWITCHES:
        changes[f"plant.switches.{name}"] = draw(st.booleans())
    changes["plant.switches.rigid"] = rigid = draw(st.integers(0, 9)) == 0
    changes["plant.switches.second_pinion"] = not rigid and draw(st.integers(0, 3)) == 0
    changes["plant.second_pinion.lost"] = draw(st.sampled_from(["none", "none", "first", "second"]))
    changes["plant.second_pinion.preload_nm"] = draw(factor(-40.0, 40.0))
    return with_values(base, changes)


@st.composite
def plans(draw: st.DrawFn, duration_s: float = 0.12) -> _core.Segments:
    """Continuous segments of random jerk, some without: any profile a planner could make, and worse."""
    count = draw(st.integers(0, 4))
    limit = math.radians(3.0)
    t, pos = 0.0, draw(st.floats(-3.0, 3.0))
    vel, acc = draw(st.floats(-limit, limit)), 0.0
    columns: list[tuple[float, ...]] = []
    for _ in range(count):
        length = draw(st.floats(1e-4, duration_s / 2))
        jerk = draw(st.one_of(st.just(0.0), st.floats(-1.0, 1.0)))
        acc = draw(st.one_of(st.just(acc), st.floats(-0.1, 0.1)))
        columns.append((t, pos, vel, acc, jerk))
        pos += length * (vel + length * (acc / 2 + length * jerk / 6))
        vel += length * (acc + length * jerk / 2)
        acc += length * jerk
        t += length
    rows = [list(column) for column in zip(*columns, strict=True)] if columns else [[]] * 5
    return _core.Segments(*rows, duration=t, pos_end=pos, vel_end=draw(st.sampled_from([0.0, vel])))


@dataclass
class Run:
    """One axis standing where its plan begins."""

    sim: _core.GantrySim
    law: _core.PositionLaw
    zero_counts: float


def standing(machine: Machine, angle_rad: float) -> Run:
    """Servo on, encoder zeroed so that the motor is where the set-point says."""
    sim, law = gantry_sim(machine), position_law(machine)
    sim.static_start(angle_rad, True)
    counts = sim.feedback(law.rad_per_count)[0]
    return Run(sim, law, counts - round(law.ratio * angle_rad / law.rad_per_count))


def compiled(run: Run, plan: _core.Segments, scans: int) -> np.ndarray:
    """Every column of every scan by the compiled loop; the plant in `run` moves on."""
    out = np.empty((len(_core.LOG_COLUMNS), scans))
    _core.run_closed_loop(run.sim, run.law, plan, run.zero_counts, out)
    return out


def scan_by_scan(run: Run, plan: _core.Segments, scans: int, first: int = 0) -> np.ndarray:
    """The same through the calls that a program in Python makes."""
    period = run.sim.scan_period_s
    out = np.empty((len(_core.LOG_COLUMNS), scans))
    for k in range(scans):
        pos, vel, acc = plan.sample((first + k) * period)
        counts, speed, torque, brake_open, limited, *_ = run.sim.feedback(run.law.rad_per_count)
        counts -= run.zero_counts
        command, actual, error = run.law.scan(pos, vel, counts)
        load, vel_load, motor, vel_motor, base, vel_base, mesh = run.sim.truth()
        assert brake_open
        row = {
            "pos_ref_rad": pos, "vel_ref_rad_s": vel, "acc_ref_rad_s2": acc, "pos_act_rad": actual,
            "pos_err_rad": error, "vel_cmd_rad_s": command, "torque_act_nm": torque, "pos_load_rad": load,
            "vel_load_rad_s": vel_load, "pos_motor_rad": motor, "vel_motor_rad_s": vel_motor,
            "pos_base_rad": base, "vel_base_rad_s": vel_base, "torque_mesh_nm": mesh, "counts": counts,
            "torque_limited": float(limited), "pos_ring_rad": 0.0, "torque_ff_nm": 0.0, "vel_report_rad_s": speed,
        }  # fmt: skip
        out[:, k] = [row[name] for name in _core.LOG_COLUMNS]
        run.sim.scan(1, command, 0.0, True)
    return out


def leg_figures(log: np.ndarray, law: _core.PositionLaw, average: int) -> dict[str, float]:
    """What `run_legs` keeps of a leg, from a log of every scan."""
    column = dict(zip(_core.LOG_COLUMNS, log, strict=True))

    def mean(values: np.ndarray) -> float:
        total = 0.0
        for value in values[-average:]:  # in order: numpy adds pairwise, which rounds differently
            total += float(value)
        return total / average

    def largest(values: np.ndarray) -> float:
        return float(np.max(np.abs(values)))

    return {
        "mean_pos_load_rad": mean(column["pos_load_rad"]),
        "mean_pos_ring_rad": mean(column["pos_load_rad"] - column["pos_base_rad"]),
        "mean_pos_act_rad": mean(column["pos_act_rad"]),
        "max_vel_err_motor_rad_s": largest(column["vel_motor_rad_s"] / law.ratio - column["vel_ref_rad_s"]),
        "max_vel_err_load_rad_s": largest(column["vel_load_rad_s"] - column["vel_ref_rad_s"]),
        "max_pos_err_motor_rad": largest(column["pos_err_rad"]),
        "max_pos_err_load_rad": largest(column["pos_ref_rad"] - column["pos_load_rad"]),
        "max_torque_motor_nm": largest(column["torque_act_nm"]),
        "max_torque_mesh_nm": largest(column["torque_mesh_nm"]),
        "max_travel_motor_rad": largest((column["pos_motor_rad"] - column["pos_motor_rad"][0]) / law.ratio),
        "max_travel_load_rad": largest(column["pos_load_rad"] - column["pos_load_rad"][0]),
    }
