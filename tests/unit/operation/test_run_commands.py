"""Each command of a run alone: how often it acts, in which direction, how long, and what refuses it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gantryctl.drives.simulated import SimDrive
from gantryctl.errors import AlarmStop, CommandRefused
from gantryctl.image import DigitalInputs, Direction, InputImage
from gantryctl.machine import default_machine, with_values
from gantryctl.operation import run as run_module
from gantryctl.operation.client import Ending, MotionReport, Snapshot, Stop
from gantryctl.operation.run import AxisRun
from gantryctl.program import Code, GantryProgram, PowerPhase
from gantryctl.program.alarms.words import Words
from gantryctl.runtime import FixedOperator
from gantryctl.units import deg, rad
from support.modulo_machine import modulo_machine

from .kept_bench import IDEAL, MACHINE, kept_machine

approx = pytest.approx


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


def test_a_power_up_is_counted_once_and_a_power_down_ends_it() -> None:
    with kept_machine(IDEAL, power_ups=3) as store:
        run = AxisRun(IDEAL, store)
        run.power_up()
        run.power_up()
        run.move(11.0, 6.0)
        run.power_down()
        assert run.axis.is_off
        run.power_down()
        run.move(12.0, 6.0)
        run.close("done")
        kept = store.load_retained()
    assert kept is not None
    assert (kept.power_ups, kept.moves) == (5, 2)


def test_a_halt_is_one_halt_and_the_next_move_goes_on() -> None:
    run = AxisRun(IDEAL)
    run.power_up()
    run.begin_move(50.0, 6.0)
    run.follow(0.5)
    run.halt()
    assert run.axis.virtual.at_rest
    # Half a second of its ramp, and back on it.
    assert run.angle_deg < 5.0
    assert not run.operator.command.halt
    report = run.move(5.0, 6.0)
    assert report.ending is Ending.DONE
    assert report.end_deg == approx(5.0, abs=0.005)
    run.close("done")


def test_power_ups_and_moves_of_a_run_are_kept_each_for_itself() -> None:
    with kept_machine(IDEAL) as store:
        before = store.load_retained()
        run = AxisRun(IDEAL, store)
        for _ in range(2):
            run.move_by(0.2)
        run.close("done")
        after = store.load_retained()
    assert before is not None
    assert after is not None
    assert (after.power_ups - before.power_ups, after.moves - before.moves) == (1, 2)


@pytest.mark.parametrize(
    ("at_rest", "not_in_position", "text"),
    [(True, False, "done"), (True, True, "not in position"), (False, False, "not in position")],
)
def test_only_what_stands_in_its_window_is_done(at_rest: bool, not_in_position: bool, text: str) -> None:
    """A motion that goes on beyond its time is not done, though no window is left yet."""
    run: Any = object.__new__(AxisRun)
    waited: list[float] = []
    run._memory, run._scans = (
        SimpleNamespace(moves=0),
        SimpleNamespace(until=lambda done, seconds: waited.append(seconds), stop=Stop.NO),
    )
    run._rest_s = 120.0
    run.engine, run.operator = SimpleNamespace(time_s=7.0, scan=0), FixedOperator()
    run._open = SimpleNamespace(reading=SimpleNamespace(angle_deg=5.0))
    run.axis = SimpleNamespace(
        plan_end_s=6.0,
        at_rest=at_rest,
        alarms=SimpleNamespace(first_out=None, blocking=lambda: None),
        monitors=SimpleNamespace(not_in_position=not_in_position),
        settings=SimpleNamespace(travel=SimpleNamespace(endless=False)),
    )
    report = run._finished(MotionReport(Ending.STOPPED, 0.0, 0.0, 1.0, 1.0))
    assert (report.text, report.end_deg, report.to_s, report.settled_s) == (text, 5.0, 7.0, 1.0)
    assert run._memory.moves == 1
    # Two minutes beyond the end of its plan, which was a second ago.
    assert waited == [119.0]


@pytest.mark.parametrize("at_rest", [False, True])
def test_an_axis_without_torque_is_not_down_while_anything_moves(at_rest: bool) -> None:
    """Torque may be off while the set-point is still on its ramp: the next run would begin with it."""
    axis = SimpleNamespace(
        is_off=True, virtual=SimpleNamespace(at_rest=at_rest), power=SimpleNamespace(phase=PowerPhase.OFF)
    )
    run = AxisRun.__new__(AxisRun)
    run.axis, run.engine = cast("Any", axis), cast("Any", SimpleNamespace(failure=None))
    assert run._is_down() is at_rest


@pytest.mark.parametrize("asked", [False, True])
def test_a_run_whose_lines_nobody_reads_any_more_is_told_as_that(asked: bool) -> None:
    """Unless somebody had asked it to stop before."""
    run = AxisRun(IDEAL)

    def look(seen: Snapshot) -> None:
        if seen.speed_deg_s is not None and seen.speed_deg_s > 0.5:
            if not asked or run.stop is Stop.RAMP:
                raise BrokenPipeError
            run.stop = Stop.RAMP

    run.observe(look)
    report = run.move(5.0)
    assert report.ending is (Ending.STOPPED if asked else Ending.UNREAD)
    assert (report.stopped, report.done) == (True, False)
    assert 0.0 < report.end_deg < 5.0
    run.close(report.text)


def test_a_move_that_was_stopped_is_not_done() -> None:
    run = AxisRun(IDEAL)

    def look(seen: Snapshot) -> None:
        if seen.speed_deg_s is not None and seen.speed_deg_s > 0.5:
            run.stop = Stop.RAMP

    run.observe(look)
    report = run.move(5.0)
    assert (report.ending, report.done) == (Ending.STOPPED, False)
    assert 0.0 < report.end_deg < 5.0
    run.close("stopped")


@pytest.mark.parametrize("forward", [True, False])
def test_an_increment_is_one_increment_in_its_direction(forward: bool) -> None:
    run = AxisRun(IDEAL)
    for number in (1, 2):
        report = run.increment(2.0, forward, 6.0)
        assert report.ending is Ending.DONE
        assert report.end_deg == approx((2.0 if forward else -2.0) * number, abs=0.005)
    run.close("done")


@pytest.mark.parametrize(("speed_deg_s", "refused"), [(1.0, False), (1.01, True)])
def test_with_an_overdue_brake_nothing_is_asked_for_above_1_deg_s(speed_deg_s: float, refused: bool) -> None:
    with kept_machine(IDEAL, brake_tested_at="2000-01-01T00:00:00Z") as store:
        run = AxisRun(IDEAL, store)
        assert run.brake_due.overdue
        if refused:
            with pytest.raises(CommandRefused, match="BRK-12"):
                run.move(10.5, speed_deg_s)
            assert run.axis.is_off
        else:
            assert run.move(10.5, speed_deg_s).done
        run.close("done")


@pytest.mark.parametrize("urgency", [Stop.RAMP, Stop.QUICK])
def test_a_motion_that_was_stopped_is_told_as_that(urgency: Stop) -> None:
    run = AxisRun(IDEAL)
    run.power_up()
    run.begin_move(50.0, 6.0)
    run.stop = urgency
    with pytest.raises(AlarmStop):
        run.follow(2.0)
    assert run.axis.virtual.at_rest
    assert deg(run.axis.pos_act_rad) < 10.0
    run.close("stopped")


def test_a_key_that_is_refused_moves_nothing_and_is_told() -> None:
    """BRK-06 forbids motion until it is reset."""
    run = AxisRun(IDEAL)
    run.power_up()
    run.axis.alarms.raise_(Code.BRK_06, measured=Words.OPEN, command=Words.CLOSED, time_ms=400.0)
    with pytest.raises(CommandRefused, match="BRK-06 is active"):
        run.jog(True, 6.0, 0.5)
    assert run.angle_deg == approx(0.0, abs=1e-6)
    assert not run.operator.command.forward or run.axis.motion.current is None
    with pytest.raises(CommandRefused, match="BRK-06 is active"):
        run.move(5.0, 6.0)
    run.close("refused")


@pytest.mark.parametrize("forward", [True, False])
def test_a_key_is_let_go_as_an_alarm_comes_and_not_at_rest(forward: bool) -> None:
    run, seen = AxisRun(IDEAL), list[tuple[bool, bool]]()

    def look(snapshot: Snapshot) -> None:
        command, speed_deg_s = run.operator.command, snapshot.speed_deg_s
        assert speed_deg_s is not None
        seen.append((command.forward or command.reverse, abs(speed_deg_s) > 1.0))
        if snapshot.time_s > 6.0:
            run.axis.quick_stop()

    run.observe(look)
    with pytest.raises(AlarmStop, match="INT-06"):
        run.jog(forward, 6.0, 20.0)
    assert (False, True) in seen
    run.close("stopped")


@pytest.mark.parametrize("forward", [True, False])
def test_a_key_lasts_its_time_and_then_the_ramp(forward: bool) -> None:
    """0.6 deg/s for 3 s are 1.8 deg, less 0.46 of the way up with 0.39 deg/s2; the ramp adds 0.09 and its ends 0.03."""
    run = AxisRun(IDEAL)
    report = run.jog(forward, 0.6, 3.0)
    assert abs(report.end_deg) == approx(1.46, abs=0.03)
    assert (report.end_deg > 0.0) is forward
    assert report.done
    assert (report.settled_s, report.asked_deg_s) == (None, None)
    run.close("done")


def test_a_failed_brake_refuses_every_run_but_its_test() -> None:
    with kept_machine(IDEAL, brake_failed="bore 10 N m") as store:
        with pytest.raises(CommandRefused, match="BRK-08"):
            AxisRun(IDEAL, store)
        run = AxisRun(IDEAL, store, brake_test=True)
        report = run.test_brake()
        assert report.done
        assert report.level_nm == run.axis.brake_test.level_nm
        assert report.moved_deg == approx(deg(run.axis.brake_test.moved_rad))
        assert report.limit_deg == approx(0.02)
        run.close("tested")
        kept = store.load_retained()
    assert kept is not None
    assert kept.brake_failed == ""


def test_an_observer_is_told_from_when_it_came_on() -> None:
    run = AxisRun(IDEAL)
    run.power_up()
    seen: list[float] = []
    run.observe(lambda snapshot: seen.append(snapshot.time_s))
    run.follow(0.5)
    assert len(seen) == 5
    run.close("done")


def test_a_brake_test_is_asked_for_once() -> None:
    with kept_machine(IDEAL, brake_tests=4) as store:
        run = AxisRun(IDEAL, store)
        assert run.test_brake().done
        assert not run.operator.command.brake_test
        run.follow(1.0)
        assert not run.axis.brake_test.under_way
        run.close("tested")
        kept = store.load_retained()
    assert kept is not None
    assert kept.brake_tests == 5


def test_a_brake_test_that_an_alarm_ends_is_kept_as_that() -> None:
    def stop(snapshot: Snapshot) -> None:
        if snapshot.time_s > 0.5:
            run.stop = Stop.QUICK

    with kept_machine(IDEAL) as store:
        run = AxisRun(IDEAL, store, observer=stop)
        with pytest.raises(AlarmStop, match="INT-06"):
            run.test_brake()
        run.close("stopped")
        kept = store.load_retained()
    assert kept is not None
    assert (kept.brake_test_outcome, kept.error_stop) == ("aborted", "INT-06")


def test_a_brake_test_tells_each_direction_by_its_own_torque() -> None:
    run = AxisRun(IDEAL)
    assert (run.brake_test_report().text, run.brake_test_report().detail) == ("brake test none", "")
    run.test_brake()
    run.axis.brake_test.plus_nm, run.axis.brake_test.minus_nm = 71.0, -64.0
    run.axis.brake_test.moved_rad = rad(0.0125)
    report = run.brake_test_report()
    assert report.moved_deg == approx(0.0125)
    assert (report.plus_nm, report.minus_nm) == (71.0, -64.0)
    assert report.text == "brake test passed"
    assert report.detail.startswith("held +70 and -70 N m")
    run.close("tested")


def test_power_down_takes_every_level_back() -> None:
    run = AxisRun(IDEAL)
    run.power_up()
    run._scans.command(forward=True, reverse=True, move=True)
    run.power_down()
    command = run.operator.command
    assert not any((command.power, command.forward, command.reverse, command.move))
    run.close("done")


def test_a_move_of_minutes_is_waited_for() -> None:
    """80 deg at 0.6 deg/s take 135 s."""
    run = AxisRun(with_values(IDEAL, {"control.scan_period_ms": 10.0}))
    report = run.move(80.0, 0.6)
    assert report.ending is Ending.DONE
    assert report.to_s - report.from_s == approx(135.0, abs=1.0)
    run.close("done")


@pytest.mark.parametrize(
    ("code", "command", "off"),
    [(Code.CTL_02, AxisRun.halt, True), (Code.INT_07, lambda run: run.follow(3.0), False)],
)
def test_an_alarm_that_overtakes_a_command_ends_it(
    code: Code, command: Callable[[AxisRun], object], off: bool
) -> None:
    """A halt ends by torque off, a move by the end of motions alone."""
    run = AxisRun(IDEAL)
    run.power_up()
    run.begin_move(50.0, 6.0)
    run.follow(0.5)
    run.axis.alarms.raise_(code, measured="a test")
    with pytest.raises(AlarmStop, match=code):
        command(run)
    assert run.axis.is_off is off
    assert run.engine.time_s < 10.0, "nothing else is waited for"
    run.close("stopped")


def test_a_stop_that_is_asked_for_after_an_alarm_makes_no_second_one() -> None:
    """The axis is on its way to torque off already; a person would have two alarms to read."""
    run = AxisRun(IDEAL)
    run.power_up()
    run.begin_move(5.0, 6.0)
    run.follow(0.5)
    run.observe(lambda seen: setattr(run, "stop", Stop.QUICK))
    run.axis.alarms.raise_(Code.CTL_02, measured="a test")
    with pytest.raises(AlarmStop, match="CTL-02"):
        run.follow(1.0)
    assert run.axis.is_off
    assert [alarm.code for alarm in run.axis.alarms.history] == [Code.CTL_02]
    run.close("stopped")


def test_an_alarm_that_forbids_the_next_motion_ends_no_motion_under_way() -> None:
    """BRK-06: a brake that answers wrongly is no reason to stop on it."""
    run = AxisRun(IDEAL)
    run.power_up()
    run.begin_move(5.0, 6.0)
    run.follow(0.5)
    run.axis.alarms.raise_(Code.BRK_06, measured=Words.OPEN, command=Words.CLOSED, time_ms=400.0)
    run.follow(0.5)
    assert not run.axis.virtual.at_rest
    assert run.axis.alarms.blocking() is not None
    run.close("done")


def test_a_refusal_of_power_is_of_the_power_up_that_it_refused() -> None:
    run = AxisRun(with_values(default_machine(), {"control.scan_period_ms": 4.0}))
    assert isinstance(run.drive, SimDrive)
    run.drive.faults.mains_ready = False
    with pytest.raises(CommandRefused, match="mains are not ready"):
        run.power_up()
    run.power_down()
    run.drive.faults.mains_ready = True
    assert run.move(0.5, 6.0).done
    run.close("done")


def test_a_power_up_that_was_refused_is_asked_for_anew_by_the_next_move() -> None:
    """Whoever has the mains back need not know that power was asked for before; nothing comes on by itself."""
    run = AxisRun(IDEAL)
    read = run.drive.read
    run.drive.read = lambda: read()._replace(inputs=DigitalInputs(mains_ready=False))  # type: ignore[method-assign]
    with pytest.raises(CommandRefused, match="mains are not ready"):
        run.move(0.5, 6.0)
    run.drive.read = read  # type: ignore[method-assign]
    run.engine.run_for(1.0)
    assert run.axis.is_off
    assert run.move(0.5, 6.0).done
    assert run.angle_deg == approx(0.5, abs=0.005)
    run.close("done")


@pytest.mark.parametrize("forward", [True, False])
def test_a_key_that_was_refused_is_let_go_and_works_again(forward: bool) -> None:
    """6 deg/s by hand without the enabling switch are refused; with it a second at 0.39 deg/s2 goes 0.2 deg."""
    run = AxisRun(IDEAL)
    read = run.drive.read
    run.power_up()
    run.drive.read = lambda: read()._replace(inputs=DigitalInputs(enabling_switch=False))  # type: ignore[method-assign]
    with pytest.raises(CommandRefused, match="enabling switch"):
        run.jog(forward, 6.0, 1.0)
    assert not run.operator.command.forward
    assert not run.operator.command.reverse
    run.drive.read = read  # type: ignore[method-assign]
    report = run.jog(forward, 6.0, 1.0)
    assert report.ending is Ending.DONE
    assert 0.2 < (report.end_deg if forward else -report.end_deg) < 0.3
    run.close("done")


def test_an_experiment_that_is_stopped_at_speed_ends_at_rest() -> None:
    run = AxisRun(IDEAL)
    run.power_up()
    run.begin_move(50.0, 6.0)
    run.follow(6.0)
    assert not run.axis.virtual.at_rest
    run.stop = Stop.RAMP
    with pytest.raises(AlarmStop, match="stopped by the operator"):
        run.follow(0.1)
    assert run.axis.virtual.at_rest
    run.close("stopped")


def test_an_experiment_that_is_stopped_does_not_last_its_time() -> None:
    """A minute of excitation would go on at a standing axis. From 6 deg/s the ramp of Stop takes 3.2 s."""
    begun_s = 0.0

    def asks(snapshot: Snapshot) -> None:
        if begun_s and snapshot.time_s >= begun_s + 5.0:
            run.stop = Stop.RAMP

    run = AxisRun(IDEAL, observer=asks)
    run.power_up()
    run.begin_move(100.0, 6.0)
    begun_s = run.engine.time_s
    with pytest.raises(AlarmStop, match="stopped by the operator"):
        run.follow(60.0)
    assert run.axis.virtual.at_rest
    assert 5.0 < run.engine.time_s - begun_s < 9.0
    run.close("stopped")


def test_ways_and_angles_of_an_axis_without_ends_follow_each_other() -> None:
    run = AxisRun(modulo_machine({"drive.kind": "ideal", "control.scan_period_ms": 10.0}))
    with pytest.raises(CommandRefused):
        run.move_by(1e9, 6.0)
    assert run.axis.is_off
    assert run.engine.scan == 0
    assert run.move_by(3.0, 6.0).end_deg == approx(3.0, abs=0.005)
    assert run.move(1.0, 6.0).end_deg == approx(1.0, abs=0.005)
    run.close("done")


def test_a_way_of_many_turns_is_a_way_and_none_of_no_length(monkeypatch: pytest.MonkeyPatch) -> None:
    run = AxisRun(modulo_machine({"drive.kind": "ideal", "control.scan_period_ms": 10.0}))
    moved: list[dict[str, Any]] = []
    monkeypatch.setattr(run, "_motion", lambda **levels: moved.append(levels))
    # A thousand turns are 6283 rad.
    run.move_by(-360_000.0, 6.0, 0.5)
    assert moved == [
        {
            "move": True, "relative": True, "target_rad": approx(-6283.185307), "direction": None,
            "speed_rad_s": approx(rad(6.0)), "override": 0.5,
        }
    ]  # fmt: skip
    for nowhere in (float("nan"), float("inf")):
        with pytest.raises(CommandRefused):
            run.move_by(nowhere, 6.0)
    run.close("refused")


def test_ways_of_a_linear_axis_follow_each_other_to_the_end_of_its_travel() -> None:
    """Each counts from the set-point: what the axis stands beside it, 1e-5 deg here, does not add up."""
    run = AxisRun(with_values(MACHINE, {"axis.pos_max_deg": 0.4, "control.scan_period_ms": 10.0}))
    run.move(0.1, 6.0)
    beside = abs(deg(run.axis.pos_act_rad) - 0.1)
    assert beside > 1e-6
    for _ in range(3):
        run.move_by(0.1, 6.0)
    # A fine count is 7.5e-8 deg.
    assert deg(run.axis.virtual.pos_ref_rad) == approx(0.4, abs=1e-10)
    with pytest.raises(CommandRefused, match=r"0\.00 deg are left"):
        run.move_by(0.001, 6.0)
    assert run.move_by(-0.1, 6.0).end_deg == approx(0.3, abs=0.005)
    run.close("done")


def test_the_frames_of_the_bus_since_the_last_slice_are_looked_at_as_a_run_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What was on the bus around an alarm in the last scans is kept with it."""
    run = AxisRun(IDEAL)
    run.power_up()
    ended: list[bool] = []
    monkeypatch.setattr(run._scans, "end", lambda: ended.append(run.axis.is_off))
    run.close("done")
    assert ended == [True]


def test_a_run_that_was_refused_leaves_its_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    left: list[object] = []
    monkeypatch.setattr(run_module, "leave_bus", left.append)
    run = AxisRun(IDEAL)
    run.close("refused")
    assert left == [run.drive]
    moved = AxisRun(IDEAL)
    moved.engine.step()
    moved.close("done")
    assert left == [run.drive]


def test_a_brake_that_has_passed_is_due_again_later() -> None:
    with kept_machine(IDEAL, brake_tested_at="2000-01-01T00:00:00Z") as store:
        run = AxisRun(IDEAL, store)
        assert run.brake_due.overdue
        run.test_brake()
        assert not run.brake_due.overdue
        assert run.move(10.5, 6.0).done
        # A plant of this process comes back where it was: nothing needs to be kept.
        run.rest_keeper()()
        run.close("done")


class Fails(GantryProgram):
    """Fails three seconds after the start, in motion."""

    def logic(self, image: InputImage) -> None:
        super().logic(image)
        if image.time_s > 3.0:
            raise ValueError("a test")


def test_the_stop_of_a_program_that_failed_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the engine is closed, which would let a plant of this process settle, and no other."""
    run, speeds = AxisRun(IDEAL, program=Fails), []
    with pytest.raises(AlarmStop, match="SYS-09") as stopped:
        run.move(50.0, 6.0)
    speeds.append(run.drive.read().vel_act_rad_s)
    close = run.engine.close

    def watched() -> None:
        speeds.append(run.drive.read().vel_act_rad_s)
        close()

    monkeypatch.setattr(run.engine, "close", watched)
    run.close("stopped", stopped.value)
    assert speeds[0] > 1.0
    assert speeds[1] == 0.0


def test_an_axis_without_ends_stays_within_its_turn_unless_a_direction_is_named() -> None:
    """From 170 to -170 deg 340 deg back at 6 deg/s, 57 s and the ramps, or 20 deg on, 3.3 s and the ramps."""
    run = AxisRun(modulo_machine({"drive.kind": "ideal", "control.scan_period_ms": 10.0}))
    run.move(170.0, 6.0)
    back = run.move(-170.0, 6.0)
    short = run.move(170.0, 6.0, direction=Direction.SHORTEST)
    assert back.to_s - back.from_s > 340.0 / 6.0
    assert short.to_s - short.from_s < 10.0
    run.close("done")


def test_the_rest_is_forgotten_as_power_comes_on_and_not_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that is killed from then on leaves no rest that a turning axis may have left."""
    run = AxisRun(IDEAL)
    forgotten: list[bool] = []
    monkeypatch.setattr(run._memory, "forget_rest", lambda: forgotten.append(run.axis.is_off))
    run.follow(0.1)
    assert forgotten == []
    run.power_up()
    run.power_up()
    assert forgotten == [True]
    run.close("done")


def test_a_rest_is_kept_within_all_turns_of_the_encoder(monkeypatch: pytest.MonkeyPatch) -> None:
    """4096 turns of 2^22 counts."""
    run = AxisRun(IDEAL)
    run.follow(0.1)
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(run._memory, "rest_keeper", lambda counts, span: asked.append((counts, span)))
    run.rest_keeper()
    assert asked == [(int(run.drive.read().pos_act_counts), 4096 * 4_194_304)]
    run.close("done")


@pytest.mark.parametrize("urgency", [Stop.RAMP, Stop.QUICK])
def test_a_stop_that_is_still_asked_for_when_power_goes_down_makes_no_alarm(urgency: Stop) -> None:
    """The axis is at rest, and an alarm would have to be acknowledged before the next run."""
    run = AxisRun(IDEAL)
    run.power_up()
    run.stop = urgency
    run.power_down()
    assert run.axis.is_off
    assert run.axis.alarms.first_out is None


def test_an_alarm_ends_the_wait_for_power() -> None:
    """It comes a tenth of a second after the begin; ten seconds would be waited for power that comes."""
    run = AxisRun(IDEAL)
    run.observe(lambda seen: run.axis.quick_stop())
    with pytest.raises(AlarmStop, match="INT-06"):
        run.power_up()
    assert run.engine.time_s < 2.0


def test_a_direction_that_was_asked_for_is_the_direction() -> None:
    """From 10 to 5 deg the way in the turn is back."""
    run = AxisRun(modulo_machine({"drive.kind": "ideal", "control.scan_period_ms": 10.0}))
    run.move(10.0, 6.0)
    asked = {way: run._move_levels(5.0, None, 1.0, way)["direction"] for way in (None, *Direction)}
    assert asked == {None: Direction.NEGATIVE, **{way: way for way in Direction}}
    run.close("done")


def test_a_report_begins_with_the_scan_before_its_motion() -> None:
    run = AxisRun(IDEAL)
    run.power_up()
    begun_s = run.engine.time_s
    assert run.move(1.0, 6.0).from_s == begun_s
    assert run.take() == run.angle_deg == approx(1.0, abs=0.005)
    run.close("done")


def test_a_brake_test_that_is_refused_is_not_the_one_before() -> None:
    """The first one passes; with power on there is no other."""
    run = AxisRun(MACHINE)
    assert run.test_brake().done
    run.power_up()
    with pytest.raises(CommandRefused, match="power"):
        run.test_brake()
    run.close("done")


def test_nobody_is_shown_the_end_of_a_run() -> None:
    """Whoever has looked may be gone: a display that fails then would stop an axis that is at rest."""
    run, seen = AxisRun(IDEAL), list[Snapshot]()
    run.observe(seen.append)
    run.power_up()
    shown = len(seen)
    assert shown
    run.close("done")
    assert len(seen) == shown


@pytest.mark.parametrize(
    ("ending", "done", "stopped"),
    [
        (Ending.DONE, True, False),
        (Ending.STOPPED, False, True),
        (Ending.UNREAD, False, True),
        (Ending.HUNG_UP, False, True),
        (Ending.NOT_IN_POSITION, False, False),
    ],
)
def test_whoever_ends_a_motion_has_stopped_it(ending: Ending, done: bool, stopped: bool) -> None:
    """A measurement ends there: what it reads is not the angle of its stop."""
    report = MotionReport(ending, 0.0, 1.0, 0.0, 2.0)
    assert (report.done, report.stopped) == (done, stopped)
