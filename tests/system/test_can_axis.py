"""The whole axis over a CAN bus in virtual time: program, master, virtual drive, gantry, in one process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.side_channel.requests import Requests
from gantryctl.engineering.accuracy.procedure.on_batch import run_procedure
from gantryctl.engineering.accuracy.procedure.on_engine import run_on_engine
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure, evaluate
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.errors import AlarmStop, CommandRefused
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from gantryctl.operation.client import Stop
from gantryctl.operation.opening import set_up_again
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import StateStore
from gantryctl.program import AxisState
from gantryctl.runtime.recorder import MemoryRecorder

MACHINE = load_machine(configs_folder() / "hust_can.toml")


class Run:
    """A session on a new machine, with its trace and the drive's side channel."""

    def __init__(self, **changes: object) -> None:
        machine = with_values(MACHINE, {key.replace("__", "."): value for key, value in changes.items()})
        self.session = AxisRun(machine, recorder=MemoryRecorder)
        drive = self.session.drive
        assert isinstance(drive.truth_source, DriveNode)
        self.node = drive.truth_source
        self.ask = Requests(self.node).answer

    def after(self, seconds: float, action: Callable[[], object]) -> None:
        """In the drive's own time."""
        self.node.after(round(seconds * 1e6), action)

    def inject(self, fault: str, value: object = True) -> Callable[[], object]:
        return lambda: self.ask({"cmd": "inject", "fault": fault, "value": value})


def moved_deg(run: Run) -> float:
    return float(np.degrees(run.node.truth()[0]))


def motor_deg(run: Run) -> float:
    return float(np.degrees(run.node.truth()[2])) / MACHINE.axis.ratio


def test_a_move_ends_where_it_was_sent_and_leaves_the_brake_closed() -> None:
    run = Run()
    motion = run.session.move(10.0)
    assert motion.done
    assert run.session.angle_deg == pytest.approx(10.0, abs=0.001)
    run.session.power_down()
    run.session.close("done")
    assert not run.node.plant.brake_open
    assert run.node.axis.state.name == "SWITCH_ON_DISABLED"


def test_two_runs_are_equal_bit_for_bit() -> None:
    traces = []
    for _ in range(2):
        run = Run()
        run.session.move(3.0)
        run.session.close("done")
        recorder = run.session.engine.recorder
        assert isinstance(recorder, MemoryRecorder)
        traces.append(recorder.trace())
    assert all(np.array_equal(traces[0][name], traces[1][name]) for name in traces[0].columns)


def test_the_next_run_goes_on_from_the_kept_plant(tmp_path: Path) -> None:
    for _ in range(2):
        with StateStore(MACHINE, tmp_path) as store:
            session = AxisRun(MACHINE, store)
            session.move(session.angle_deg + 2.0)
            session.close("done")
    with StateStore(MACHINE, tmp_path) as store:
        session = AxisRun(MACHINE, store)
        assert session.angle_deg == pytest.approx(4.0, abs=0.002)
        session.close("looked")


@pytest.mark.parametrize(
    ("fault", "value", "codes", "way_deg"),
    [
        (
            "never_move",
            True,
            ("CTL-05", "CTL-03", "ENC-02"),
            2.1,
        ),  # says that it follows, and comes to a stand
        ("ignore_target", True, ("DRV-05", "CTL-05"), 2.1),  # goes on at the old speed, bit 12 = 0
        ("freeze_position", True, ("ENC-14", "ENC-02", "CTL-05"), 2.1),
        ("command_sign", -1, ("CTL-05", "CTL-03", "ENC-01"), 2.1),
        ("no_torque", True, ("DRV-13", "CTL-05", "CTL-03", "BRK-05"), 2.1),
        ("silence", True, ("CAN-03", "CAN-06"), 2.1),  # out of reach: its own watch must stop it
    ],
)
def test_a_drive_that_lies_in_motion_is_caught(
    fault: str, value: object, codes: tuple[str, ...], way_deg: float
) -> None:
    """A faulty feedback at 3 deg/s ends within 2.1 deg (brake stop and detection), whatever the lie."""
    run = Run(virtual_axis__acc_deg_s2=2.0, virtual_axis__dec_deg_s2=2.0)
    run.session.power_up()
    at_fault: list[float] = []

    def spoil() -> None:
        run.inject(fault, value)()
        at_fault.append(moved_deg(run))

    run.after(2.0, spoil)
    with pytest.raises(AlarmStop) as stopped:
        run.session.move(60.0, 3.0)
    assert str(stopped.value).startswith(codes), stopped.value
    assert abs(moved_deg(run) - at_fault[0]) < way_deg
    run.session.close("stopped", stopped.value)
    assert not run.node.plant.brake_open


def test_a_drive_that_takes_the_mode_and_never_moves_is_caught_from_the_start() -> None:
    run = Run()
    run.inject("never_move")()
    with pytest.raises(AlarmStop, match=r"CTL-0[35]|ENC-02|DRV-13"):
        run.session.move(5.0, 0.6)
    run.session.close("stopped")
    assert abs(moved_deg(run)) < 0.35  # what a fault at the first move may cost


def test_a_quick_stop_that_is_not_obeyed_takes_the_torque_off() -> None:
    """The drive says Quick stop active and turns on: the ramp's envelope catches it (D7)."""
    run = Run(virtual_axis__acc_deg_s2=2.0, virtual_axis__dec_deg_s2=2.0)
    run.inject("quick_stop_off")()
    run.session.power_up()
    asked: list[float] = []

    def ask() -> None:
        asked.append(moved_deg(run))
        run.session.stop = Stop.QUICK

    run.after(2.5, ask)
    with pytest.raises(AlarmStop) as stopped:
        run.session.move(60.0, 3.0)
    codes = [str(alarm.code) for alarm in run.session.axis.alarms.history]
    assert codes[:2] == ["INT-06", "DRV-07"]
    # 0.1 s until the request is looked at, 0.11 s outside the envelope, 0.6 s until the brake has stopped 3 deg/s
    assert abs(moved_deg(run) - asked[0]) < 2.1
    run.session.close("stopped", stopped.value)
    assert not run.node.plant.brake_open


def test_a_parameter_changed_behind_our_back_stops_the_axis_and_keeps_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """D9: the axis comes to rest on its ramp with power on, and moves no more before a reset finds the drive right."""
    monkeypatch.setattr("gantryctl.drives.canopen.setup.parameter_watch.ROUND_S", 0.5)
    run = Run(virtual_axis__acc_deg_s2=2.0, virtual_axis__dec_deg_s2=2.0)
    run.session.power_up()
    run.after(2.0, lambda: run.ask({"cmd": "write", "index": 0x605E, "value": 0}))
    with pytest.raises(AlarmStop, match=r"^DRV-09 .*605E:00 .*want 2, have 0.*jog-release ramp"):
        run.session.move(60.0, 3.0)
    axis = run.session.axis
    assert moved_deg(run) < 10.0
    assert axis.state is AxisState.STANDSTILL
    with pytest.raises(CommandRefused, match="DRV-09"):
        run.session.move(1.0)
    assert axis.reset() is None  # accepted, and said again: the cause is still there
    run.session.engine.run_for(0.1)
    assert axis.alarms.blocking() is not None
    run.ask({"cmd": "write", "index": 0x605E, "value": 2})
    run.session.engine.run_for(1.0)
    assert axis.reset() is None
    run.session.engine.run_for(0.1)
    assert axis.alarms.blocking() is None
    run.session.close("done")


def test_after_a_restart_of_the_drive_a_reset_is_enough() -> None:
    """DRV-11 in motion; then set up anew, reset by service (the angle was doubted), and the next move goes on."""
    run = Run(virtual_axis__acc_deg_s2=2.0, virtual_axis__dec_deg_s2=2.0)
    run.session.power_up()
    run.after(2.0, lambda: run.ask({"cmd": "event", "event": "reset"}))
    with pytest.raises(AlarmStop, match="DRV-11"):
        run.session.move(60.0, 3.0)
    run.session.power_down()
    engine, axis = run.session.engine, run.session.axis
    # Behind the brake, which holds the motor, the load swings on by 0.03 deg.
    stood = motor_deg(run)
    assert set_up_again(engine)
    assert not set_up_again(engine)
    assert axis.reset(service=True) is None
    engine.run_for(1.0)
    assert axis.state is AxisState.DISABLED
    assert axis.alarms.first_out is None
    assert motor_deg(run) == pytest.approx(stood, abs=0.005)
    assert run.session.move(stood + 2.0).done
    assert moved_deg(run) == pytest.approx(stood + 2.0, abs=0.02)
    run.session.close("done")


@pytest.mark.slow
def test_accuracy_over_the_bus_is_that_of_the_process(
    evidence: Callable[[str, dict[str, object]], None],
) -> None:
    procedure = chord_procedure("A")
    radius = MACHINE.accuracy.chord_radius_m

    def a_of(readings: object) -> float:
        return float(accuracy_a(evaluate(procedure, readings.load_rad[0], radius).errors_deg))

    bus, process = run_on_engine(MACHINE, procedure), run_procedure([default_machine()], procedure)
    a_bus, a_process = a_of(bus), a_of(process)
    evidence("can_accuracy", {"a_bus_deg": a_bus, "a_process_deg": a_process, "ratio": a_bus / a_process})
    assert a_bus == pytest.approx(a_process, rel=0.05)
