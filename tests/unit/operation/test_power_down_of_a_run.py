"""How a run takes the torque off: a brake that lets the load go is seen before the run has ended, on the true load."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from typing import Any

import pytest

from gantryctl.drives.simulated import SimDrive
from gantryctl.errors import AlarmStop, CommandRefused
from gantryctl.image import DriveRequest, DriveState, OutputImage
from gantryctl.machine import default_machine, with_values
from gantryctl.operation.client import Snapshot, Stop
from gantryctl.operation.run import AxisRun
from gantryctl.operation.state import machine_status
from gantryctl.operation.store import StateStore
from gantryctl.program import Axis, AxisProgram, BrakeTestOutcome, Code, GantryProgram, PowerPhase
from gantryctl.program.blocks import Power
from gantryctl.runtime import ScanFailure
from gantryctl.units import deg
from support.unread import unread_stream

# The load hangs to one side at the angle of the start: 49.8 kN m, 31 kN m beyond its friction.
HANGING = with_values(
    default_machine(),
    {
        "plant.load.eccentricity_m": 0.0254,
        "plant.load.eccentric_angle_deg": 90.0,
        "control.scan_period_ms": 4.0,
    },
)
SLIP_DEG = 0.05
"""0.02 deg until it is told, and what the load goes on until torque has it: 31 kN m on 2.18e6 kg m2 in 0.2 s."""


def load_deg(run: AxisRun) -> float:
    assert isinstance(run.drive, SimDrive)
    return deg(run.drive.truth()[0])


def weaken(run: AxisRun) -> None:
    """From now on the brake holds 8 N m of the 43 N m that the load asks for."""
    assert isinstance(run.drive, SimDrive)
    run.drive.change_plant("brake_torque_nm", 8.0)


def powered(store: StateStore | None = None) -> tuple[AxisRun, float]:
    run = AxisRun(HANGING, store)
    run.power_up()
    weaken(run)
    return run, load_deg(run)


def test_a_brake_that_does_not_hold_is_told_before_the_run_has_ended() -> None:
    with StateStore(HANGING) as store:
        run, stood_deg = powered(store)
        with pytest.raises(AlarmStop, match="BRK-03 STOP") as stopped:
            run.power_down()
        assert run.axis.power.phase is PowerPhase.TORQUE_HOLD
        assert abs(load_deg(run) - stood_deg) < SLIP_DEG
        assert run.load_is_held()
        run.close("stopped", stopped.value)
        # Its torque ended with it: who asks for a stop of the next run must not be taken for one who lets this load go.
        assert not run.load_is_held()
    assert machine_status(HANGING).error_stop == "BRK-03"


@pytest.mark.parametrize("after_s", [0.1, 0.6])
def test_a_brake_that_lets_go_behind_the_power_down_is_told_too(after_s: float) -> None:
    off_s: list[float] = []

    def look(snapshot: Snapshot) -> None:
        if run.axis.power.phase is PowerPhase.OFF and run.engine.scan > 1000:
            off_s.append(snapshot.time_s)
            if snapshot.time_s - off_s[0] >= after_s - 1e-6:
                weaken(run)

    run = AxisRun(HANGING, observer=look)
    run.power_up()
    run.follow(4.0)
    with pytest.raises(AlarmStop, match=r"BRK-0[34] STOP"):
        run.power_down()
    assert run.axis.power.phase is PowerPhase.TORQUE_HOLD
    run.close("stopped")


def test_a_brake_that_fails_as_a_run_closes_locks_the_machine_too() -> None:
    """Closed without a power-down, as behind a refusal in the middle of a run."""
    with StateStore(HANGING) as store:
        run, _ = powered(store)
        with pytest.raises(CommandRefused):
            run.move(200.0)
        run.close("refused")
    assert machine_status(HANGING).error_stop == "BRK-03"


def test_a_brake_that_lets_go_behind_a_stop_by_an_alarm_is_told_too() -> None:
    """The command has its alarm already, and ends: the load would turn on with nobody there."""
    with StateStore(HANGING) as store:
        run = AxisRun(HANGING, store)
        run.power_up()
        run.stop = Stop.QUICK
        with pytest.raises(AlarmStop, match="INT-06") as stopped:
            run.follow(1.0)
        assert run.axis.is_off
        weaken(run)
        stood_deg = run.angle_deg
        run.close("stopped", stopped.value)
        # In virtual time the torque ends with the run: what counts is where the load was in its last scan.
        assert run.axis.power.phase is PowerPhase.TORQUE_HOLD
        assert abs(run.angle_deg - stood_deg) < SLIP_DEG
        kept = store.load_retained()
    assert kept is not None
    assert {row.code for row in kept.alarms} & {"BRK-03", "BRK-04"}


def test_a_brake_that_has_passed_its_test_is_watched_behind_it() -> None:
    run = AxisRun(HANGING, brake_test=True)
    assert run.test_brake().done
    assert run.axis.is_off
    weaken(run)
    with pytest.raises(AlarmStop, match=r"BRK-0[34] STOP") as stopped:
        run.power_down()
    run.close("stopped", stopped.value)


def test_a_sound_brake_is_watched_for_a_second_and_nothing_is_told() -> None:
    run = AxisRun(HANGING)
    run.power_up()
    begun_s, stood_deg = run.engine.time_s, load_deg(run)
    run.power_down()
    assert run.axis.is_off
    assert run.engine.time_s - begun_s >= 1.0
    assert abs(load_deg(run) - stood_deg) < SLIP_DEG
    assert not run.axis.alarms.history
    run.close("done")


def asked_after(run: AxisRun, times: int, looked: Callable[[], Any]) -> None:
    """After each tenth of a second that the run goes on somebody asks once more to stop."""
    go_on, left = run.engine.run_for, [Stop.NO, Stop.NO, Stop.RAMP, Stop.RAMP, Stop.QUICK][:times]

    def run_for(seconds: float) -> None:
        go_on(seconds)
        looked()
        run.stop = left.pop(0)

    run.engine.run_for = run_for  # type: ignore[method-assign]


def test_a_load_that_torque_alone_holds_in_real_time_is_held_until_somebody_asks_twice(
    capsys: pytest.CaptureFixture[str],
) -> None:
    run, stood_deg = powered()
    with pytest.raises(AlarmStop):
        run.power_down()
    # A clock that waits would take as long as the person; its scans are the same.
    run._paced = True
    seen: list[float] = []
    asked_after(run, 5, lambda: seen.append(load_deg(run)))
    assert capsys.readouterr().err == ""
    run.close("stopped")
    assert len(seen) == 5, "asked once it holds on"
    assert max(abs(angle_deg - stood_deg) for angle_deg in seen) < SLIP_DEG
    told = capsys.readouterr().err
    assert "BRK-03 STOP" in told
    assert "asked twice to stop, as by Ctrl-C; then the load is let go." in told


def test_a_load_is_held_where_nobody_can_read_why(monkeypatch: pytest.MonkeyPatch) -> None:
    """The terminal has gone, which is why the run ends: a write that fails must not take the torque away."""
    run, _ = powered()
    with pytest.raises(AlarmStop):
        run.power_down()
    run._paced = True
    seen: list[float] = []
    asked_after(run, 5, lambda: seen.append(run.engine.time_s))
    with unread_stream() as gone:
        monkeypatch.setattr(sys, "stderr", gone)
        run.close("stopped")
    assert len(seen) == 5


def test_the_brake_is_named_behind_the_alarm_that_stopped_the_axis(
    capsys: pytest.CaptureFixture[str],
) -> None:
    run, _ = powered()
    run.stop = Stop.QUICK
    with pytest.raises(AlarmStop, match="INT-06"):
        run.follow(1.0)
    run._paced = True
    asked_after(run, 5, lambda: None)
    run.close("stopped")
    told = capsys.readouterr().err
    assert re.search(r"BRK-0[34] STOP", told)
    assert "INT-06 STOP" not in told


def test_presses_of_the_motion_before_do_not_count() -> None:
    run, _ = powered()
    with pytest.raises(AlarmStop):
        run.power_down()
    run._paced, run.stop = True, Stop.QUICK
    seen: list[float] = []
    asked_after(run, 5, lambda: seen.append(run.engine.time_s))
    run.close("stopped")
    assert len(seen) == 5


def test_a_drive_that_trips_holds_nothing_and_the_run_ends() -> None:
    run, _ = powered()
    with pytest.raises(AlarmStop):
        run.power_down()
    run._paced = True
    begun_s = run.engine.time_s
    asked_after(run, 5, lambda: run.drive.trip(0x7300))
    run.close("stopped")
    assert run.engine.time_s - begun_s == pytest.approx(0.2, abs=0.11)


def test_a_power_down_behind_an_alarm_tells_of_the_brake() -> None:
    run, _ = powered()
    run.stop = Stop.QUICK
    with pytest.raises(AlarmStop, match="INT-06"):
        run.follow(1.0)
    with pytest.raises(AlarmStop, match=r"BRK-0[34] STOP"):
        run.power_down()
    # Told once.
    run.power_down()
    run.close("stopped")


def failing(run: AxisRun) -> ScanFailure:
    """The program of a run raises in its next scan, and ever after."""

    def scan(image: object) -> None:
        raise ArithmeticError("planted")

    run.engine.program.scan = scan  # type: ignore[method-assign, assignment]
    with pytest.raises(ScanFailure) as failed:
        run.engine.run_for(0.1)
    return failed.value


def test_torque_that_alone_holds_a_load_outlives_its_program(capsys: pytest.CaptureFixture[str]) -> None:
    """A brake with 2 % of its torque, 31 kN m: the load stands for as long as before, and people are told."""
    run, stood_deg = powered()
    with pytest.raises(AlarmStop):
        run.power_down()
    failed = failing(run)
    assert run.load_is_held()
    run._paced = True
    seen: list[float] = []
    run.engine.run_for(5.0)
    asked_after(run, 5, lambda: seen.append(load_deg(run)))
    begun_s = run.engine.time_s
    run.close("failed", failed)
    assert len(seen) == 5
    assert max(abs(angle_deg - stood_deg) for angle_deg in seen) < SLIP_DEG
    told = capsys.readouterr().err
    assert "BRK-03 STOP" in told
    assert "asked twice to stop" in told
    # Asked twice it is let go at once.
    assert run.engine.time_s - begun_s == pytest.approx(0.5, abs=0.11)


def test_a_program_that_fails_behind_a_brake_that_holds_leaves_the_load_to_it() -> None:
    """The liar: torque at zero speed against a closed brake, in the torque proof, is no torque that holds a load."""
    run = AxisRun(HANGING)
    run._scans.command(power=True)
    run.engine.run_until(lambda _: run.axis.power.phase is PowerPhase.PROVING, 2.0)
    assert (run.engine.output.request, run.engine.output.brake_open) == (DriveRequest.ENABLE, False)
    failed, stood_deg = failing(run), load_deg(run)
    assert not run.load_is_held()
    run.engine.run_for(1.0)
    assert run.engine.output == OutputImage()
    assert abs(load_deg(run) - stood_deg) < SLIP_DEG
    run.close("failed", failed)


@pytest.mark.parametrize("trips", [False, True])
def test_a_drive_in_fault_is_asked_for_nothing_by_an_engine_without_a_program(trips: bool) -> None:
    """It holds nothing, and a person resets it."""
    run, _ = powered()
    with pytest.raises(AlarmStop):
        run.power_down()
    failed = failing(run)
    if trips:
        assert isinstance(run.drive, SimDrive)
        run.drive.trip(0x7300)
        run.drive.change_plant("brake_torque_nm", 400.0)  # what becomes of the load is not the matter here
    run.engine.run_for(1.0)
    assert run.load_is_held() is not trips
    assert (run.engine.output.request is DriveRequest.DISABLE) is trips
    run.close("failed", failed)


def test_an_alarm_that_has_been_told_is_told_no_second_time() -> None:
    run = AxisRun(with_values(default_machine(), {"drive.kind": "ideal"}))
    run.power_up()
    run.axis.alarms.raise_(Code.DRV_07, measured=1.0, limit=1.0)
    with pytest.raises(AlarmStop, match="DRV-07"):
        run.follow(1.0)
    run.power_down()
    run.close("stopped")


class FailsAsPowerGoes(GantryProgram):
    """Its author has tried it with power on alone."""

    def logic(self, image: Any) -> None:
        if self.axis.power.status and not image.operator.power:
            raise ArithmeticError("planted")
        super().logic(image)


def test_a_program_that_fails_as_a_run_closes_is_braked_before_the_torque_goes() -> None:
    with StateStore(HANGING) as store:
        run = AxisRun(HANGING, store, program=FailsAsPowerGoes)
        run.power_up()
        run.begin_move(5.0, 6.0)
        run.follow(2.0)
        # 0.79 deg/s: a quick stop of 5.4 deg/s2 takes 0.06 deg, and a scan; the load swings behind it.
        begun_deg, turning = load_deg(run), abs(deg(run.axis.feedback.vel_rad_s))
        assert turning > 0.5
        with pytest.raises(ScanFailure):
            run.close("stopped")
        assert abs(load_deg(run) - begun_deg) < 0.08
        assert (run.engine.output.request, run.engine.output.brake_open) == (DriveRequest.DISABLE, False)
    assert machine_status(HANGING).error_stop == "SYS-09"


class KeepsPower(AxisProgram):
    """It switches power on as it is asked to, and never off."""

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.power, self.on = Power(axis), False

    def logic(self, image: Any) -> None:
        self.on = self.on or image.operator.power
        self.power(enable=self.on)


def test_a_program_that_keeps_power_on_is_told_so_ten_seconds_later() -> None:
    run = AxisRun(with_values(default_machine(), {"drive.kind": "ideal"}), program=KeepsPower)
    run.power_up()
    begun_s = run.engine.time_s
    with pytest.raises(
        AlarmStop, match="SYS-10 STOP · power-down did not end within 10 s, the axis is standstill"
    ):
        run.power_down()
    assert run.engine.time_s - begun_s == pytest.approx(11.0, abs=0.2)
    run.close("failed")


def test_a_drive_that_may_take_long_to_enable_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """12 s, for its DC link; [monitors] power_up_time_ms permits 20."""
    slow = {"drive.kind": "ideal", "control.scan_period_ms": 10.0, "monitors.power_up_time_ms": 20_000.0}
    run = AxisRun(with_values(default_machine(), slow))
    read = run.drive.read

    def charging() -> Any:
        seen = read()
        enabled = seen.state is DriveState.OPERATION_ENABLED and run.engine.time_s < 12.0
        return seen._replace(state=DriveState.SWITCHED_ON) if enabled else seen

    monkeypatch.setattr(run.drive, "read", charging)
    run.power_up()
    assert run.engine.time_s == pytest.approx(12.0, abs=1.0)
    run.power_down()
    assert run.test_brake().outcome is not BrakeTestOutcome.NONE
    run.close("done")
