"""The ideal drive is a drive like any other."""

from __future__ import annotations

from typing import ClassVar

import pytest

from conformance.drive_port import DriveBench, DriveConformance
from gantryctl.machine import default_machine, with_values
from gantryctl.wiring.simulator import ideal_drive


class IdealBench(DriveBench):
    """Actual = set-point."""

    def __init__(self) -> None:
        machine = with_values(default_machine(), {"drive.kind": "ideal"})
        self.drive = self.ideal = ideal_drive(machine)
        self.period_s = machine.control.scan_period_ms * 1e-3
        self.ratio = machine.axis.ratio
        self.quick_dec_deg_s2 = machine.virtual_axis.quick_dec_deg_s2
        self.brake_time_s = 0.01

    def emergency_stop(self, ok: bool) -> None:
        self.ideal.inputs = self.ideal.inputs._replace(estop_ok=ok)

    def mains(self, ready: bool) -> None:
        self.ideal.inputs = self.ideal.inputs._replace(mains_ready=ready)

    def trip(self, error_code: int) -> None:
        self.ideal.error_code = error_code


class TestIdealDrive(DriveConformance):
    """Without any plant."""

    sag_max_deg: ClassVar[float] = 0.0

    @pytest.fixture
    def bench(self) -> DriveBench:
        return IdealBench()
