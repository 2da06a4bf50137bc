"""Section 4 of the expected figures: the sampled rigid loop, within 3 %.

P at 1 ms, PI at 125 us, torque held over a cycle, no extra delay, J_wg = 0, ideal encoder, ideal current.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantryctl.wiring.simulator import plant_params
from physics.plants import DEG, controlled, machine_with, ramp, simulator, trapezoid

EXPECTED: dict[str, Any] = json.loads(
    (Path(__file__).parent.parent / "data" / "expected.json").read_text(encoding="utf-8")
)["4_sampled_rigid"]


def rigid(**changes: object) -> Any:
    return machine_with(
        "rigid",
        plant__motor__wave_generator_inertia_kg_m2=0.0,
        drive__speed_loop__feedback="ideal",
        drive__speed_loop__delay_cycles=0,
        plant__encoder__latency_us=0.0,
        **changes,
    )


@pytest.mark.parametrize(("way", "seconds"), [(20, 16.0), (180, 47.0)])
def test_trapezoid_errors(way: int, seconds: float) -> None:
    log = controlled(rigid(), trapezoid(0.0, way), seconds)
    speed = np.max(np.abs(log["vel_load_rad_s"] - log["vel_ref_rad_s"])) / DEG
    position = np.max(np.abs(log["pos_load_rad"] - log["pos_ref_rad"])) / DEG
    expected = EXPECTED[f"trap_{way}deg_max_speed_error_deg_s"]
    assert speed == pytest.approx(expected["value"], rel=expected["rtol"])
    expected = EXPECTED[f"trap_{way}deg_max_position_error_deg"]
    assert position == pytest.approx(expected["value"], rel=expected["rtol"])


@pytest.mark.parametrize(
    ("way", "duration_s", "peak_deg_s"), [(6.0, 7.8111, 1.5363), (-14.0, 11.9316, -2.3467)]
)
def test_a_short_trapezoid_is_two_ramps(way: float, duration_s: float, peak_deg_s: float) -> None:
    """2 sqrt(way / a) long and sqrt(way a) fast in the middle, by hand with a = 450/1144 deg/s2, to four digits."""
    plan = trapezoid(0.0, way)
    assert plan.duration == pytest.approx(duration_s, abs=1e-4)
    middle = np.array(plan.sample(0.5 * plan.duration)) / DEG
    assert middle[:2] == pytest.approx([0.5 * way, peak_deg_s], abs=1e-4)
    assert plan.sample(plan.duration)[0] / DEG == pytest.approx(way, abs=1e-9)


def test_ramp_without_feed_forward() -> None:
    """Linear to the end: it asks for 1.6 kN m at first, so the torque limit is taken away."""
    m = rigid(control__kvf=0.0)
    drive = {"delay_cycles": 0, "latency_s": 0.0, "speed_count_rad": 0.0, "position_count_rad": 0.0}
    sim = simulator(plant_params(m), "one_evaluation", torque_rated_nm=1e6, torque_max_nm=1e6, **drive)
    log = controlled(m, ramp(0.0, 6.0 * DEG), 0.6, sim)
    expected = EXPECTED["ramp6_Kvf0_error_deg_at"]
    for time, value in expected["value"].items():
        k = round(float(time) * 1000)
        error = (log["pos_ref_rad"][k] - log["pos_load_rad"][k]) / DEG
        assert error == pytest.approx(value, rel=expected["rtol"]), time


def test_every_figure_of_the_section_is_tested() -> None:
    assert set(EXPECTED) == {
        "trap_20deg_max_speed_error_deg_s",
        "trap_20deg_max_position_error_deg",
        "trap_180deg_max_speed_error_deg_s",
        "trap_180deg_max_position_error_deg",
        "ramp6_Kvf0_error_deg_at",
    }
