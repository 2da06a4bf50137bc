"""Two pinions on one ring, on the whole reference plant: gaps under preload, loss of a drive.

Balances by hand, one effect at a time, are in core/tests/two_pinions_test.cpp.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from gantryctl import _core
from gantryctl.engineering.analysis.models.mechanics import PlantKind, mechanics
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine
from gantryctl.units import rad
from gantryctl.wiring.plant_effects import larger_share_nm
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import gantry_sim, plant_params, sim_drive, turned_back
from gantryctl.wiring.virtual import drive_hardware
from physics.plants import OFF, QUICK_STOP, SPEED, commanded, controlled, hold, machine, trapezoid
from support.modulo_machine import modulo_machine

ON = {"plant.switches.second_pinion": True}


def two(preload_nm: float = 35.0, **changes: Any) -> Machine:
    """The reference machine on two pinions; other values as `table__key=value`."""
    given = {path.replace("__", "."): value for path, value in changes.items()}
    return machine(ON | {"plant.second_pinion.preload_nm": preload_nm} | given)


def depths(m: Machine, state: dict[str, float]) -> tuple[float, float]:
    """How far each pinion is beyond the middle of its gap (S3: D), rad at the gantry."""
    p, other = plant_params(m), plant_params(m)
    for name in ("reducer_2x", "reducer_1x", "reducer_4x", "pinion", "mesh"):
        setattr(other, f"phase_{name}_rad", getattr(p, f"second_phase_{name}_rad"))
    rho = state["pos_load"] - state["pos_base"]
    first = state["pos_motor"] / p.ratio + _core.motor_error(p, state["pos_motor"])[0]
    second = state["pos_motor_2"] / p.ratio + _core.motor_error(other, state["pos_motor_2"])[0]
    return (
        first + _core.ring_error(p, rho)[0] - rho,
        second + _core.ring_error(p, rho + p.second_angle_rad)[0] - rho,
    )


def moved(m: Machine, *places_deg: float, vel_deg_s: float = 6.0) -> Iterator[dict[str, float]]:
    """States every 4 ms on moves of the paper's profile from place to place, with a rest after each."""
    sim, law, start = gantry_sim(m), position_law(m), places_deg[0]
    sim.static_start(rad(start), True)
    zero = sim.feedback(law.rad_per_count)[0] - law.ratio * rad(start) / law.rad_per_count
    for a, b in itertools.pairwise(places_deg):
        plan = trapezoid(a, b, vel_deg_s)
        for k in range(round((plan.duration + 0.3) / sim.scan_period_s)):
            pos, vel, _ = plan.sample(k * sim.scan_period_s)
            sim.scan(SPEED, law.scan(pos, vel, sim.feedback(law.rad_per_count)[0] - zero)[0], 0.0, True)
            if k % 4 == 3:
                yield sim.state


def way_through(m: Machine, start_deg: float, end_deg: float) -> np.ndarray:
    """`depths` on the way there and back."""
    return np.array([depths(m, state) for state in moved(m, start_deg, end_deg, start_deg)])


def test_no_gap_opens_where_the_preload_is_more_than_half_the_load() -> None:
    """16.0 of eccentric moment, 6.8 of friction, 2 x 15.0 kN m of acceleration that the load swings into: half of it
    over 1144 is 23.1 N m. The friction of the motors that goes with their load takes a tenth, hysteresis 4.2 N m.
    """
    m = two(35.0)
    half_gap = plant_params(m).half_backlash_rad
    for start_deg, end_deg in ((0.0, 3.0), (87.0, 90.0)):
        way = way_through(m, start_deg, end_deg)
        assert np.min(way[:, 0]) > half_gap
        assert np.max(way[:, 1]) < -half_gap


def test_a_gap_opens_where_the_preload_is_too_small() -> None:
    m = two(15.0)
    half_gap = plant_params(m).half_backlash_rad
    way = way_through(m, 87.0, 90.0)
    assert np.min(np.abs(way)) < half_gap


def test_with_the_second_drive_lost_the_first_carries() -> None:
    """At 90 deg 15.99 kN m / 1144 = 13.98 N m, less or more what two frictions of 6.5 N m and the rollers hold."""
    m = two(plant__second_pinion__lost="second")
    sim = gantry_sim(m)
    log = controlled(m, trapezoid(88.0, 90.0), 7.0, sim)
    assert sim.state["torque_motor_2"] == 0.0
    holds = 2.0 * (6.5 + 0.1 * 13.98) + 6.8e3 / 1144.0
    assert sim.state["torque_motor"] == pytest.approx(15990.3 / 1144.0, abs=holds)
    assert log["torque_act_nm"][-1] == pytest.approx(sim.state["torque_motor"], abs=0.5)
    assert log["pos_load_rad"][-1] == pytest.approx(rad(90.0), abs=rad(0.01))


def test_a_loop_on_the_encoder_of_a_lost_motor_does_not_hold_its_axis() -> None:
    """Between its encoder and the motor that has torque lie two gears, and the load swings on one of them at 2 Hz,
    far below what a gain of 78 N m s/rad makes of a loop: it swings up to the torque limit.
    """
    m = two(plant__second_pinion__lost="first")
    log = controlled(m, trapezoid(88.0, 90.0), 7.0)
    assert np.max(np.abs(log["torque_act_nm"])) > 384.0


def test_the_brake_on_the_first_motor_holds_the_load_with_the_drives_off() -> None:
    m = two()
    sim = gantry_sim(m)
    sim.static_start(rad(70.0), False)
    log = commanded(sim, OFF, 0.0, 1.0, False)
    assert np.ptp(log["pos_load_rad"]) < rad(1e-5)
    assert sim.state["torque_motor"] == sim.state["torque_motor_2"] == 0.0


@pytest.mark.parametrize("changes", [{}, {"plant.switches.cogging": True}, {"plant.switches.cable": True}])
@pytest.mark.parametrize("lost", ["none", "first", "second"])
def test_it_starts_in_balance(changes: dict[str, object], lost: str) -> None:
    # A static start leaves the ripple out; on the motor whose encoder no loop sees its 1.9 N m bend the friction.
    off = {"plant.switches.torque_ripple": False, "plant.second_pinion.lost": lost}
    m = machine(ON | off | changes)
    held = controlled(m, hold(rad(70.0)), 0.5, gantry_sim(m))
    assert np.max(np.abs(held["pos_load_rad"] - held["pos_load_rad"][0])) < rad(1e-5)


def test_a_quick_stop_ends_at_rest_with_both_motors_on_the_ring() -> None:
    m = two()
    sim = gantry_sim(m)
    sim.static_start(0.0, True)
    commanded(sim, SPEED, 30.0, 1.0, True)
    commanded(sim, QUICK_STOP, 0.0, 4.0, True)
    x = sim.state
    # 0.005 deg/s at the load: it still swings after 4 s.
    assert abs(x["vel_motor"]) < 0.1
    assert abs(x["pos_motor"] - x["pos_motor_2"]) / m.axis.ratio < rad(0.02)


def test_the_larger_share_is_that_of_the_motor_which_has_more() -> None:
    assert larger_share_nm(two(25.0), -100.0) == 75.0
    assert larger_share_nm(two(25.0), 750.0) == 385.0
    assert larger_share_nm(two(25.0, plant__second_pinion__lost="first"), -100.0) == 100.0
    assert larger_share_nm(machine(), -100.0) == 100.0


def test_what_knows_one_motor_refuses_two() -> None:
    for refuses in (lambda m: mechanics(m, PlantKind.FULL), drive_hardware):
        with pytest.raises(ConfigError, match=r"second_pinion = true, must be false for .*set it to false"):
            refuses(two())


def test_a_state_without_the_second_motor_is_refused() -> None:
    """A motor that begins at 0 would be wound up by the whole way of the first."""
    kept = sim_drive(machine(), 30.0).plant_state()
    with pytest.raises(ValueError, match="lacks 'pos_motor_2'"):
        sim_drive(two(), state=kept)
    again = sim_drive(two(), state=sim_drive(two(), 30.0).plant_state())
    assert again.plant_state()["pos_motor_2"] > 500.0


def test_a_modulo_axis_turns_both_motors_back() -> None:
    m = modulo_machine(ON)
    state = sim_drive(m, 30.0).plant_state()
    on = dict(state)
    for name, way in (
        ("pos_load", 2 * np.pi),
        ("pos_motor", 2 * np.pi * 1144),
        ("drive_pos_last", 2 * np.pi * 1144),
    ):
        on[name] += way
    on["pos_motor_2"] += 2 * np.pi * 1144
    back = turned_back(m, on)
    for name in ("pos_load", "pos_motor", "pos_motor_2"):
        assert back[name] == pytest.approx(state[name], abs=1e-9), name
