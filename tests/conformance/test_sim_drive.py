"""The simulated drive is a drive like any other."""

from __future__ import annotations

import pytest

from conformance.drive_port import DriveBench, DriveConformance
from gantryctl.machine import default_machine
from gantryctl.wiring.simulator import sim_drive


class SimBench(DriveBench):
    """The reference gantry in process."""

    def __init__(self) -> None:
        machine = default_machine()
        self.drive = self.sim = sim_drive(machine)
        self.period_s = machine.control.scan_period_ms * 1e-3
        self.ratio = machine.axis.ratio
        self.quick_dec_deg_s2 = machine.virtual_axis.quick_dec_deg_s2
        self.brake_time_s = 0.25

    def emergency_stop(self, ok: bool) -> None:
        self.sim.faults.estop_ok = ok

    def mains(self, ready: bool) -> None:
        self.sim.faults.mains_ready = ready

    def trip(self, error_code: int) -> None:
        self.sim.trip(error_code)


class TestSimDrive(DriveConformance):
    """With all its physics."""

    @pytest.fixture
    def bench(self) -> DriveBench:
        return SimBench()
