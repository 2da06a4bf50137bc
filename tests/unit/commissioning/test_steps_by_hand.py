"""Steps of commissioning by hand: a drive of a few lines does what is written down, and the verdict is known."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.commissioning import steps_lacks, steps_motion, steps_power, steps_sign
from gantryctl.commissioning.load_side.ring import _judged, _Standing, zero_proposed
from gantryctl.commissioning.results import Figure, Outcome, StepResult
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import AlarmStop, DeviceError
from gantryctl.image import DriveRequest, DriveState
from gantryctl.machine import with_values
from gantryctl.operation.ledger.rows import TORQUE_LIMIT_NM
from gantryctl.program.power.brake_test import BrakeTest
from gantryctl.wiring.program import untestable
from unit.commissioning.hand_drive import (
    COUNTS_PER_DEG,
    MACHINE,
    PERIOD_S,
    HandDrive,
    axis_of,
    context,
)

pytestmark = pytest.mark.can

ENABLE, S = DriveRequest.ENABLE, DriveState


# --- sign and speed ---------------------------------------------------------------------------------------------------


def sign_drive(way: float = 1.0, shown: float = 1.0, *, torque_nm: float = 128.0) -> HandDrive:
    """It reaches the lowered limit of 6072 (half of 257 N m) as soon as it is pushed."""
    drive = HandDrive(way=way, shown=shown)
    drive.opened.rows[0].verdict = ParameterVerdict.OK
    # At the end of the pulse 30 deg/s2 are asked for: the limit holds the motor where it is.
    write = drive.write

    def limited(output: Any) -> None:
        write(output)
        pushed = output.vel_cmd_rad_s < -math.radians(0.06) * 1144
        drive.torque = -torque_nm if pushed else 0.0
        if pushed:
            drive.deg -= drive.speed * PERIOD_S
            drive.speed = 0.0

    drive.write = limited  # type: ignore[method-assign]
    return drive


@pytest.mark.parametrize(
    ("way", "shown", "passes"),
    [
        (1.0, 1.0, True), (1.15, 0.85, True), (-1.0, -1.0, False), (-1.0, 1.0, False), (1.0, -1.0, False),
        (1.3, 1.0, False), (0.7, 1.0, False), (1.0, 1.3, False), (1.0, 0.7, False), (0.01, 1.0, False),
    ],
)  # fmt: skip
def test_the_sign_is_that_of_position_and_speed(step: Any, way: float, shown: float, passes: bool) -> None:
    drive = sign_drive(way, shown)
    found = step(steps_sign, "sign", drive)
    assert (found.outcome is Outcome.PASSED) is passes, found.proof
    assert found.number("ratio_position") == pytest.approx(way, abs=0.01)
    assert found.number("ratio_speed") == pytest.approx(shown, abs=0.01)
    # Only a drive that turned the right way was pushed: 0.06 deg/s is faster than any pulse.
    pushed = any(output.vel_cmd_rad_s < -math.radians(0.06) * 1144 for output in drive.wrote)
    assert pushed is passes
    # Half of 257 N m in 0.257 N m, 0.6 deg/s in r/min of the motor (114.4), rounded up.
    assert drive.sdo.values == {0x6072: 500, 0x6080: 115}


@pytest.mark.parametrize(("torque_nm", "words"), [(100.0, ""), (0.0, ""), (160.0, "is not heeded")])
def test_a_lowered_torque_limit_is_reached_and_not_passed(step: Any, torque_nm: float, words: str) -> None:
    """128.5 N m; 0.9 of it must be reached, 1.15 of it not be passed."""
    if words:
        with pytest.raises(AlarmStop, match=words):
            step(steps_sign, "sign", sign_drive(torque_nm=torque_nm))
    else:
        assert step(steps_sign, "sign", sign_drive(torque_nm=torque_nm)).outcome is Outcome.FAILED


def test_a_push_that_moves_the_gantry_ends_after_its_way(step: Any) -> None:
    """A drive that turns without any torque: 0.03 deg by the pulse, then back by 0.02 deg and the way of a scan."""
    drive = HandDrive()
    drive.opened.rows[0].verdict = ParameterVerdict.OK
    found = step(steps_sign, "sign", drive)
    assert (found.outcome, found.number("torque_most_nm")) == (Outcome.FAILED, 0.0)
    # At 30 deg/s2 it goes at 1.1 deg/s by then, 0.0043 deg in a scan.
    assert 0.03 - 0.02 - 0.0043 < drive.deg < 0.03 - 0.02


@pytest.mark.parametrize(
    ("place", "verdict", "counted"),
    [
        ("608F:01", ParameterVerdict.OK, False), ("608F:01", ParameterVerdict.ABSENT, True),
        ("6072:00", ParameterVerdict.OK, True),
    ],
)  # fmt: skip
def test_increments_of_a_turn_are_counted_where_no_object_tells_them(
    step: Any, monkeypatch: pytest.MonkeyPatch, place: str, verdict: ParameterVerdict, counted: bool
) -> None:
    ratios: list[float] = []
    monkeypatch.setattr(steps_sign, "_counts", lambda c, settings, ratio, *_: ratios.append(ratio) or "")
    drive = sign_drive(1.1)
    drive.opened.rows[0].place, drive.opened.rows[0].verdict = place, verdict
    step(steps_sign, "sign", drive)
    assert ratios == ([pytest.approx(1.1, abs=0.01)] if counted else [])


@pytest.mark.parametrize("shown", [1.0, 0.5])
def test_a_ceiling_in_r_min_shows_the_increments_of_a_turn(step: Any, shown: float) -> None:
    """0.08 deg/s are 15.25 r/min of the motor: 15 are set, and twice that is asked for."""
    drive = HandDrive(shown=shown)
    write = drive.write

    def at_ceiling(output: Any) -> None:
        most = drive.sdo.values[0x6080] * 2.0 * math.pi / 60.0
        write(output._replace(vel_cmd_rad_s=min(output.vel_cmd_rad_s, most)))

    drive.write = at_ceiling  # type: ignore[method-assign]
    assert step(steps_sign, "_at_ceiling", drive) == pytest.approx(shown, rel=1e-6)
    assert drive.sdo.values[0x6080] == 15


@pytest.mark.parametrize(
    ("given", "scans"), [([0.95] * 125, 10), ([0.95, *[0.5] * 124], 125), ([*[0.95] * 9, 0.5] * 13, 125)]
)
def test_a_lowered_limit_is_reached_when_it_is_held_for_40_ms(given: list[float], scans: int) -> None:
    """Of 1 N m; a peak, or nine scans of 4 ms again and again, is no limit. A push lasts 0.5 s at the most."""
    axis: Any = SimpleNamespace(
        angle_deg=0.0, period_s=PERIOD_S, feedback=None, scanned=0, run=lambda *_: None
    )
    process, units = SimpleNamespace(torque_known=True), SimpleNamespace(torque_unit_nm=0.01)
    axis.drive = SimpleNamespace(process=process, opened=SimpleNamespace(units=units))

    def scan(*_: object) -> None:
        axis.feedback = SimpleNamespace(torque_act_nm=-given[axis.scanned])
        axis.scanned += 1

    axis.scan = scan
    figures: dict[str, Figure] = {}
    steps_sign._push(axis, {0x6072: 100}, figures)
    assert (axis.scanned, figures["torque_most_nm"].value) == (scans, 0.95)


@pytest.mark.parametrize("index", [0x6072, 0x6080])
def test_a_limit_that_is_not_lowered_ends_the_step_before_anything_moves(step: Any, index: int) -> None:
    drive = sign_drive()
    drive.sdo.keeps.add(index)
    with pytest.raises(DeviceError, match=f"{index:04X} does not take"):
        step(steps_sign, "sign", drive)
    assert not drive.wrote


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_runaway_is_stopped_by_its_speed_both_ways(step: Any, direction: float) -> None:
    """0.2 deg/s and no more."""
    drive = sign_drive(direction * 20.0, direction * 20.0)
    with pytest.raises(AlarmStop, match="are commanded"):
        step(steps_sign, "sign", drive)
    # 20 times the beginning of the pulse, until it asks for 0.01 deg/s.
    assert abs(drive.deg) < 0.02


@pytest.mark.parametrize(
    ("way", "passes"), [(1.0, True), (0.985, True), (1.015, True), (0.97, False), (1.03, False)]
)
def test_the_speed_is_right_within_two_percent(step: Any, way: float, passes: bool) -> None:
    found = step(steps_power, "velocity", HandDrive(way=way, shown=way))
    assert (found.outcome is Outcome.PASSED) is passes
    assert found.number("speed_deg_s") == pytest.approx(way * 0.1, abs=1e-5)


@pytest.mark.parametrize("tells", [True, False])
def test_only_a_drive_that_tells_its_torque_has_one(step: Any, tells: bool) -> None:
    drive = HandDrive(torque_nm=12.5)
    drive.reports_torque = tells
    found = step(steps_power, "velocity", drive)
    assert found.figures.get("torque_nm") == (Figure(12.5) if tells else None)
    assert ("mean torque 12.5 N m" in found.proof) is tells


def test_a_speed_the_other_way_is_no_speed(step: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The monitors of the axis are off here: the figure alone has to refuse it."""
    monkeypatch.setattr(
        "gantryctl.commissioning.open_loop_axis.OpenLoopAxis._judge_following", lambda *_: None
    )
    assert step(steps_power, "velocity", HandDrive(way=-1.0, shown=-1.0)).outcome is Outcome.FAILED


# --- brake ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("push", "slip_deg", "passes"),
    [(1.0, 0.0, True), (1.0, 0.015, True), (0.3, 0.0, False), (1.0, 0.03, False), (1.0, -0.03, False)],
)
def test_the_brake_passes_by_the_torque_that_it_bore_without_slipping(
    step: Any, push: float, slip_deg: float, passes: bool
) -> None:
    """70 N m both ways and less than 0.02 deg; the brake stays closed all the time."""
    drive = HandDrive(push=push)
    drive.spoil = lambda seen: seen._replace(
        pos_act_counts=round(slip_deg * COUNTS_PER_DEG) if abs(seen.torque_act_nm) > 60.0 else 0
    )
    found = step(steps_power, "brake", drive)
    assert (found.outcome is Outcome.PASSED) is passes, found.proof
    assert not any(output.brake_open for output in drive.wrote)
    # The torque is off before the drive is.
    last = next(k for k, output in enumerate(drive.wrote) if output.request is DriveRequest.DISABLE)
    assert abs(push * drive.wrote[last - 1].torque_ff_nm) < 3.0
    # Beside its limit in the report.
    assert found.figures["moved_deg"].high == 0.02
    assert found.number("torque_nm") == 70.0
    if passes:
        assert found.number("moved_deg") == pytest.approx(slip_deg, abs=1e-5)
        assert (found.number("plus_nm"), found.number("minus_nm")) == pytest.approx((70.0, -70.0), abs=1.5)


def test_a_brake_test_has_the_limits_of_the_file_in_its_own_units(monkeypatch: pytest.MonkeyPatch) -> None:
    """70 N m, 0.02 deg of sag in rad, 385 N m at most, scans of 4 ms."""
    given: list[float] = []

    class Enough(Exception):
        pass

    def test(*limits: float) -> None:
        given.extend(limits)
        raise Enough

    monkeypatch.setattr(steps_power, "BrakeTest", test)
    with pytest.raises(Enough):
        steps_power._test_brake(context(), axis_of(HandDrive()))
    assert given == pytest.approx([70.0, 3.490659e-4, 385.0, 0.004])


@pytest.mark.parametrize(
    ("kept_nm", "prepared_nm"), [(30.0, 30.0), (-30.0, -30.0), (None, 0.0), (250.0, 250.0)]
)
def test_a_brake_test_begins_with_the_torque_that_held_the_load_and_ends_behind_the_brake(
    monkeypatch: pytest.MonkeyPatch, kept_nm: float | None, prepared_nm: float
) -> None:
    prepared: list[float] = []
    prepare = BrakeTest.prepare
    monkeypatch.setattr(BrakeTest, "prepare", lambda test, nm: (prepared.append(nm), prepare(test, nm))[1])
    drive = HandDrive()
    axis = axis_of(drive)
    axis.retained = replace(axis.retained, holding_torque_nm=kept_nm)
    steps_power._test_brake(context(), axis)
    assert prepared[-1] == prepared_nm
    # Beside what holds the load, up to what the motor gives at most: 320 N m are beyond its rated 257.
    assert max(output.torque_ff_nm for output in drive.wrote) == pytest.approx(prepared_nm + 70.0, abs=1.5)
    assert not any(output.brake_open for output in drive.wrote)
    assert drive.state is S.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("owner", "preload", "testable"),
    [
        ("drive", True, False),
        ("object_60FE", True, True),
        ("controller_output", True, True),
        ("object_60FE", False, False),
    ],
)
def test_only_a_brake_that_the_controller_keeps_closed_is_tested(
    owner: str, preload: bool, testable: bool
) -> None:
    changes = {"brake.owner": owner}
    if owner == "controller_output":
        changes |= {"can.outputs.brake_release": 16}
    machine = with_values(MACHINE, changes)
    assert (untestable(machine, preload) is None) is testable
    if owner == "drive":
        for run in (steps_power.brake, steps_lacks.torque):
            found = run(context(machine))
            assert (found.outcome, found.proof) == (Outcome.NOT_TESTABLE, str(untestable(machine)))


def test_a_brake_is_not_tested_by_a_drive_that_takes_no_torque(step: Any) -> None:
    drive = HandDrive()
    drive.torque_preload = False
    found = step(steps_power, "brake", drive)
    assert (found.outcome, found.proof) == (Outcome.NOT_TESTABLE, str(untestable(MACHINE, False)))
    assert drive.wrote == []


@pytest.mark.parametrize("missing", [(), (0x6080,), (0x6072, 0x6080)])
def test_a_drive_without_limits_is_told_with_what_stops_it(step: Any, missing: tuple[int, ...]) -> None:
    drive = sign_drive()
    for index in missing:
        del drive.sdo.values[index]
    names = ", ".join(f"{index:04X}" for index in missing)
    told = f"; no {names} in this drive: torque off at 0.05 deg or 0.2 deg/s"
    assert step(steps_sign, "sign", drive).proof.endswith(told) is bool(missing)


def test_nobody_pushes_for_a_torque_that_no_telegram_carries(step: Any) -> None:
    """What is asked for is the pulse alone: 0.03 deg in 1.5 s, at its peak pi / 2 of the mean."""
    drive = sign_drive()
    drive.process.torque_known = False
    found = step(steps_sign, "sign", drive)
    assert "; the torque limit is not shown" in found.proof
    assert "torque_most_nm" not in found.figures
    fastest_deg_s = max(abs(math.degrees(output.vel_cmd_rad_s)) / 1144 for output in drive.wrote)
    assert fastest_deg_s == pytest.approx(0.02 * math.pi / 2.0, rel=1e-3)


# --- the torque limit of the maker's tool -----------------------------------------------------------------------------


def braked(plus: float = 70.0, minus: float = -70.0, outcome: Outcome = Outcome.PASSED) -> StepResult:
    return StepResult("brake", outcome, "", {"plus_nm": Figure(plus), "minus_nm": Figure(minus)})


def limit_drive(**what: Any) -> HandDrive:
    drive = HandDrive(**what)
    drive.machine = with_values(MACHINE, {"can.torque_limit_in_drive_nm": 385.0})  # type: ignore[attr-defined]
    return drive


@pytest.mark.parametrize(
    ("plus", "minus", "level_nm"), [(70.0, -70.0, 28.02), (70.0, -60.0, 22.02), (50.0, -70.0, 16.02)]
)
def test_the_push_is_a_part_of_what_the_brake_has_held(
    step: Any, plus: float, minus: float, level_nm: float
) -> None:
    """0.6 of the weaker direction, less 15.99 kN m / 1144 = 13.98 N m of the load."""
    drive = limit_drive()
    found = step(steps_lacks, "torque", drive, brake=braked(plus, minus))
    assert found.outcome is Outcome.PASSED, found.proof
    asked = [output.torque_ff_nm for output in drive.wrote]
    assert (max(asked), min(asked)) == pytest.approx((level_nm, -level_nm), abs=0.05)
    assert found.number(TORQUE_LIMIT_NM) == pytest.approx(level_nm, abs=0.05)
    assert not any(output.brake_open for output in drive.wrote)


def test_a_push_that_gives_less_or_goes_against_an_unproven_brake_is_refused(step: Any) -> None:
    assert step(steps_lacks, "torque", limit_drive(push=0.7), brake=braked()).outcome is Outcome.FAILED
    drive = limit_drive()
    for outcome in (Outcome.FAILED, Outcome.NOT_TESTABLE):
        assert step(steps_lacks, "torque", drive, brake=braked(outcome=outcome)).outcome is Outcome.FAILED
    assert not drive.wrote


@pytest.mark.parametrize(
    ("push", "outcome"),
    [(0.84, Outcome.FAILED), (0.86, Outcome.PASSED), (1.14, Outcome.PASSED), (1.16, Outcome.FAILED)],
)
def test_a_push_is_given_within_15_percent(step: Any, push: float, outcome: Outcome) -> None:
    """A scale of 6077 further off would make every torque of the controller another one."""
    assert step(steps_lacks, "torque", limit_drive(push=push), brake=braked()).outcome is outcome


@pytest.mark.parametrize(("given_nm", "held"), [(442.0, True), (443.5, False)])
def test_a_limit_of_the_makers_tool_may_be_passed_by_15_percent(
    step: Any, given_nm: float, held: bool
) -> None:
    """385 N m are entered, 466 asked for: at 442.75 the torque goes off."""
    drive = limit_drive()
    drive.spoil = lambda seen: seen._replace(torque_act_nm=max(-given_nm, min(seen.torque_act_nm, given_nm)))
    if held:
        assert step(steps_lacks, "torque", drive, brake=braked(800.0, -800.0)).outcome is Outcome.PASSED
    else:
        with pytest.raises(AlarmStop, match=r"442\.7 N m are the limit of the drive"):
            step(steps_lacks, "torque", drive, brake=braked(800.0, -800.0))


def test_a_load_that_takes_more_than_the_brake_has_held_leaves_nothing_to_push_with(step: Any) -> None:
    """0.6 x 20 N m are less than the 13.98 N m of the load."""
    drive = limit_drive()
    found = step(steps_lacks, "torque", drive, brake=braked(20.0, -20.0))
    assert (found.outcome, found.to_do) == (Outcome.NOT_TESTABLE, "a higher [brake] test_torque_nm")
    assert not drive.wrote


def test_of_two_pushes_the_weaker_is_what_the_limit_was_shown_to_be(step: Any) -> None:
    """28 N m are asked for both ways; back 26 of them are given."""
    drive = limit_drive()
    drive.spoil = lambda seen: seen._replace(torque_act_nm=max(seen.torque_act_nm, -26.0))
    found = step(steps_lacks, "torque", drive, brake=braked())
    assert (found.outcome, found.number(TORQUE_LIMIT_NM)) == (Outcome.PASSED, 26.0)
    assert found.number("pushed_least_nm") == 26.0
    assert found.number("pushed_most_nm") == pytest.approx(28.02, abs=0.05)


def test_a_limit_that_acts_is_what_the_push_is_held_against(step: Any) -> None:
    """0.6 x 800 - 14 = 466 N m are asked for, 385 N m are given: less than 85 % of the push, all of the limit."""
    drive = limit_drive()
    drive.spoil = lambda seen: seen._replace(torque_act_nm=max(-385.0, min(seen.torque_act_nm, 385.0)))
    found = step(steps_lacks, "torque", drive, brake=braked(800.0, -800.0))
    assert (found.outcome, found.number(TORQUE_LIMIT_NM)) == (Outcome.PASSED, 385.0)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_push_never_passes_the_limit_of_the_drive(direction: float) -> None:
    drive = HandDrive(push=3.0)
    with pytest.raises(AlarmStop, match="are the limit"):
        steps_lacks._push(axis_of(drive, following=False), direction * 20.0, 30.0)
    assert abs(drive.wrote[-1].torque_ff_nm) == 0.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_push_is_taken_back_and_never_goes_the_other_way(direction: float) -> None:
    """Beside what is asked for the drive gives 2 N m of its own: 60B2 ends where both are 0 together."""
    drive = HandDrive(torque_nm=2.0 * direction)
    steps_lacks._push(axis_of(drive, following=False), direction * 20.0, 30.0)
    asked = [direction * output.torque_ff_nm for output in drive.wrote if output.request is ENABLE]
    assert max(asked) == pytest.approx(20.0)
    # In 0.5 s: 0.16 N m in a scan.
    assert max(np.diff(asked)) == pytest.approx(0.16)
    assert min(asked) == pytest.approx(-2.0)
    assert asked[-1] == pytest.approx(-2.0)


# --- loop and bands ---------------------------------------------------------------------------------------------------


class Recorded(dict[str, Any]):
    """Columns of a trace."""


@pytest.mark.parametrize(
    ("error_deg", "done", "passes"),
    [(0.01, True, True), (0.2, True, False), (-0.2, True, False), (0.01, False, False)],
)
def test_the_loop_follows_on_both_sides(
    monkeypatch: pytest.MonkeyPatch, error_deg: float, done: bool, passes: bool
) -> None:
    import numpy as np

    speeds = np.array([0.0, 0.0, 0.01, 0.01, 0.0, 0.0, 0.0, 0.0])
    errors = np.radians(np.array([0.009, 0.009, error_deg, 0.0, 0.008, 0.008, 0.001, -0.002]))
    trace = Recorded(vel_ref_rad_s=speeds, pos_err_rad=errors)
    monkeypatch.setattr(steps_motion, "_move", lambda *_, **__: (trace, done))
    found = steps_motion.loop(context())
    assert (found.outcome is Outcome.PASSED) is passes
    # The second half of the rest after the move.
    assert found.number("rest_error_deg") == pytest.approx(0.002)
    assert found.number("following_error_deg") == pytest.approx(max(abs(error_deg), 0.009))


@pytest.mark.parametrize(
    ("dones", "done"), [((True, True), True), ((True, False), False), ((False, True), False)]
)
def test_every_move_must_be_done(
    monkeypatch: pytest.MonkeyPatch, dones: tuple[bool, ...], done: bool
) -> None:
    from contextlib import contextmanager

    left = list(dones)
    asked: list[tuple[float, float]] = []

    def move(target: float, speed: float) -> Any:
        asked.append((target, speed))
        run.angle_deg = target
        return SimpleNamespace(done=left.pop(0))

    run = SimpleNamespace(angle_deg=10.0, move=move)

    @contextmanager
    def recorded(c: object, part: str) -> Any:
        yield run, SimpleNamespace(trace=Recorded)

    monkeypatch.setattr(steps_motion, "_recorded_run", recorded)
    assert steps_motion._move(context(), "", (1.0, 0.0), 0.6, by=True)[1] is done
    # From where it stood, and back there.
    assert asked == [(11.0, 0.6), (10.0, 0.6)]


@pytest.mark.parametrize(
    ("rest", "following", "passes"), [(0.0, 0.0, True), (1.0, 0.0, False), (0.0, 1.0, False)]
)
def test_bands_have_half_as_much_again(rest: float, following: float, passes: bool) -> None:
    """1.4 and 1.6 in parts of what would just pass at 1.5."""
    monitors = MACHINE.monitors
    at_3 = monitors.following_error_base_deg + 3.0 * monitors.following_error_per_speed_s
    results = {
        "loop": StepResult(
            "loop", Outcome.PASSED, "", {"rest_error_deg": Figure(monitors.in_position_window_deg / (1.6 - 0.2 * rest))}
        ),
        "turn": StepResult(
            "turn", Outcome.PASSED, "",
            {"following_error_deg": Figure(at_3 / (1.6 - 0.2 * following)), "speed_deg_s": Figure(3.0)},
        ),
    }  # fmt: skip
    assert (steps_motion.bands(context(**results)).outcome is Outcome.PASSED) is passes
    assert steps_motion.bands(context(loop=results["loop"])).outcome is Outcome.FAILED


def test_a_stop_is_held_against_the_computed_one_and_60_ms() -> None:
    figures: dict[str, Figure] = {}
    steps_motion._add(context(), figures, "quick stop", 3.0, 1.0, 0.833)
    assert figures["quick_stop_3_measured_deg"] == Figure(1.0, high=pytest.approx(1.013))
    assert figures["quick_stop_3_computed_deg"] == Figure(0.833)


# --- the ring ---------------------------------------------------------------------------------------------------------

RING = with_values(MACHINE, {"can.load_encoder.source": "node", "can.load_encoder.node": 4})


@pytest.mark.parametrize(
    ("ring_deg", "passes", "words"),
    [
        ((10.0, 11.5, 10.0), True, "is proposed"),
        ((370.0, 371.5, 370.0), True, "is proposed"),
        ((10.0, 8.5, 10.0), False, "inverted"),
        ((10.0, 11.535, 10.0), False, "counts_per_turn"),
        ((10.0, 11.45, 10.0), False, "counts_per_turn"),
        # Forward only; slip to either side; a zero that is off to either side by more than 0.025 deg.
        ((10.0, 11.5, 11.5), False, "counts_per_turn"),
        ((10.0, 11.5, 13.0), False, "counts_per_turn"),
        ((10.0, 11.51, 10.02), False, "counts_per_turn"),
        ((10.0, 11.49, 9.98), False, "counts_per_turn"),
        ((10.03, 11.53, 10.03), False, "is proposed"),
        ((9.97, 11.47, 9.97), False, "is proposed"),
        ((10.0, math.nan, 10.0), False, "counts_per_turn"),
    ],
)
def test_the_ring_turns_with_the_motor(
    ring_deg: tuple[float, float, float], passes: bool, words: str
) -> None:
    motor = (10.0, 11.5, 10.0)
    found = _judged(RING, *(_Standing(m, r) for m, r in zip(motor, ring_deg, strict=True)))
    assert (found.outcome is Outcome.PASSED) is passes
    assert passes or words in found.to_do


def test_the_proposed_zero_takes_the_difference_out() -> None:
    """The ring shows 0.9 deg more than the motor: its zero lies 0.0025 of a turn higher."""
    encoder = RING.can.load_encoder
    assert zero_proposed(RING, 0.9) - encoder.zero_counts == round(0.0025 * encoder.counts_per_turn)


@pytest.mark.parametrize(
    ("ratio", "passes"), [(1.0, True), (0.81, True), (0.79, False), (0.5, False), (1.25, False)]
)
def test_increments_of_a_turn_by_the_way_of_a_speed_in_r_min(ratio: float, passes: bool) -> None:
    """8192 set; a drive with 4096 turns half as far as its reading says: 20 % either way."""
    figures: dict[str, Figure] = {}
    settings = SimpleNamespace(increments_per_turn=8192, speed_in_increments=False)
    told = steps_sign._counts(SimpleNamespace(), settings, ratio, {}, figures)  # type: ignore[arg-type]
    (figure,) = figures.values()
    assert figure.within is passes
    assert f"{8192 * ratio:.0f} increments in a turn, set to 8192" in told


@pytest.mark.parametrize(
    ("seen", "passes"), [(1.0, True), (0.96, True), (0.93, False), (0.5, False), (1.06, False)]
)
def test_increments_of_a_turn_by_the_ceiling_of_the_speed(
    seen: float, passes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """6080 is in r/min in every drive: 5 % either way of what is set."""
    monkeypatch.setattr(steps_sign, "_at_ceiling", lambda _: seen)
    figures: dict[str, Figure] = {}
    settings = SimpleNamespace(increments_per_turn=8192, speed_in_increments=True)
    steps_sign._counts(SimpleNamespace(), settings, 1.0, {0x6080: 1}, figures)  # type: ignore[arg-type]
    (figure,) = figures.values()
    assert figure.within is passes


# --- motion with the position loop closed -----------------------------------------------------------------------------


def recorded(monkeypatch: pytest.MonkeyPatch, trace: dict[str, np.ndarray]) -> None:
    """What the recorder of a run has kept, whatever the run does."""

    @contextmanager
    def run(c: object, part: str) -> Iterator[tuple[Any, Any]]:
        nothing = lambda *_: None  # noqa: E731
        yield (
            SimpleNamespace(angle_deg=0.0, jog=nothing, move=nothing, observe=nothing),
            SimpleNamespace(trace=lambda: trace),
        )

    monkeypatch.setattr(steps_motion, "_recorded_run", run)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_way_of_a_jog_release_is_that_of_its_ramp(
    monkeypatch: pytest.MonkeyPatch, direction: float
) -> None:
    """3 deg/s for 3 s, then down at 5 deg/s2: 9/10 deg."""
    up, down = np.arange(0.0, 3.0, 0.02), np.arange(3.0, 0.0, -0.02)
    vel = direction * np.concatenate((up, np.full(750, 3.0), down, np.zeros(250)))
    way = np.cumsum(vel) * PERIOD_S
    recorded(monkeypatch, {"vel_ref_rad_s": np.radians(vel), "pos_act_rad": np.radians(way)})
    # One scan of 0.012 deg.
    assert steps_motion._jog_release(context(), 3.0) == pytest.approx(0.9, abs=0.012)


def test_friction_and_eccentric_moment_are_told_at_the_load(monkeypatch: pytest.MonkeyPatch) -> None:
    """5 kN m of friction, and a weight of 2 kN m beside and 1 kN m below the axis, through 1144 turns of the motor."""
    angle = np.concatenate((np.radians(np.arange(-178.0, 178.0)), np.radians(np.arange(178.0, -178.0, -1.0))))
    forward = np.repeat((1.0, -1.0), 356)
    at_load = 5000.0 * forward + 2000.0 * np.sin(angle) - 1000.0 * np.cos(angle)
    recorded(
        monkeypatch,
        {
            "vel_ref_rad_s": np.radians(3.0) * forward,
            "pos_act_rad": angle,
            "pos_err_rad": np.radians(0.002) * forward,
            "torque_act_nm": at_load / 1144.0,
        },
    )
    c = context()
    found = steps_motion.slow_turn(c)
    # In kN m: 5 of friction, the root of 5 of the moment.
    for curve in c.watch.pictures[0].panels[0].lines:
        sign = -1.0 if "back" in curve.name else 1.0
        assert (min(curve.y), max(curve.y)) == pytest.approx(
            (5.0 * sign - math.sqrt(5.0), 5.0 * sign + math.sqrt(5.0)), abs=0.01
        )
    names = ("friction_nm", "moment_sine_nm", "moment_cosine_nm", "remainder_nm", "following_error_deg")
    assert [found.number(name) for name in names] == pytest.approx(
        [5000.0, 2000.0, -1000.0, 0.0, 0.002], abs=1e-6
    )
