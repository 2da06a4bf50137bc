"""A modulo axis at the service: directions, ways beyond a turn, and tags within the turn."""

import math

import pytest

from gantryctl.image import Mode
from gantryctl.program import AxisState
from support.modulo_machine import modulo_machine
from support.service_bench import Bench

# Wind-up and gear error between motor and load of the reference plant.
LOAD_DEG = 0.02


def bench_of(**limits: object) -> Bench:
    bench = Bench(machine=modulo_machine({"control.scan_period_ms": 10.0, **limits}))
    who = bench.who()
    bench.do(who, "take", over=False)
    bench.do(who, "power", on=True)
    bench.until(AxisState.STANDSTILL)
    bench.do(who, "set", tag="speed_setting_deg_s", value=6.0)
    return bench


def arrive(bench: Bench) -> float:
    """The true angle of the load after the motion, deg."""
    bench.until(AxisState.DISCRETE_MOTION)
    bench.until(AxisState.STANDSTILL, 300.0)
    return math.degrees(bench.engine.drive.truth()[0])


def test_a_move_takes_its_direction_and_a_way_goes_beyond_the_turn() -> None:
    bench = bench_of()
    who = bench.who()
    bench.do(who, "move", target_deg=-10.0)
    assert arrive(bench) == pytest.approx(-10.0, abs=LOAD_DEG)
    bench.do(who, "move", target_deg=-20.0, direction="positive")
    assert arrive(bench) == pytest.approx(340.0, abs=LOAD_DEG)
    bench.do(who, "move_by", distance_deg=400.0)
    assert arrive(bench) == pytest.approx(740.0, abs=LOAD_DEG)
    bench.do(who, "move", target_deg=10.0, direction="negative")
    assert arrive(bench) == pytest.approx(730.0, abs=LOAD_DEG)
    # No direction is the shortest way, whatever was asked for before.
    bench.do(who, "move", target_deg=20.0)
    assert arrive(bench) == pytest.approx(740.0, abs=LOAD_DEG)
    assert bench.refused(who, "move", target_deg=400.0) == "CTL-01"
    assert bench.refused(who, "move", target_deg=10.0, direction="up") == "SEC-05"


def test_a_linear_axis_refuses_a_direction() -> None:
    bench = Bench()
    who = bench.who()
    bench.do(who, "take", over=False)
    bench.do(who, "power", on=True)
    bench.until(AxisState.STANDSTILL)
    assert bench.refused(who, "move", target_deg=1.0, direction="shortest") == "CTL-14"
    bench.do(who, "move_by", distance_deg=0.5)
    assert arrive(bench) == pytest.approx(0.5, abs=LOAD_DEG)


def test_a_key_turns_the_axis_over_the_end_of_its_turn() -> None:
    bench = bench_of()
    who = bench.who()
    bench.do(who, "move", target_deg=-150.0)
    arrive(bench)
    bench.do(who, "mode", mode="continuous")
    assert bench.program.mode is Mode.CONTINUOUS
    lease = "00000000000000aa"
    bench.do(who, "jog", lease=lease, direction="reverse")
    for _ in range(250):  # 25 s; a key is held for 30 s at most
        bench.scans(10)
        bench.send(who, "renew", lease=lease)
    assert bench.axis.plan_end_s == math.inf
    assert bench.axis.state is AxisState.CONTINUOUS_MOTION
    bench.do(who, "release", lease=lease)
    bench.until(AxisState.STANDSTILL)
    assert math.degrees(bench.engine.drive.truth()[0]) < -270.0
    bench.scans(50)
    assert abs(bench.axis.virtual.pos_ref_rad) <= math.pi
    assert not [alarm.code for alarm in bench.axis.alarms.history if alarm.code.startswith(("LIM", "ENC"))]
