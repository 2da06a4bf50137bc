"""From the fits of an identification to its numbers, each written down by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.identification.fit import _numbers, _Windup, _without_windup
from gantryctl.engineering.identification.torque_balance import BalanceFit, TorqueBalance
from gantryctl.machine import Identified


def test_a_gear_map_is_the_lead_without_the_windup_of_a_moment_wherever_its_load_hangs() -> None:
    """10 sin x + 20 cos x kN m over 5e8 N m/rad lead the load by 20 sin x + 40 cos x urad: no gear is left of that."""
    identified = Identified(moment_sine_nm=1e4, moment_cosine_nm=2e4, stiffness_nm_per_rad=5e8)
    windup, gear = np.array([0.0, 2e-5, 4e-5]), np.array([0.0, 3e-5, -1e-5])
    # Map and wind-up together are 0 at the angle 0, where the cosine is 40 urad, and 30 with the gear's.
    assert _without_windup(windup, identified, [], 0.0) == pytest.approx(
        np.array([-4e-5, 0.0, 0.0]), abs=1e-18
    )
    found = _without_windup(windup + gear, identified, [], 0.0)
    assert found == pytest.approx(np.array([-3e-5, 3e-5, -1e-5]), abs=1e-18)


def test_a_mode_is_half_as_unsure_as_the_windup_that_it_comes_of() -> None:
    """f = 1 / (2 pi sqrt(c)): 40 % of c are 20 % of f, and with the quarter that the model leaves out 32 %.

    The stiffness is J / c: 40 % and 10 % of the inertia, and 40 % that the model leaves out, are 57 %.
    """
    balance = TorqueBalance(1e4, 0.0, 0.0, 6000.0, 6000.0, 0.1, 2e4, 2e6, 3e5, 1.0)
    names = (*TorqueBalance._fields[:-2], "inertia_kg_m2", "friction_nm")
    half = dict.fromkeys(names, 1.0) | {"inertia_load_kg_m2": 2e5, "friction_load_ratio": 0.01}
    lead: Any = SimpleNamespace(backlash_rad=None)
    found, widths, unknown = _numbers(BalanceFit(balance, half), None, _Windup(0.006, 0.0024), lead, 2000.0)
    swing_hz = 1.0 / (2.0 * math.pi * math.sqrt(0.006))
    assert found.swing_hz == pytest.approx(swing_hz)
    assert widths["swing_hz"] == pytest.approx(math.hypot(0.2, 0.25) * swing_hz)
    assert found.stiffness_nm_per_rad == pytest.approx(2e6 / 0.006)
    assert widths["stiffness_nm_per_rad"] == pytest.approx(math.hypot(0.4, 0.1, 0.4) * 2e6 / 0.006)
    assert set(unknown) == {"motor_inertia_kg_m2", "dead_time_s", "backlash_rad"}
