"""What the paper prints, and what its equation (2) leaves out. All reference figures:
analysis/test_expected.py.
"""

import pytest

from gantryctl.engineering.sizing import equations as eq


def test_printed_figures() -> None:
    ratio = eq.total_ratio(88.0, 13.0)
    assert ratio == 1144.0
    assert eq.motor_speed_r_min(1.0, ratio) == 1144.0
    assert eq.mean_acceleration_rad_s2(1.0, 1.0) == pytest.approx(0.105, abs=5e-4)
    assert eq.motor_torque_nm(2.18e6, 0.105, ratio) == pytest.approx(200.0, abs=0.5)
    assert eq.power_kw(200.0, 1144.0) == pytest.approx(23.96, abs=5e-3)
    assert eq.encoder_step_deg(8192, ratio) == pytest.approx(3.8e-5, abs=5e-7)
    assert eq.encoder_range_turns(4096, ratio) == pytest.approx(3.6, abs=0.05)


def test_the_complete_torque_adds_what_is_left_out() -> None:
    bare = eq.complete_motor_torque_nm(2.18e6, 0.1, 1144.0, 0.0)
    assert bare == pytest.approx(eq.motor_torque_nm(2.18e6, 0.1, 1144.0))
    rotor = eq.complete_motor_torque_nm(2.18e6, 0.1, 1144.0, 0.232)
    assert rotor - bare == pytest.approx(0.232 * 0.1 * 1144.0)
    full = eq.complete_motor_torque_nm(2.18e6, 0.1, 1144.0, 0.232, 22e3, 5.5, gear_efficiency=0.8)
    assert full == pytest.approx(bare / 0.8 + 22e3 / 1144.0 / 0.8 + (rotor - bare) + 5.5)


def test_one_count_is_too_coarse_for_the_speed_loop() -> None:
    assert eq.torque_step_nm(8192, 125e-6, 77.6959) > 257.0
    assert eq.torque_step_nm(2048 * 2048, 125e-6, 77.6959) < 1.0
