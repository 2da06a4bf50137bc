"""The figures of the whole plant under the paper's controller and profile, within 15 %.

"90" is 0 to +90 deg, "180" is -90 to +90 deg; 1 s rest, move, 6 s rest; plant equations S10.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from gantryctl.wiring.simulator import plant_params
from physics.plants import DEG, Arrays, controlled, machine, trapezoid

RADIUS_UM = 2.366e6
TOLERANCE = 0.15


@cache
def move(start: float, end: float) -> Arrays:
    duration = {90.0: 30.2523, 180.0: 45.2533}[abs(end - start)]
    return controlled(machine(), trapezoid(start, end, rest_s=1.0), 1.0 + duration + 6.0)


@pytest.mark.parametrize(
    ("start", "motor", "load"),
    [(0.0, 0.0064, 0.056), (-90.0, 0.0047, 0.038)],
)
def test_speed_errors(start: float, motor: float, load: float) -> None:
    """Measured 0.006406 and 0.05641 deg/s (90), 0.004659 and 0.03765 (180): true speeds, whole log, no filter."""
    log = move(start, 90.0)
    reference = log["vel_ref_rad_s"]
    assert np.max(np.abs(log["vel_motor_rad_s"] / 1144.0 - reference)) / DEG == pytest.approx(
        motor, rel=TOLERANCE
    )
    assert np.max(np.abs(log["vel_load_rad_s"] - reference)) / DEG == pytest.approx(load, rel=TOLERANCE)


def test_the_start_matters() -> None:
    """From -90 to 0 the load's speed error is 0.065, not 0.056 deg/s: another gear error, another torque."""
    log = move(-90.0, 0.0)
    assert np.max(np.abs(log["vel_load_rad_s"] - log["vel_ref_rad_s"])) / DEG == pytest.approx(
        0.065, rel=TOLERANCE
    )


def test_the_base_shakes() -> None:
    """165 um peak to peak over the 90 deg move without its static part, 65 um of it left 0.2 s after the end.

    The paper's 170 um is 2 % away.
    """
    log = move(0.0, 90.0)
    p = plant_params(machine())
    static = p.eccentric_moment_nm * np.sin(log["pos_load_rad"]) / p.base_stiffness_nm_per_rad
    shake = (log["pos_base_rad"] - static) * RADIUS_UM
    assert np.ptp(shake) == pytest.approx(165.0, rel=TOLERANCE)
    end = 1.0 + 30.2523
    rest = (log["t"] > end + 0.2) & (log["t"] < end + 2.2)
    assert np.ptp(shake[rest]) == pytest.approx(65.0, rel=TOLERANCE)


def test_the_load_settles_in_0_85_s() -> None:
    """Last time further than 0.001 deg from the mean of the last second, after the end of the profile."""
    log = move(0.0, 90.0)
    final = np.mean(log["pos_load_rad"][-1000:])
    out = log["t"][np.abs(log["pos_load_rad"] - final) > 0.001 * DEG]
    assert out[-1] - (1.0 + 30.2523) == pytest.approx(0.85, rel=TOLERANCE)


def test_torques_of_the_moves() -> None:
    """35 N m (180) and 54 N m (90) at the peak, as the reference has them."""
    for start, peak in ((-90.0, 35.0), (0.0, 54.0)):
        assert np.max(np.abs(move(start, 90.0)["torque_act_nm"])) == pytest.approx(peak, rel=TOLERANCE)


def test_the_motor_error_is_much_smaller_than_the_load_error() -> None:
    """What the encoder cannot see: with a trapezoid the load's error is at least five times the motor's."""
    for start in (0.0, -90.0):
        log = move(start, 90.0)
        motor = np.max(np.abs(log["vel_motor_rad_s"] / 1144.0 - log["vel_ref_rad_s"]))
        load = np.max(np.abs(log["vel_load_rad_s"] - log["vel_ref_rad_s"]))
        assert load > 5 * motor


def test_the_gravity_torque_and_friction_stand_in_the_budget() -> None:
    """At 6 deg/s across 0 deg: rollers 7.1 N m of 8.1 kN m, motor and reducer 5.5..9.9 N m, no gravity."""
    log = move(-90.0, 90.0)
    k = int(np.argmin(np.abs(log["pos_load_rad"])))
    rollers = (6000.0 + 2e4 * 6.0 * DEG) / 1144.0
    motor = 5.5 + 0.03 * 119.8 + 0.1 * rollers
    around = slice(k - 2000, k + 2000)
    assert np.mean(log["torque_act_nm"][around]) == pytest.approx(rollers + motor, rel=0.05)
