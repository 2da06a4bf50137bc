"""Key figures of a log that is written by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.batch.loop import Log
from gantryctl.engineering.comparison import key_figures
from gantryctl.machine import default_machine


def test_the_figures_of_a_move() -> None:
    """1 s rest, 1 s motion, 6 s rest at 10 ms. The load swings by 0.01 deg 0.1 s and 0.5 s after the end."""
    machine = default_machine()
    columns = key_figures._COLUMNS
    log = {name: np.zeros(802) for name in columns}
    # The move ends with row 201: row 100 is its first.
    log["pos_load_rad"][[201 + 10, 201 + 50]] = math.radians(0.01)
    log["vel_load_rad_s"][150] = math.radians(-2.0)
    log["vel_motor_rad_s"][160] = math.radians(-3.0) * machine.axis.ratio
    log["torque_mesh_nm"][[140, 170]] = 1e6, -4e6
    found = key_figures._evaluate(machine, Log(np.stack(list(log.values())), 0.01, columns), 1.0)
    assert found.settling_s == pytest.approx(0.51)
    assert found.load_error_deg_s == pytest.approx(2.0)
    assert found.motor_error_deg_s == pytest.approx(3.0)
    # 4000 kN m at the gantry; the output of the reducer turns faster by the ratio of ring and pinion.
    assert found.reducer_knm == pytest.approx(4e3 / machine.axis.ring_ratio)
