"""Standing still costs no more than moving: no state lingers among the subnormal numbers."""

from __future__ import annotations

import numpy as np
import pytest

from gantryctl.wiring.simulator import gantry_sim
from physics.plants import OFF, SPEED, commanded, machine, put

SMALLEST_NORMAL = float(np.finfo(float).tiny)


def subnormal(state: dict[str, float]) -> list[str]:
    return [name for name, value in state.items() if value != 0.0 and abs(value) < SMALLEST_NORMAL]


@pytest.mark.parametrize("scheme", ["one_evaluation", "rk4"])
def test_no_state_is_subnormal_after_minutes_of_rest(scheme: str) -> None:
    """The torque decays with 0.27 ms, hysteresis in the gap with 10 ms, the swing of load and base with seconds:
    within these minutes each would pass through 1e-308.
    """
    m = machine({"plant.integration.scheme": scheme, "plant.load.eccentricity_m": 0.0})
    sim = gantry_sim(m)
    sim.static_start(0.3, True)
    put(sim, vel_load=1e-5)
    for mode, brake_open in ((SPEED, True), (OFF, False)):
        for _ in range(60 if scheme == "one_evaluation" else 12):
            commanded(sim, mode, 0.0, 1.0, brake_open)
            assert subnormal(sim.state) == []
    assert sim.state["torque_motor"] == 0.0


def test_a_state_in_the_gap_fades_and_stays_normal() -> None:
    """Flushing rounds to whole steps of 1e-216: it may stop at a few of them, far above the subnormal numbers."""
    m = machine({"plant.load.eccentricity_m": 0.0, "plant.transmission.backlash_mm": 0.4})
    sim = gantry_sim(m)
    sim.static_start(0.0, False)
    put(sim, hysteresis=100.0)
    seen = []
    for _ in range(9500):
        sim.scan(OFF, 0.0, 0.0, False)
        seen.append(sim.state["hysteresis"])
    assert seen[0] > 0.0
    assert 0.0 <= seen[-1] < 1e-214
    assert all(abs(x) >= SMALLEST_NORMAL for x in seen if x != 0.0)


def test_the_flush_takes_nothing_that_counts() -> None:
    """Numbers down to 1e-180 go through a scan of an untouched state unchanged."""
    m = machine({"plant.switches.base": True})
    sim = gantry_sim(m)
    sim.static_start(0.0, True)
    put(sim, drive_overload=1e-180)
    before = sim.state["pos_load"]
    sim.scan(OFF, 0.0, 0.0, True)
    assert sim.state["pos_load"] == pytest.approx(before, abs=1e-12)
