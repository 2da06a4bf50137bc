"""The CANopen master with the virtual drive behind it is a drive like any other."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from conformance.drive_port import DISABLE, ENABLE, QUICK_STOP, DriveBench, DriveConformance
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.side_channel.requests import Requests
from gantryctl.image import DriveFeedback, DriveRequest, DriveState, OutputImage
from gantryctl.machine import default_machine, with_values
from gantryctl.wiring.canopen import canopen_drive

SYNC_S = 0.004


class CanBench(DriveBench):
    """The reference gantry behind a CiA 402 drive that SYNC steps through virtual time.

    A command acts at the next SYNC and shows at the one after, so a scan of this bench is two SYNC periods.
    """

    period_s = 2 * SYNC_S

    def __init__(self, owner: str) -> None:
        changes = {"drive.kind": "canopen", "control.scan_period_ms": 1e3 * SYNC_S, "brake.owner": owner}
        machine = with_values(default_machine(), changes)
        drive = canopen_drive(machine)
        assert isinstance(drive.truth_source, DriveNode)
        self.drive = drive
        self.ask = Requests(drive.truth_source).answer
        self.ratio = machine.axis.ratio
        self.quick_dec_deg_s2 = machine.virtual_axis.quick_dec_deg_s2
        self.brake_time_s = 0.25

    def scan(self, request: DriveRequest, speed_deg_s: float = 0.0, **output: object) -> DriveFeedback:
        vel = speed_deg_s * self.ratio * 3.141592653589793 / 180.0
        for _ in range(2):
            self.drive.write(OutputImage(request, vel, **output))
            feedback = self.drive.read()
        return feedback

    def emergency_stop(self, ok: bool) -> None:
        assert self.ask({"cmd": "inject", "fault": "estop_ok", "value": ok})["ok"]

    def mains(self, ready: bool) -> None:
        assert self.ask({"cmd": "inject", "fault": "mains_ready", "value": ready})["ok"]

    def trip(self, error_code: int) -> None:
        assert self.ask({"cmd": "event", "event": "fault", "code": error_code})["ok"]


class TestBrakeByObject60FE(DriveConformance):
    """The controller works the brake over the bus: everything holds as in process."""

    @pytest.fixture
    def bench(self) -> Iterator[DriveBench]:
        bench = self.make_bench()
        yield bench
        bench.drive.close()

    def make_bench(self) -> DriveBench:
        return CanBench("object_60FE")


class TestBrakeOfTheDrive(TestBrakeByObject60FE):
    """The drive works the brake in its own state machine: open when enabled, closed when not."""

    def make_bench(self) -> DriveBench:
        return CanBench("drive")

    def test_the_brake_opens_only_when_enabled(self, bench: DriveBench) -> None:
        assert not bench.scans(2 * bench.brake_time_s, DISABLE, brake_open=True).brake_open
        assert bench.enable(brake_open=False).brake_open

    def test_the_brake_closes_on_command_while_enabled(self, bench: DriveBench) -> None:
        """Taking the release back is "disable operation": the brake closes before the torque goes."""
        bench.enable()
        before = bench.angle_deg()
        feedback = bench.scans(2 * bench.brake_time_s, ENABLE, brake_open=False)
        assert not feedback.brake_open
        assert feedback.state is not DriveState.OPERATION_ENABLED
        # In order there is no sag at all; torque off first would let the load fall for the brake's 0.15 s.
        assert bench.angle_deg() == pytest.approx(before, abs=0.001)

    def test_quick_stop_ramps_down_and_holds_zero_speed(self, bench: DriveBench) -> None:
        """The drive ends it by itself: ramp, brake, torque off, and nothing sags while the word stays."""
        bench.enable()
        self.ramp_to(bench, 1.5)
        before = bench.angle_deg()
        ramp_s = 1.5 / bench.quick_dec_deg_s2
        bench.scan(QUICK_STOP, brake_open=True)
        feedback = bench.scans(ramp_s + 0.05, QUICK_STOP, brake_open=True)
        assert feedback.state is DriveState.QUICK_STOP_ACTIVE
        feedback = bench.scans(2 * bench.brake_time_s, QUICK_STOP, brake_open=True)
        assert bench.angle_deg() - before == pytest.approx(1.5 * ramp_s / 2.0, rel=0.15)
        assert feedback.state is DriveState.SWITCH_ON_DISABLED
        assert not feedback.brake_open
        # The load swings on for some seconds, the motor side stands.
        assert bench.speed_deg_s() == pytest.approx(0.0, abs=0.05)

    def test_only_disable_ends_a_quick_stop(self, bench: DriveBench) -> None:
        """Before the drive has closed its brake, 0.16 s after rest."""
        bench.enable()
        bench.scan(QUICK_STOP, brake_open=True)
        assert bench.scans(0.1, ENABLE, 1.0, brake_open=True).state is DriveState.QUICK_STOP_ACTIVE
        assert bench.scan(DISABLE).state is DriveState.SWITCH_ON_DISABLED

    def test_a_speed_against_the_closed_brake_does_not_turn_the_gantry(self, bench: DriveBench) -> None:
        """An enabled drive has its brake open; on the way there the speed command stays 0."""
        before = bench.angle_deg()
        for _ in range(10):
            bench.scan(ENABLE, 6.0, brake_open=True)
        assert not bench.drive.read().brake_open
        assert bench.angle_deg() == pytest.approx(before, abs=self.sag_max_deg)

    def test_a_torque_preload_shows_in_the_torque(self, bench: DriveBench) -> None:
        """While it opens the brake the drive builds the preload up."""
        for _ in range(8):
            feedback = bench.scan(ENABLE, torque_ff_nm=30.0)
        assert feedback.state is DriveState.SWITCHED_ON
        assert feedback.torque_act_nm > 0.8 * 30.0
