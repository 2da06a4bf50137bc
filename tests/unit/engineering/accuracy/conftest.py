"""A small synthetic report: a wavy gear, a tracker, a speed test that looks like one."""

import numpy as np
import pytest

from gantryctl.engineering.accuracy.budget import table_budget
from gantryctl.engineering.accuracy.noise import chord_result
from gantryctl.engineering.accuracy.procedure.procedures import Procedure, chord_procedure, evaluate
from gantryctl.engineering.accuracy.report.report import AccuracyReport, GearEnsemble, SpeedCurves, SpeedRun
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.accuracy.table import Direction
from gantryctl.engineering.instruments.sources import sources_of
from gantryctl.engineering.report.origin import Origin
from gantryctl.machine import Requirement

RADIUS_M, SIGMA_M = 2.5, 10e-6
ACC_DEG_S2 = 450.0 / 1144.0


def wavy_readings(procedure: Procedure, phase: float) -> np.ndarray:
    """Angles of an axis whose gear has two waves per some 40 and 13 deg."""
    targets = procedure.targets_rad
    return targets + 3e-5 * np.sin(9.0 * targets + phase) + 1.5e-5 * np.sin(26.0 * targets + 2.0 * phase)


def speed_run(speed: float, direction: Direction, stick_slip: bool = False) -> SpeedRun:
    """A trapezoid with a decaying swing after each corner."""
    ramp = speed / ACC_DEG_S2
    time = np.arange(0.0, 2.0 * ramp + 20.0, 0.005)
    ref = np.interp(time, [1.0, 1.0 + ramp, 11.0 + ramp, 11.0 + 2.0 * ramp], [0.0, speed, speed, 0.0])
    swing = np.zeros_like(time)
    for corner in (1.0, 1.0 + ramp, 11.0 + ramp, 11.0 + 2.0 * ramp):
        after = np.maximum(time - corner, 0.0)
        swing += 0.03 * np.exp(-0.3 * after) * np.sin(12.5 * after) * (time > corner)
    curves = SpeedCurves(
        time, direction.sign * ref, direction.sign * ref + 0.15 * swing, direction.sign * ref + swing
    )
    return SpeedRun(
        speed_deg_s=speed,
        direction=direction,
        travel_deg=(-90.0 * direction.sign, 90.0 * direction.sign),
        reached_deg_s=speed,
        motor_error_deg_s=float(np.abs(curves.motor_error_deg_s).max()),
        load_error_deg_s=float(np.abs(curves.load_error_deg_s).max()),
        required=Requirement(0.01, "demo_gantry", "a sheet"),
        stick_slip=stick_slip,
        curves=curves,
    )


def demo_report(runs: int = 1) -> AccuracyReport:
    """Every part of a report filled."""
    procedure = chord_procedure("A", runs=runs)
    readings = wavy_readings(procedure, 1.0)
    result = chord_result(procedure, readings, RADIUS_M, SIGMA_M, seed=1)
    gears = [evaluate(procedure, wavy_readings(procedure, phase), RADIUS_M) for phase in range(8)]
    return AccuracyReport(
        machine="demo_gantry",
        config_hash="0f3a" * 16,
        version="0.1.0",
        seed=1,
        created="2026-11-20",
        source="simulator",
        measured=result.measured,
        origin=Origin.SIMULATED,
        procedure=procedure,
        true=result.true,
        a_measured=result.a_measured,
        a_floor=result.a_floor,
        radius_m=RADIUS_M,
        sigma_m=SIGMA_M,
        dwell_s=6.0,
        average_s=2.0,
        vel_max_deg_s=6.0,
        acc_deg_s2=ACC_DEG_S2,
        angle_errors_deg=tuple(np.degrees(readings - procedure.targets_rad)),
        settings={"Profile": "trapezoid", "Position loop": "Kpp 10 /s, Kvf 100 %"},
        switches={
            "gear_error": True,
            "backlash": True,
            "roller_friction": True,
            "base": True,
            "rigid": False,
        },
        phases_fitted=True,
        required=Requirement(0.1, "demo_gantry", "a sheet"),
        of_reference=True,
        speed=tuple(speed_run(v, way, stick_slip=v < 1.0) for v in (0.6, 3.0, 6.0) for way in Direction),
        budget=table_budget(result.measured, "laser tracker", sources_of("tracker", RADIUS_M, 1e6 * SIGMA_M)),
        ensemble=GearEnsemble(tuple(float(accuracy_a(gear.errors_deg)) for gear in gears), tuple(range(8))),
    )


@pytest.fixture(scope="session")
def report() -> AccuracyReport:
    return demo_report()


@pytest.fixture(scope="session")
def five_runs() -> AccuracyReport:
    return demo_report(runs=5)
