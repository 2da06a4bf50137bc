"""Measurements take seconds: one set for all tests that look at it."""

import pytest

from gantryctl.engineering.analysis.measured.response import conditions, measure_simulated
from gantryctl.machine import default_machine


@pytest.fixture(scope="session")
def measurements():
    machine = default_machine()
    return [measure_simulated(machine, how) for how in conditions(machine)]
