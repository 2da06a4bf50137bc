"""What every drive behind the `Drive` port must do, whatever it is made of.

A new kind of drive derives a test class from `DriveConformance` and gives it a bench; see test_sim_drive.py.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

import pytest

from gantryctl.image import DriveFeedback, DriveIdentity, DriveRequest, DriveState, OutputImage
from gantryctl.ports import Drive

ENABLE, DISABLE = DriveRequest.ENABLE, DriveRequest.DISABLE
QUICK_STOP, FAULT_RESET = DriveRequest.QUICK_STOP, DriveRequest.FAULT_RESET
ENABLED = DriveState.OPERATION_ENABLED
WAY_UP = (
    DriveState.SWITCH_ON_DISABLED,
    DriveState.READY_TO_SWITCH_ON,
    DriveState.SWITCHED_ON,
    DriveState.OPERATION_ENABLED,
)
NO_TORQUE = frozenset(DriveState) - {
    ENABLED,
    DriveState.QUICK_STOP_ACTIVE,
    DriveState.FAULT_REACTION_ACTIVE,
}
ERROR_CODE = 0x7305  # CiA 402: incremental sensor 1


class DriveBench(ABC):
    """A drive with a gantry standing at 0 deg, and hands on its wires."""

    drive: Drive
    period_s: float
    ratio: float
    quick_dec_deg_s2: float
    brake_time_s: float
    """Within this the brake has opened or closed."""

    @abstractmethod
    def emergency_stop(self, ok: bool) -> None:
        """Close or open the emergency-stop chain."""

    @abstractmethod
    def mains(self, ready: bool) -> None:
        """Switch the supply."""

    @abstractmethod
    def trip(self, error_code: int) -> None:
        """A fault inside the drive."""

    def scan(self, request: DriveRequest, speed_deg_s: float = 0.0, **output: object) -> DriveFeedback:
        """One scan; what the drive shows afterwards. `speed_deg_s` is at the gantry."""
        vel = math.radians(speed_deg_s) * self.ratio
        self.drive.write(OutputImage(request, vel, **output))
        return self.drive.read()

    def scans(
        self, seconds: float, request: DriveRequest, speed_deg_s: float = 0.0, **output: object
    ) -> DriveFeedback:
        """The same command for a time."""
        feedback = self.drive.read()
        for _ in range(math.ceil(seconds / self.period_s)):
            feedback = self.scan(request, speed_deg_s, **output)
        return feedback

    def enable(self, *, brake_open: bool = True) -> DriveFeedback:
        """Up to Operation enabled and, unless told otherwise, the brake open."""
        for _ in range(20):
            if self.scan(ENABLE).state is ENABLED:
                break
        return self.scans(self.brake_time_s, ENABLE, brake_open=brake_open)

    def until(self, wanted: Callable[[DriveFeedback], bool], seconds: float, request: DriveRequest) -> float:
        """Scan with the brake released until something shows; how long it took, s."""
        for k in range(math.ceil(seconds / self.period_s)):
            if wanted(self.scan(request, brake_open=True)):
                return (k + 1) * self.period_s
        raise AssertionError(f"not within {seconds} s: {self.drive.read()}")

    def speed_deg_s(self) -> float:
        """Of the gantry, as the drive says."""
        return math.degrees(self.drive.read().vel_act_rad_s) / self.ratio

    def angle_deg(self) -> float:
        """Of the gantry, as the encoder says, from wherever it was zeroed."""
        return self.drive.read().pos_act_counts / self.drive.identity().counts_per_turn * 360.0 / self.ratio


class DriveConformance:
    """The tests; a derived class gives the fixture `bench`: a new drive, standing, off."""

    sag_max_deg: ClassVar[float] = 0.02
    """How far the load may move when the brake opens or closes."""

    # --- what it says of itself ---------------------------------------------------------------------------------

    def test_it_is_a_drive(self, bench: DriveBench) -> None:
        assert isinstance(bench.drive, Drive)
        identity = bench.drive.identity()
        assert isinstance(identity, DriveIdentity)
        assert identity.counts_per_turn > 0
        assert identity.turns > 0
        assert identity.encoder_serial
        assert bench.drive.identity() == identity

    def test_it_wakes_without_torque_and_with_the_brake_closed(self, bench: DriveBench) -> None:
        feedback = bench.drive.read()
        assert feedback.state is DriveState.SWITCH_ON_DISABLED
        assert not feedback.brake_open
        assert feedback.torque_act_nm == 0.0
        assert feedback.vel_act_rad_s == pytest.approx(0.0, abs=1e-9)
        assert feedback.error_code == 0
        assert False not in feedback.inputs

    def test_the_first_reading_lies_within_the_range_of_the_encoder(self, bench: DriveBench) -> None:
        identity = bench.drive.identity()
        assert 0 <= bench.drive.read().pos_act_counts < identity.counts_per_turn * identity.turns

    def test_reading_changes_nothing(self, bench: DriveBench) -> None:
        bench.enable()
        assert bench.drive.read() == bench.drive.read()

    def test_a_reading_in_process_belongs_to_its_scan(self, bench: DriveBench) -> None:
        assert bench.enable().age_scans == 0

    # --- enable and disable -------------------------------------------------------------------------------------

    def test_enable_walks_the_states_one_a_scan(self, bench: DriveBench) -> None:
        seen = [bench.drive.read().state]
        while seen[-1] is not ENABLED:
            seen.append(bench.scan(ENABLE).state)
            assert len(seen) < 50
        steps = [state for k, state in enumerate(seen) if k == 0 or state is not seen[k - 1]]
        assert tuple(steps) == WAY_UP

    @pytest.mark.parametrize("scans", range(5))
    def test_disable_leads_back_from_every_step(self, bench: DriveBench, scans: int) -> None:
        for _ in range(scans):
            bench.scan(ENABLE)
        assert bench.scan(DISABLE).state is DriveState.SWITCH_ON_DISABLED

    def test_it_stays_enabled_and_stands(self, bench: DriveBench) -> None:
        before = bench.angle_deg()
        bench.enable()
        assert bench.scans(0.5, ENABLE, brake_open=True).state is ENABLED
        assert bench.angle_deg() == pytest.approx(before, abs=self.sag_max_deg)
        assert bench.speed_deg_s() == pytest.approx(0.0, abs=0.02)

    def test_a_speed_left_over_while_not_enabled_moves_nothing(self, bench: DriveBench) -> None:
        before = bench.drive.read().pos_act_counts
        for _ in range(len(WAY_UP) - 2):  # one step short of enabled
            bench.scan(ENABLE, 6.0, brake_open=True)
        bench.scans(0.1, DISABLE, 6.0, brake_open=True)
        assert bench.drive.read().pos_act_counts == pytest.approx(before, abs=2)

    def test_a_speed_against_the_closed_brake_does_not_turn_the_gantry(self, bench: DriveBench) -> None:
        bench.enable(brake_open=False)
        before = bench.angle_deg()
        feedback = bench.scans(0.02, ENABLE, 0.05, brake_open=False)
        assert not feedback.brake_open
        assert bench.angle_deg() == pytest.approx(before, abs=self.sag_max_deg)

    # --- brake and torque ---------------------------------------------------------------------------------------

    def test_the_brake_opens_only_when_enabled(self, bench: DriveBench) -> None:
        assert not bench.scans(2 * bench.brake_time_s, DISABLE, brake_open=True).brake_open
        for _ in range(20):
            if bench.scan(ENABLE).state is ENABLED:
                break
        assert bench.until(lambda f: f.brake_open, bench.brake_time_s, ENABLE)

    def test_the_brake_closes_on_command_while_enabled(self, bench: DriveBench) -> None:
        bench.enable()
        feedback = bench.scans(bench.brake_time_s, ENABLE, brake_open=False)
        assert not feedback.brake_open
        assert feedback.state is ENABLED

    @pytest.mark.parametrize("request_", [DISABLE, FAULT_RESET])
    def test_torque_off_closes_the_brake_whatever_is_commanded(
        self, bench: DriveBench, request_: DriveRequest
    ) -> None:
        bench.enable()
        if request_ is FAULT_RESET:
            bench.trip(ERROR_CODE)
        feedback = bench.scans(bench.brake_time_s, request_, brake_open=True)
        assert feedback.state in NO_TORQUE
        assert not feedback.brake_open

    def test_a_torque_preload_shows_in_the_torque(self, bench: DriveBench) -> None:
        bench.enable(brake_open=False)
        for wanted in (30.0, -30.0):
            feedback = bench.scans(0.1, ENABLE, torque_ff_nm=wanted, brake_open=False)
            assert feedback.torque_act_nm / wanted > 0.8
        assert abs(bench.scans(0.2, DISABLE, torque_ff_nm=30.0).torque_act_nm) < 1.0

    # --- motion -------------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("speed_deg_s", [0.6, -0.6])
    def test_it_follows_a_speed_with_the_right_sign_and_size(
        self, bench: DriveBench, speed_deg_s: float
    ) -> None:
        bench.enable()
        self.ramp_to(bench, speed_deg_s)
        before = bench.angle_deg()
        bench.scans(1.0, ENABLE, speed_deg_s, brake_open=True)
        assert bench.speed_deg_s() == pytest.approx(speed_deg_s, rel=0.05)
        assert bench.angle_deg() - before == pytest.approx(speed_deg_s, rel=0.02)

    def test_quick_stop_ramps_down_and_holds_zero_speed(self, bench: DriveBench) -> None:
        bench.enable()
        self.ramp_to(bench, 1.5)
        before = bench.angle_deg()
        ramp_s = 1.5 / bench.quick_dec_deg_s2
        bench.scan(QUICK_STOP, brake_open=True)
        bench.scans(ramp_s + 0.3, QUICK_STOP, brake_open=True)
        way = bench.angle_deg() - before
        assert way == pytest.approx(1.5 * ramp_s / 2.0, rel=0.15)
        feedback = bench.scans(0.5, QUICK_STOP, brake_open=True)
        assert feedback.state is DriveState.QUICK_STOP_ACTIVE
        assert feedback.brake_open
        assert bench.speed_deg_s() == pytest.approx(0.0, abs=0.05)
        assert bench.angle_deg() - before == pytest.approx(way, abs=0.02)

    def test_only_disable_ends_a_quick_stop(self, bench: DriveBench) -> None:
        bench.enable()
        bench.scan(QUICK_STOP, brake_open=True)
        assert bench.scans(0.2, ENABLE, 1.0, brake_open=True).state is DriveState.QUICK_STOP_ACTIVE
        assert bench.scan(DISABLE).state is DriveState.SWITCH_ON_DISABLED

    def test_quick_stop_never_enables(self, bench: DriveBench) -> None:
        for _ in range(10):
            assert bench.scan(QUICK_STOP, brake_open=True).state in NO_TORQUE

    # --- faults and wires ---------------------------------------------------------------------------------------

    def test_a_fault_takes_torque_and_brake_and_names_itself(self, bench: DriveBench) -> None:
        bench.enable()
        self.ramp_to(bench, 0.6)
        bench.trip(ERROR_CODE)
        feedback = bench.scans(bench.brake_time_s, ENABLE, 0.6, brake_open=True)
        assert feedback.state is DriveState.FAULT
        assert feedback.error_code == ERROR_CODE
        assert not feedback.brake_open
        assert abs(bench.scans(1.0, ENABLE, 0.6, brake_open=True).torque_act_nm) < 1.0
        assert bench.speed_deg_s() == pytest.approx(0.0, abs=0.02)

    def test_only_a_fault_reset_clears_a_fault_and_it_never_enables(self, bench: DriveBench) -> None:
        bench.enable()
        bench.trip(ERROR_CODE)
        bench.scans(0.1, ENABLE)
        for request in (ENABLE, DISABLE, QUICK_STOP):
            assert bench.scans(0.05, request).state is DriveState.FAULT
        feedback = bench.scans(0.1, FAULT_RESET, brake_open=True)
        assert feedback.state is DriveState.SWITCH_ON_DISABLED
        assert feedback.error_code == 0
        assert not feedback.brake_open
        assert bench.enable().state is ENABLED

    @pytest.mark.parametrize("wire", ["emergency_stop", "mains"])
    def test_an_open_wire_takes_torque_and_brake_and_keeps_the_drive_off(
        self, bench: DriveBench, wire: str
    ) -> None:
        bench.enable()
        self.ramp_to(bench, 0.6)
        getattr(bench, wire)(False)
        feedback = bench.scans(bench.brake_time_s, ENABLE, 0.6, brake_open=True)
        assert feedback.state in NO_TORQUE
        assert not feedback.brake_open
        shown = feedback.inputs.estop_ok if wire == "emergency_stop" else feedback.inputs.mains_ready
        assert not shown
        assert bench.scans(1.0, ENABLE, brake_open=True).state in NO_TORQUE
        assert bench.speed_deg_s() == pytest.approx(0.0, abs=0.02)
        getattr(bench, wire)(True)
        if bench.drive.read().state is DriveState.FAULT:  # lost mains may be a fault like any other
            bench.scan(FAULT_RESET)
        assert bench.scan(DISABLE).state is DriveState.SWITCH_ON_DISABLED
        assert bench.enable().state is ENABLED

    # --- the end ------------------------------------------------------------------------------------------------

    def test_close_from_motion_leaves_it_off_and_braked_and_may_be_called_twice(
        self, bench: DriveBench
    ) -> None:
        bench.enable()
        self.ramp_to(bench, 0.6)
        bench.drive.close()
        self.assert_closed(bench)
        angle = bench.angle_deg()
        bench.drive.close()
        self.assert_closed(bench)
        assert bench.angle_deg() == pytest.approx(angle, abs=1e-4)

    def test_close_without_ever_being_used(self, bench: DriveBench) -> None:
        bench.drive.close()
        self.assert_closed(bench)

    def assert_closed(self, bench: DriveBench) -> None:
        feedback = bench.drive.read()
        assert feedback.state in NO_TORQUE
        assert not feedback.brake_open
        assert bench.speed_deg_s() == pytest.approx(0.0, abs=1e-3)
        assert abs(feedback.torque_act_nm) < 1.0

    def ramp_to(self, bench: DriveBench, speed_deg_s: float, acc_deg_s2: float = 1.0) -> None:
        """Accelerate gently; the load follows."""
        n = math.ceil(abs(speed_deg_s) / acc_deg_s2 / bench.period_s)
        for k in range(n):
            bench.scan(ENABLE, speed_deg_s * (k + 1) / n, brake_open=True)
        bench.scans(1.0, ENABLE, speed_deg_s, brake_open=True)
