"""One run of an axis: what it does, and that it always leaves the axis at rest, braked and remembered."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gantryctl.cli.axis.display import live_line, log_line
from gantryctl.drives.simulated import SimDrive
from gantryctl.errors import AlarmStop, CommandRefused, DeviceError, UsageError
from gantryctl.image import DriveState, EncoderFlag, InputImage
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.operation import opening
from gantryctl.operation.client import MotionReport, Snapshot, Stop
from gantryctl.operation.run import AxisRun
from gantryctl.operation.state import machine_status, read_retained, reset_machine
from gantryctl.operation.store import StateStore
from gantryctl.program import Axis, AxisProgram, Code, GantryProgram
from gantryctl.units import SIGNED

IDEAL = with_values(default_machine(), {"drive.kind": "ideal"})
SIM = default_machine()


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


def assert_left_safely(session: AxisRun) -> None:
    feedback = session.drive.read()
    assert feedback.state is DriveState.SWITCH_ON_DISABLED
    assert not feedback.brake_open
    assert abs(feedback.vel_act_rad_s) < 1e-3
    if isinstance(session.drive, SimDrive):
        assert abs(session.drive.truth()[1]) < 2e-5, "the load has come to rest too"


class Looker:
    """An observer that does something at a time."""

    def __init__(self, at_s: float, act: Callable[[], None]) -> None:
        self.at_s, self._act = at_s, act
        self.seen: list[Snapshot] = []

    def __call__(self, snapshot: Snapshot) -> None:
        self.seen.append(snapshot)
        if snapshot.time_s >= self.at_s:
            self.at_s = float("inf")
            self._act()


@pytest.mark.parametrize("machine", [SIM, IDEAL], ids=["sim", "ideal"])
def test_a_move_arrives_and_says_how(machine: Machine) -> None:
    session = AxisRun(machine)
    assert session.angle_deg == pytest.approx(0.0, abs=1e-3)
    motion = session.move(1.0, 3.0)
    assert motion.done
    assert motion.asked_deg_s == pytest.approx(3.0)
    assert motion.settled_s == pytest.approx(0.2, abs=0.15)
    assert session.angle_deg == pytest.approx(1.0, abs=0.005)
    session.power_down()
    session.close("done")
    assert_left_safely(session)


def test_moves_follow_each_other_in_one_power_cycle() -> None:
    session = AxisRun(IDEAL)
    assert [session.move(target).done for target in (1.0, -1.0, 0.5)] == [True] * 3
    step = session.increment(0.25, forward=False, speed_deg_s=1.0)
    assert step.done
    assert session.angle_deg == pytest.approx(0.25, abs=1e-4)
    session.close("done")


@pytest.mark.parametrize(
    "ask",
    [
        lambda s: s.move(200.0),
        lambda s: s.move(1.0, 7.0),
        lambda s: s.move(1.0, 0.1),
        lambda s: s.jog(True, 0.3, 1.0),
        lambda s: s.increment(1.0, True, 60.0),
    ],
)
def test_what_is_refused_never_switches_power_on(ask: Callable[[AxisRun], object]) -> None:
    with StateStore(SIM) as store:
        session = AxisRun(SIM, store)
        with pytest.raises(CommandRefused):
            ask(session)
        before = session.drive.read()
        session.close("refused")
        assert session.engine.scan == 0
        assert session.drive.read() == before
    retained = read_retained(SIM)
    assert retained is not None
    assert (retained.power_ups, retained.moves) == (0, 0)


def test_an_override_outside_is_refused() -> None:
    session = AxisRun(IDEAL)
    for override in (0.0, -1.0, 1.001, 1.5, float("nan")):
        with pytest.raises(UsageError):
            session.move(1.0, override=override)
        # Power is not switched on for a move that cannot be.
        assert session.axis.is_off
    session.close("refused")


def test_the_override_counts_in_the_speed_asked_for() -> None:
    session = AxisRun(IDEAL)
    motion = session.move(0.5, 6.0, override=0.5)
    assert motion.asked_deg_s == pytest.approx(3.0)
    session.close("done")


# --- jog
# --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("forward", [True, False])
def test_a_jog_takes_its_time_and_ends_by_itself(forward: bool) -> None:
    session = AxisRun(SIM)
    motion = session.jog(forward, 1.0, 3.0)
    session.close("done")
    assert motion.done
    assert motion.settled_s is None
    assert motion.asked_deg_s is None
    assert (session.angle_deg > 0.0) is forward
    assert abs(session.angle_deg) == pytest.approx(1.0 * 3.0 - 1.27 + 0.25, abs=0.1)
    assert [alarm.code for alarm in session.axis.alarms.history] == []


def test_a_jog_ends_at_the_end_of_the_travel_and_does_not_wait_there() -> None:
    session = AxisRun(IDEAL)
    session.move(179.5)
    began = session.engine.time_s
    motion = session.jog(True, 0.6, 3000.0)
    assert motion.done
    assert session.engine.time_s - began < 20.0
    assert session.angle_deg == pytest.approx(180.0, abs=1e-4)
    assert [str(alarm.code) for alarm in session.axis.alarms.history] == ["LIM-01"]
    with pytest.raises(CommandRefused, match="only motion reverse is open"):
        session.jog(True, 0.6, 1.0)
    session.close("done")


# --- stops
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("machine", [SIM, IDEAL], ids=["sim", "ideal"])
def test_a_stop_request_ends_a_move_on_the_jog_release_ramp(machine: Machine) -> None:
    session = AxisRun(machine, observer=Looker(6.0, lambda: setattr(session, "stop", Stop.RAMP)))
    motion = session.move(90.0)
    session.power_down()
    session.close("stopped")
    assert not motion.done
    vel = 0.3933 * (6.0 - 0.7)
    assert motion.to_s - 6.0 == pytest.approx(vel / 2.0, abs=0.6)
    assert session.axis.alarms.first_out is None
    assert_left_safely(session)


def test_a_quick_stop_request_is_an_alarm_and_faster() -> None:
    session = AxisRun(SIM, observer=Looker(6.0, lambda: setattr(session, "stop", Stop.QUICK)))
    with pytest.raises(AlarmStop, match=r"INT-06 STOP .* Quick stop, at rest after"):
        session.move(90.0)
    session.close("stopped")
    assert_left_safely(session)


@pytest.mark.parametrize(
    "begin", [lambda s: s.move(90.0), lambda s: s.jog(True, 6.0, 20.0)], ids=["move", "jog"]
)
@pytest.mark.parametrize("at_s", [0.0, 0.1, 0.2, 0.3])
def test_a_stop_request_during_power_up_means_no_motion(
    at_s: float, begin: Callable[[AxisRun], MotionReport]
) -> None:
    session = AxisRun(SIM, observer=Looker(at_s, lambda: setattr(session, "stop", Stop.RAMP)))
    motion = begin(session)
    assert not motion.done
    session.power_down()
    session.close("stopped")
    assert session.angle_deg == pytest.approx(0.0, abs=0.01)
    assert_left_safely(session)


def test_an_alarm_before_the_drive_is_enabled_ends_the_move_at_once() -> None:
    """It took ten seconds, the time of a power-up that never comes."""
    session = AxisRun(SIM)
    session.engine.run_for(0.1)
    session.axis.alarms.raise_(Code.DRV_06, reaction=None)
    begun_s = session.engine.time_s
    with pytest.raises(AlarmStop, match="DRV-06"):
        session.move(5.0)
    assert session.engine.time_s - begun_s < 0.2
    session.close("stopped")
    assert_left_safely(session)


def test_a_refused_power_up_ends_the_move_at_once() -> None:
    session = AxisRun(SIM)
    assert isinstance(session.drive, SimDrive)
    session.drive.faults.mains_ready = False
    begun_s = session.engine.time_s
    with pytest.raises(CommandRefused, match="mains are not ready"):
        session.move(5.0)
    assert session.engine.time_s - begun_s < 0.2
    session.close("refused")
    assert_left_safely(session)


def test_a_stop_request_before_anything_means_no_motion() -> None:
    session = AxisRun(SIM)
    session.stop = Stop.RAMP
    assert not session.move(5.0).done
    session.close("stopped")
    assert session.angle_deg == pytest.approx(0.0, abs=0.01)


def test_an_observer_that_fails_stops_the_axis() -> None:
    def gone() -> None:
        raise BrokenPipeError

    session = AxisRun(SIM, observer=Looker(5.0, gone))
    motion = session.move(90.0)
    session.power_down()
    session.close("stopped")
    assert not motion.done
    assert session.angle_deg < 10.0
    assert_left_safely(session)


def test_an_observer_that_fails_at_the_very_end_changes_nothing_about_the_state() -> None:
    def gone() -> None:
        raise OSError

    session = AxisRun(SIM, observer=Looker(0.0, gone))
    session.close("done")
    assert_left_safely(session)


@pytest.mark.parametrize("at_s", [0.2, 0.65, 3.0, 8.0])
def test_whatever_ends_the_run_the_axis_is_left_at_rest_and_remembered(at_s: float) -> None:
    """An exception from somewhere between two slices, and close() alone to clean up."""

    def leave() -> None:
        raise SystemExit

    with StateStore(SIM) as store:
        session = AxisRun(SIM, store, observer=Looker(at_s, leave))
        with pytest.raises(SystemExit):
            session.move(90.0)
        session.close("failed")
    assert_left_safely(session)
    status = machine_status(SIM)
    assert status.last_result == "failed"
    assert status.angle_deg == pytest.approx(session.angle_deg, abs=0.05)
    assert status.condition == "power off, brake closed"


# --- alarms and memory
# ------------------------------------------------------------------------------------------------


def alarm_by_estop(store: StateStore) -> AxisRun:
    session = AxisRun(
        SIM, store, observer=Looker(4.0, lambda: setattr(session.drive.faults, "estop_ok", False))
    )
    with pytest.raises(AlarmStop, match="INT-03") as stopped:
        session.move(90.0)
    session.close("stopped by an alarm", stopped.value)
    return session


def test_an_alarm_holds_the_axis_until_it_is_acknowledged() -> None:
    with StateStore(SIM) as store:
        assert_left_safely(alarm_by_estop(store))
    with StateStore(SIM) as store, pytest.raises(CommandRefused, match="INT-03 stopped the axis"):
        AxisRun(SIM, store)
    assert "acknowledged" in reset_machine(SIM)
    with StateStore(SIM) as store:
        session = AxisRun(SIM, store)
        assert session.move(session.angle_deg + 0.5).done
        session.close("done")
    retained = read_retained(SIM)
    assert retained is not None
    assert [alarm.code for alarm in retained.alarms] == ["INT-03"]
    assert (retained.power_ups, retained.moves) == (2, 2)


def test_small_motions_while_off_are_recorded_when_they_are_accepted() -> None:
    with StateStore(SIM) as store:
        session = AxisRun(SIM, store)
        session.move(0.5)
        session.close("done")
        state, _ = store.load_plant() or ({}, False)
        turned = 0.03 / 360.0 * 2.0 * 3.141592653589793
        store.store_plant(
            state | {"pos_load": state["pos_load"] + turned, "pos_motor": state["pos_motor"] + turned * 1144}
        )
    with StateStore(SIM) as store:
        session = AxisRun(SIM, store)
        assert any("moved +0.030 deg while off" in note for note in session.notes)
        session.close("done")
    retained = read_retained(SIM)
    assert retained is not None
    assert [alarm.code for alarm in retained.alarms] == ["ENC-09"]


class Faulty(GantryProgram):
    """Divides by zero in motion."""

    def logic(self, image: InputImage) -> None:
        super().logic(image)
        if image.time_s > 3.0:
            self.axis.scan // 0


class NeverOn(AxisProgram):
    """Forgets the power."""


def test_a_fault_in_the_program_stops_the_axis_and_holds_it() -> None:
    with StateStore(SIM) as store:
        session = AxisRun(SIM, store, program=Faulty)
        with pytest.raises(AlarmStop, match=r"SYS-09 STOP · ZeroDivisionError") as stopped:
            session.move(90.0)
        session.close("stopped by an alarm", stopped.value)
    assert_left_safely(session)
    status = machine_status(SIM)
    assert status.error_stop == "SYS-09"
    assert "ZeroDivisionError" in status.last_alarm
    assert reset_machine(SIM).startswith("SYS-09 acknowledged")


def test_a_program_that_does_not_switch_on_is_told_so() -> None:
    session = AxisRun(IDEAL, program=NeverOn)
    with pytest.raises(AlarmStop, match="SYS-10 STOP · power-up did not end within 10 s"):
        session.move(1.0)
    session.close("failed")


def test_a_program_is_made_from_the_axis() -> None:
    made: list[Axis] = []

    class Mine(GantryProgram):
        def __init__(self, axis: Axis) -> None:
            super().__init__(axis)
            made.append(axis)

    session = AxisRun(IDEAL, program=Mine)
    assert made == [session.axis]
    session.close("done")


def test_a_window_that_is_never_reached_is_not_called_done() -> None:
    """A weak loop creeps towards the target for longer than the tolerance time."""
    weak = {"control.kpp_per_s": 0.5, "control.kvf": 0.98, "monitors.in_position_window_deg": 1e-4}
    session = AxisRun(with_values(SIM, weak))
    motion = session.move(0.5)
    session.close("not in position")
    assert not motion.done
    assert [str(alarm.code) for alarm in session.axis.alarms.history] == ["CTL-11"]


def test_the_snapshot_says_what_a_display_needs() -> None:
    looker = Looker(1e9, lambda: None)
    session = AxisRun(SIM, observer=looker)
    session.move(3.0, 1.0)
    session.close("done")
    moving = [s for s in looker.seen if s.state == "discrete motion"]
    assert {s.state for s in looker.seen} >= {"disabled", "discrete motion", "standstill"}
    lefts = [s.time_left_s for s in moving]
    assert None not in lefts
    assert lefts == sorted(lefts, reverse=True)
    assert max(s.speed_deg_s for s in moving) == pytest.approx(1.0, abs=0.05)
    assert all(s.time_left_s is None for s in looker.seen if s.state != "discrete motion")


@pytest.mark.can
@pytest.mark.parametrize("what", ["the recording", "the first reading"])
def test_a_run_that_cannot_begin_leaves_the_bus(monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    from gantryctl.drives.canopen.drive import CanopenDrive

    def fails(*_: object) -> Any:
        raise DeviceError("not now")

    closed: list[CanopenDrive] = []
    close = CanopenDrive.close

    def leave(drive: CanopenDrive) -> None:
        closed.append(drive)
        close(drive)

    monkeypatch.setattr(CanopenDrive, "close", leave)
    if what == "the first reading":
        monkeypatch.setattr(opening, "judge_reference", fails)
    with pytest.raises(DeviceError, match="not now"):
        AxisRun(load_machine(configs_folder() / "hust_can.toml"), recorder=fails)
    assert len(closed) == 1


def test_power_that_was_never_on_is_not_taken_off() -> None:
    """A brake test leaves power off by itself: not a scan is made after it."""
    session = AxisRun(IDEAL)
    session.engine.step()
    session.power_down()
    assert session.engine.scan == 1
    session.move(0.5)
    session.power_down()
    off = session.engine.scan
    session.power_down()
    session.close("done")
    assert session.engine.scan == off


def test_a_run_that_ends_in_doubt_tells_no_angle() -> None:
    """The encoder of the simulated drive reports an alarm in motion: torque off, and the reading is not told."""
    seen: list[Snapshot] = []
    session = AxisRun(SIM, observer=seen.append)
    session.power_up()
    assert isinstance(session.drive, SimDrive)
    session.drive.faults.encoder_flags = EncoderFlag.ALARM
    with pytest.raises(CommandRefused, match="ENC-05"):
        session.move(90.0)
    assert session.snapshot().angle_deg is None
    assert session.snapshot().speed_deg_s is None
    assert "?" in live_line(session.snapshot(), SIGNED)
    assert "?" in log_line(session.snapshot(), SIGNED)
    assert seen[0].angle_deg is not None
    session.close("stopped by an alarm")
