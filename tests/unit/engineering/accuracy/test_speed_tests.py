"""Speed tests of several machines side by side: the runs of each are those that it has alone."""

from __future__ import annotations

import numpy as np

from gantryctl.engineering.accuracy.speed_test import run_speed, speed_tests
from gantryctl.errors import UsageError
from gantryctl.machine import default_machine, with_values
from support.improved import improved_machine


def test_machines_side_by_side_have_the_runs_of_each_alone() -> None:
    """One with compensations, one that moves faster than the others may, one whose ramps are shorter."""
    quick = with_values(default_machine(), {"virtual_axis.acc_deg_s2": 1.0, "virtual_axis.dec_deg_s2": 1.0})
    slow = with_values(default_machine(), {"speed.setting_max_deg_s": 4.0})
    machines = [default_machine(), slow, improved_machine(), quick]
    found = speed_tests(machines, (3.0, 6.0))
    assert isinstance(found[1], UsageError)
    for machine, runs in zip(machines, found, strict=True):
        if isinstance(runs, Exception):
            continue
        assert [run.speed_deg_s for run in runs] == [3.0, 3.0, 6.0, 6.0]
        for run in runs:
            alone = run_speed(machine, *run.travel_deg, run.speed_deg_s)
            assert run.load_error_deg_s == alone.load_error_deg_s
            assert run.motor_error_deg_s == alone.motor_error_deg_s
            assert run.curves.load_deg_s is not None
            assert alone.curves.load_deg_s is not None
            assert np.array_equal(run.curves.load_deg_s, alone.curves.load_deg_s)
