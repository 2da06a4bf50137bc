"""The steps sign and velocity, by hand: a drive of a few lines turns as it is written down."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import steps_power, steps_sign
from gantryctl.commissioning.results import Figure, Outcome
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import AlarmStop, DeviceError
from gantryctl.image import DriveRequest
from unit.commissioning.hand_drive import (
    PERIOD_S,
    HandDrive,
)

pytestmark = pytest.mark.can


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


def limits_of(drive: HandDrive) -> list[dict[int, int]]:
    """6072 and 6080 while it is enabled, each pair once."""
    found: list[dict[int, int]] = []
    write = drive.write

    def seen(output: Any) -> None:
        if output.request is DriveRequest.ENABLE and dict(drive.sdo.values) not in found:
            found.append(dict(drive.sdo.values))
        write(output)

    drive.write = seen  # type: ignore[method-assign]
    return found


@pytest.mark.parametrize(
    ("way", "shown", "passes"),
    [
        (1.0, 1.0, True), (1.15, 0.85, True), (-1.0, -1.0, False), (-1.0, 1.0, False), (1.0, -1.0, False),
        (1.3, 1.0, False), (0.7, 1.0, False), (1.0, 1.3, False), (1.0, 0.7, False), (0.01, 1.0, False),
    ],
)  # fmt: skip
def test_the_sign_is_that_of_position_and_speed(step: Any, way: float, shown: float, passes: bool) -> None:
    drive = sign_drive(way, shown)
    limits = limits_of(drive)
    found = step(steps_sign, "sign", drive)
    assert (found.outcome is Outcome.PASSED) is passes, found.proof
    assert found.number("ratio_position") == pytest.approx(way, abs=0.01)
    assert found.number("ratio_speed") == pytest.approx(shown, abs=0.01)
    # Only a drive that turned the right way was pushed: 0.06 deg/s is faster than any pulse.
    pushed = any(output.vel_cmd_rad_s < -math.radians(0.06) * 1144 for output in drive.wrote)
    assert pushed is passes
    # Half of 257 N m in 0.257 N m, 0.6 deg/s in r/min of the motor (114.4), rounded up; then what was there before.
    assert limits == [{0x6072: 500, 0x6080: 115}]
    assert drive.sdo.values == {0x6072: 1498, 0x6080: 1239}


@pytest.mark.parametrize(("torque_nm", "words"), [(100.0, ""), (0.0, ""), (160.0, "is not heeded")])
def test_a_lowered_torque_limit_is_reached_and_not_passed(step: Any, torque_nm: float, words: str) -> None:
    """128.5 N m; 0.9 of it must be reached, 1.15 of it not be passed."""
    if words:
        drive = sign_drive(torque_nm=torque_nm)
        with pytest.raises(AlarmStop, match=words):
            step(steps_sign, "sign", drive)
        # A drive that heeds no limit gets no higher one.
        assert drive.sdo.values == {0x6072: 500, 0x6080: 115}
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
    limits = limits_of(drive)
    assert step(steps_sign, "_at_ceiling", drive) == pytest.approx(shown, rel=1e-6)
    assert [each[0x6080] for each in limits] == [15]
    assert drive.sdo.values[0x6080] == 1239


@pytest.mark.parametrize(
    ("given", "scans"), [([0.95] * 125, 10), ([0.95, *[0.5] * 124], 125), ([*[0.95] * 9, 0.5] * 13, 125)]
)
def test_a_lowered_limit_is_reached_when_it_is_held_for_40_ms(given: list[float], scans: int) -> None:
    """Of 1 N m; a peak, or nine scans of 4 ms again and again, is no limit. A push lasts 0.5 s at the most."""
    axis: Any = SimpleNamespace(
        ratio=1144.0, angle_deg=0.0, period_s=PERIOD_S, feedback=None, scanned=0, run=lambda *_: None
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
