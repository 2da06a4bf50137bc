"""The servo drive: current loop, speed PI with anti-windup, torque limit with I2t, delay, quick stop."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl import _core
from gantryctl.wiring.simulator import drive_params
from physics.plants import (
    CYCLE_S,
    LOCKED,
    OFF,
    QUICK_STOP,
    SPEED,
    bare,
    follow,
    machine,
    put,
    released,
    simulator,
)

KVP, TVI, RATED, MAX = 77.6959, 0.01, 257.0, 385.0


def held_motor(**drive: float) -> _core.GantrySim:
    """A shaft that nothing moves, ideal current and encoder, one cycle a scan: the speed loop alone."""
    settings = {
        "speed_count_rad": 0.0,
        "position_count_rad": 0.0,
        "latency_s": 0.0,
        "delay_cycles": 0,
    } | drive
    sim = simulator(bare("rigid", inertia_motor_kg_m2=LOCKED), "one_evaluation", scan_s=CYCLE_S, **settings)
    sim.static_start(0.0, True)
    return sim


def torques(
    sim: _core.GantrySim, commands: list[float], mode: int = SPEED, feed_forward: float = 0.0
) -> np.ndarray:
    """Torque that acted in each cycle under a speed command per cycle."""
    acted = []
    for command in commands:
        sim.scan(mode, command, feed_forward, True)
        acted.append(sim.feedback(1.0)[2])
    return np.array(acted)


def test_the_drive_of_the_reference_machine() -> None:
    d = drive_params(machine())
    assert (d.cycle_s, d.kvp_nm_s_per_rad, d.tvi_s, d.delay_cycles) == (CYCLE_S, KVP, TVI, 1)
    assert (d.torque_rated_nm, d.torque_max_nm) == (RATED, MAX)
    assert d.speed_count_rad == pytest.approx(2 * math.pi / 2**22, rel=1e-15)
    assert drive_params(machine({"drive.speed_loop.feedback": "ideal"})).speed_count_rad == 0.0
    assert drive_params(machine({"drive.speed_loop.feedback": "counts"})).speed_count_rad == pytest.approx(
        2 * math.pi / 8192, rel=1e-15
    )


# --- current loop ---------------------------------------------------------------------------------------------


def test_the_torque_follows_with_the_time_constant_of_the_current_loop() -> None:
    """Te = u (1 - exp(-wc t)), wc = 2 pi 600 Hz: exact in the one-evaluation scheme, to 1e-4 of u in RK4 x 2."""
    p = bare("rigid", "current_loop")
    expected = 100.0 * (1 - np.exp(-2 * math.pi * 600.0 * CYCLE_S * np.arange(41)))
    for scheme, tolerance in (("one_evaluation", 1e-11), ("rk4", 1e-2)):
        sim = simulator(p, scheme)
        sim.static_start(0.0, True)
        assert np.allclose(follow(sim, 100.0, 0.005)["torque_motor"], expected, atol=tolerance)


def test_an_ideal_current_loop_is_no_lag_at_all() -> None:
    sim = released(bare("rigid"))
    assert sim.state["torque_motor"] == 0.0
    sim.advance(37.0, CYCLE_S)
    assert sim.state["torque_motor"] == 37.0


def test_a_very_fast_current_loop_is_the_ideal_one() -> None:
    """In the one-evaluation scheme the torque of a cycle is that of its start: one cycle behind, then the same."""
    fast, ideal = bare("rigid", current_bandwidth_rad_s=1e9), bare("rigid")
    a, b = (simulator(p, "one_evaluation") for p in (fast, ideal))
    for sim in (a, b):
        sim.static_start(0.0, True)
    u = [20.0 * math.sin(3.0 * k) for k in range(100)]
    for k in range(100):
        a.advance(u[k], CYCLE_S)
    for k in range(100):
        b.advance(0.0 if k == 0 else u[k - 1], CYCLE_S)
    assert a.state["vel_motor"] == pytest.approx(b.state["vel_motor"], rel=1e-12)


# --- speed PI -------------------------------------------------------------------------------------------------


@given(error=st.floats(-1.0, 1.0), feed_forward=st.floats(-50.0, 50.0))
def test_in_the_linear_range_it_is_the_sampled_pi(error: float, feed_forward: float) -> None:
    """u_k = Kvp (e + k e Ts/Tvi) + ff: the integral grows after the torque is computed."""
    u = torques(held_motor(), [error] * 60, feed_forward=feed_forward)
    expected = KVP * error * (1 + np.arange(60) * CYCLE_S / TVI) + feed_forward
    assert np.allclose(u, expected, rtol=1e-12, atol=1e-12)


def test_the_step_response_crosses_twice_its_start_after_the_integral_time() -> None:
    u = torques(held_motor(), [0.5] * 81)
    assert u[0] == pytest.approx(0.5 * KVP)
    assert u[80] == pytest.approx(2 * u[0], rel=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_integral_stops_where_the_torque_limit_is_reached(side: float) -> None:
    """Closed form: with constant error e the PI reaches 385 N m in cycle n = (385/(Kvp e) - 1) Tvi/Ts; from then
    on I stays at n e Ts/Tvi; when the error turns, the torque leaves the limit in that very cycle.
    """
    error = side * 3.0
    sim = held_motor()
    n = math.floor((MAX / (KVP * abs(error)) - 1) * TVI / CYCLE_S) + 1
    u = torques(sim, [error] * 2000)
    assert np.all(np.abs(u[:n]) < MAX)
    assert np.all(u[n:] == side * MAX)
    assert sim.state["drive_integral"] == pytest.approx(n * error * CYCLE_S / TVI, rel=1e-12)
    back = torques(sim, [-0.01 * side])
    assert back[0] == pytest.approx(KVP * (-0.01 * side + n * error * CYCLE_S / TVI), rel=1e-12)
    assert abs(back[0]) < MAX


def test_saturated_it_still_integrates_towards_the_linear_range() -> None:
    """Feed-forward beyond the limit and an error the other way: I may move, or it would never come back."""
    sim = held_motor()
    torques(sim, [-0.5] * 100, feed_forward=800.0)
    assert sim.state["drive_integral"] == pytest.approx(-0.5 * 100 * CYCLE_S / TVI, rel=1e-12)


def test_without_windup_the_overshoot_after_saturation_is_that_of_the_linear_loop() -> None:
    """A step that saturates for 80 ms overshoots no more than twice a small step does: 1 + o of the rest."""

    def overshoot(step: float) -> float:
        sim = simulator(bare("rigid"), "one_evaluation", scan_s=CYCLE_S, speed_count_rad=0.0)
        sim.static_start(0.0, True)
        speed = []
        for _ in range(8000):
            sim.scan(SPEED, step, 0.0, True)
            speed.append(sim.truth()[3])
        return max(speed) - step

    small, large = overshoot(0.1), overshoot(20.0)
    # what is left when the limit is left is 385/Kvp = 5 rad/s of error, of which the linear loop makes its share
    assert large < 1.1 * small / 0.1 * MAX / KVP
    assert large > 0.0


@pytest.mark.parametrize("delay", [0, 1])
def test_the_torque_acts_after_the_delay(delay: int) -> None:
    """0: in the cycle that computed it; 1: in the next, the one before acting meanwhile."""
    error = [0.1, 0.2, -0.3, 0.4]
    exact = torques(held_motor(), error)
    late = torques(held_motor(delay_cycles=delay), error)
    assert np.array_equal(late[delay:], exact[: 4 - delay])
    assert np.all(late[:delay] == 0.0)


def test_the_speed_command_is_held_to_the_ceiling_of_the_drive() -> None:
    sim = held_motor(vel_max_rad_s=2.0)
    assert torques(sim, [50.0])[0] == pytest.approx(2.0 * KVP)
    assert sim.feedback(1.0)[6] == 2.0
    assert torques(held_motor(vel_max_rad_s=2.0), [-50.0])[0] == pytest.approx(-2.0 * KVP)


def test_a_command_that_is_no_number_is_not_hidden() -> None:
    sim = held_motor()
    assert math.isnan(torques(sim, [math.nan])[0])


def test_off_takes_the_torque_away_at_once_and_forgets_the_integral() -> None:
    sim = held_motor(delay_cycles=1)
    torques(sim, [1.0] * 50)
    assert torques(sim, [1.0], mode=OFF)[0] == 0.0
    assert sim.state["drive_integral"] == 0.0
    # and switched on again it begins from nothing
    assert torques(sim, [0.5, 0.5])[1] == pytest.approx(0.5 * KVP)


def test_the_quick_stop_ramp_falls_by_its_deceleration_and_ends_at_zero() -> None:
    sim = held_motor(quick_dec_rad_s2=110.0)
    torques(sim, [1.0])
    shown = []
    for _ in range(100):
        sim.scan(QUICK_STOP, 9.9, 0.0, True)
        shown.append(sim.feedback(1.0)[6])
    assert shown == pytest.approx(list(np.maximum(0.0, 1.0 - 110.0 * CYCLE_S * np.arange(1, 101))), abs=1e-12)
    assert shown[-1] == 0.0


def test_quick_stop_from_off_starts_at_the_measured_speed() -> None:
    sim = simulator(
        bare("rigid"), "one_evaluation", scan_s=CYCLE_S, quick_dec_rad_s2=110.0, speed_count_rad=0.0
    )
    sim.static_start(0.0, True)
    put(sim, vel_motor=-50.0)
    for _ in range(3):
        sim.scan(OFF, 0.0, 0.0, True)
    sim.scan(QUICK_STOP, 0.0, 0.0, True)
    assert sim.feedback(1.0)[6] == pytest.approx(-50.0 + 110.0 * CYCLE_S, rel=1e-9)


# --- torque limit and I2t -------------------------------------------------------------------------------------


def limited_run(error: float, cycles: int, **drive: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Torque, limit flag and used budget per cycle with a constant error."""
    sim = held_motor(**drive)
    rows = []
    for _ in range(cycles):
        sim.scan(SPEED, error, 0.0, True)
        feedback = sim.feedback(1.0)
        rows.append((feedback[2], feedback[4], feedback[5]))
    torque, flag, budget = np.array(rows, dtype=float).T
    return torque, flag, budget


def test_the_highest_torque_lasts_for_the_overload_time() -> None:
    """At 385 N m from cold for 0.5 s (as set here), then 257 N m; the flag shows both."""
    torque, flag, budget = limited_run(50.0, 6000, overload_time_s=0.5)
    # the account sees a torque one cycle after it was given
    assert np.all(torque[:4001] == MAX)
    assert np.all(torque[4002:] == RATED)
    assert np.all(flag == 1.0)
    assert budget[2000] == pytest.approx(0.5, abs=1e-3)
    assert np.all(budget[4001:] == 1.0)


@given(torque=st.floats(265.0, 380.0))
def test_a_smaller_overload_lasts_longer_by_the_square_of_the_torque(torque: float) -> None:
    """t = T_o (r_max^2 - 1)/((T/T_rated)^2 - 1); the torque is held by a feed-forward without error."""
    time = 0.01 * ((MAX / RATED) ** 2 - 1) / ((torque / RATED) ** 2 - 1)
    cycles = math.ceil(time / CYCLE_S) + 3
    u = torques(held_motor(overload_time_s=0.01), [0.0] * cycles, feed_forward=torque)
    fallen = np.flatnonzero(u < torque - 1.0)[0]
    assert abs(fallen - time / CYCLE_S) <= 2.0


def test_rated_torque_may_be_drawn_for_ever() -> None:
    u = torques(held_motor(overload_time_s=0.01), [0.0] * 4000, feed_forward=RATED)
    # the "locked" shaft turns with 1e-16 rad/s
    assert np.allclose(u, RATED, rtol=1e-12)


def test_the_account_recovers_below_rated_torque() -> None:
    """At standstill it falls by 1 s per s: the budget of 0.1 s x (r^2 - 1) comes back in 0.124 s."""
    sim = held_motor(overload_time_s=0.1)
    torques(sim, [50.0] * 2000)
    assert sim.feedback(1.0)[5] == 1.0
    needed = 0.1 * ((MAX / RATED) ** 2 - 1)
    for _ in range(round(needed / CYCLE_S) + 3):
        sim.scan(OFF, 0.0, 0.0, True)
    assert sim.feedback(1.0)[5] == 0.0
    torques(sim, [50.0])
    assert sim.feedback(1.0)[2] == MAX


def test_without_reserve_the_limit_is_the_highest_torque() -> None:
    for highest in (RATED, 100.0):
        torque, _, budget = limited_run(50.0, 500, torque_max_nm=highest)
        assert np.all(torque == highest)
        assert not np.any(budget)


def test_the_flag_is_down_in_the_linear_range() -> None:
    torque, flag, _ = limited_run(1.0, 50)
    assert np.all(np.abs(torque) < MAX)
    assert not np.any(flag)
