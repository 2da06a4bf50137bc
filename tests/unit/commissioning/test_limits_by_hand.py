"""Limits that steps of commissioning set and grant: for a test move, for a quick stop, for a watchdog."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import open_loop_axis, steps_lacks, steps_motion, steps_sign
from gantryctl.commissioning.pictures import MotionSample
from gantryctl.commissioning.results import (
    Figure,
    Outcome,
    Progress,
    StepResult,
    load_progress,
    store_progress,
)
from gantryctl.commissioning.stopping import steps_silence
from gantryctl.commissioning.stopping.quick_stop import QuickStop, measure_quick_stop, permitted_way_deg
from gantryctl.commissioning.stopping.silence import SilentDrive, Way
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.errors import AlarmStop, DeviceError
from gantryctl.image import DriveRequest, DriveState
from gantryctl.machine import with_values
from unit.commissioning.hand_drive import MACHINE, PERIOD_S, context, enabled

pytestmark = pytest.mark.can


class Rounding:
    """Objects that hold what they are told, and so much more."""

    def __init__(self, more: int, *, refused: int = 0, lacks: tuple[int, ...] = ()) -> None:
        self.more, self.refused, self.lacks = more, refused, lacks
        self.written: dict[int, int] = {}

    def optional(self, index: int) -> int | None:
        return None if index in self.lacks else 0

    def set(self, index: int, sub: int, value: int) -> None:
        if self.refused:
            raise SdoError(index, sub, self.refused)
        self.written[index] = value

    def number(self, index: int) -> int:
        return self.written[index] + self.more


def lowered(sdo: Rounding) -> dict[int, int]:
    units = SimpleNamespace(torque_unit_nm=0.257)
    drive = SimpleNamespace(node=SimpleNamespace(sdo=sdo), opened=SimpleNamespace(units=units))
    axis: Any = SimpleNamespace(drive=drive, ratio=1144.0)
    return steps_sign._lower_limits(context(MACHINE), axis)


@pytest.mark.parametrize("more", [-2, -1, 0, 1, 2])
def test_a_limit_for_a_test_move_is_held_but_for_a_rounding(more: int) -> None:
    """Half of 257 N m are 500 per mille."""
    if abs(more) > 1:
        with pytest.raises(DeviceError, match="6072 does not take 500"):
            lowered(Rounding(more))
    else:
        assert lowered(Rounding(more))[0x6072] == 500 + more


def test_a_drive_without_such_a_limit_goes_on_and_a_silent_one_does_not() -> None:
    assert list(lowered(Rounding(0, lacks=(0x6072,)))) == [0x6080]
    assert lowered(Rounding(0, refused=0x0601_0002)) == {}
    with pytest.raises(SdoError, match="no answer"):
        lowered(Rounding(0, refused=0x0504_0000))


def shown(speed_deg_s: float) -> Any:
    """An axis with this speed that says why it is stopped."""

    def stop_for(why: str) -> None:
        raise AlarmStop(why)

    return SimpleNamespace(ratio=1144.0, speed_deg_s=speed_deg_s, stop_for=stop_for)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_pulse_may_have_its_speed_and_no_more(way: float) -> None:
    """0.2 deg/s to the last bit; a speed that is not known is no speed."""
    steps_sign._hold_back(shown(way * 0.2), 0.03)
    for speed in (math.nextafter(0.2, 1.0), math.nan):
        with pytest.raises(AlarmStop, match=r"at most 0\.030 deg/s are commanded"):
            steps_sign._hold_back(shown(way * speed), 0.03)


def test_a_pulse_is_a_half_sine_and_then_rest() -> None:
    """1.5 s are 375 scans, 0.5 s of rest 125: as fast at the end as at the beginning, and 0.03 deg in all."""
    asked: list[float] = []
    axis: Any = SimpleNamespace(
        ratio=1144.0,
        angle_deg=0.0,
        speed_deg_s=0.0,
        period_s=PERIOD_S,
        scan=lambda _, speed: asked.append(speed),
    )
    steps_sign._pulse(axis)
    pulse, rest = asked[:375], asked[375:]
    assert rest == [0.0] * 125
    assert pulse == pytest.approx(pulse[::-1], abs=1e-12)
    assert max(pulse) == pytest.approx(0.0314159, rel=1e-4)  # 0.03 deg in 1.5 s, times pi/2
    assert sum(pulse) * PERIOD_S == pytest.approx(0.03, rel=1e-4)


def test_the_way_of_a_pulse_begins_where_the_axis_stood() -> None:
    """It had moved by 0.01 deg since the drive was opened."""
    axis: Any = SimpleNamespace(ratio=1144.0, angle_deg=0.01, speed_deg_s=0.0, period_s=PERIOD_S)

    def scan(_: object, speed_deg_s: float) -> None:
        axis.angle_deg += speed_deg_s * PERIOD_S

    axis.scan = scan
    way_deg, _ = steps_sign._pulse(axis)
    assert way_deg == pytest.approx(0.03, rel=1e-4)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("given", [1.15, math.nextafter(1.15, 2.0), math.nan])
def test_a_lowered_torque_limit_may_be_passed_by_15_percent(given: float, way: float) -> None:
    """Of 1 N m to the last bit: rounding of 6072 and 6077, ripple of the current loop."""
    axis = shown(0.0)
    process, units = SimpleNamespace(torque_known=True), SimpleNamespace(torque_unit_nm=0.01)
    axis.drive = SimpleNamespace(process=process, opened=SimpleNamespace(units=units))
    axis.feedback, axis.angle_deg, axis.period_s = SimpleNamespace(torque_act_nm=way * given), 0.0, PERIOD_S
    axis.scan = axis.run = lambda *_: None
    figures: dict[str, Figure] = {}
    if given == 1.15:
        assert steps_sign._push(axis, {0x6072: 100}, figures) == "; 6072 lowered to 1 N m, 1.1 N m given"
        assert figures["torque_most_nm"].value == 1.15
    else:
        with pytest.raises(AlarmStop, match="is not heeded"):
            steps_sign._push(axis, {0x6072: 100}, figures)


def test_a_figure_that_is_no_number_is_not_stored(tmp_path: Path) -> None:
    """NaN is no JSON: what others read would end there. What was stored before stays."""
    path, good = tmp_path / "results.json", Progress("m", "h")
    store_progress(path, good)
    bad = replace(good, results={"k": StepResult("k", Outcome.FAILED, "", {"a_deg": Figure(math.nan)})})
    with pytest.raises(ValueError, match="not JSON compliant"):
        store_progress(path, bad)
    assert load_progress(path) == good


@pytest.mark.parametrize("more", [0.0, 1e-9])
@pytest.mark.parametrize("what", ["leash", "quick stop", "torque"])
def test_what_is_permitted_may_be_reached(what: str, more: float) -> None:
    """The way of a leash or of a stop, the torque of a limit: not a billionth beyond, both ways."""
    for way in (1.0, -1.0):
        drive, axis = enabled()
        if what == "leash":
            axis._leash_deg = 1000 * axis.deg_per_count * (1.0 - more)
            drive.spoil = lambda seen, way=way: seen._replace(pos_act_counts=round(way * 1000))
            act = lambda axis=axis: axis.scan(DriveRequest.DISABLE)  # noqa: E731
        elif what == "torque":
            drive.push = way * (1.0 + more)
            act = lambda axis=axis: steps_lacks._push(axis, 20.0, 20.0)  # noqa: E731
        else:
            # 2 deg/s and 5 deg/s2: 0.4 deg, and 0.06 s of reaction.
            counts = permitted_way_deg(2.0, 5.0) / axis.deg_per_count
            axis.deg_per_count *= counts / math.floor(counts) * (1.0 + more) * (1.0 - 1e-12)
            there = round(way * math.floor(counts))
            drive.spoil = lambda seen, there=there: seen._replace(
                state=DriveState.QUICK_STOP_ACTIVE, pos_act_counts=there
            )
            act = lambda axis=axis: measure_quick_stop(axis, 2.0, 5.0)  # noqa: E731
        if more:
            with pytest.raises(AlarmStop):
                act()
        else:
            act()


@pytest.mark.parametrize(
    ("ways", "can_be", "killed"),
    [(tuple(Way), True, 1), (tuple(Way), False, 0), ((Way.HEARTBEAT,), True, 0), ((Way.COMMANDS,), True, 0)],
)
def test_only_a_whole_silence_is_that_of_a_killed_controller(
    monkeypatch: pytest.MonkeyPatch, ways: tuple[Way, ...], can_be: bool, killed: int
) -> None:
    kills: list[object] = []
    monkeypatch.setattr(steps_silence, "can_be_killed", lambda _: can_be)
    monkeypatch.setattr(steps_silence, "kill_controller", kills.append)
    seen = SilentDrive(stopped_s=0.1, state=DriveState.FAULT, brake_open=False)
    monkeypatch.setattr(steps_silence, "fall_silent", lambda *_: seen)
    drive, axis = enabled()
    axis.wake = lambda: None
    inputs = SimpleNamespace(watchdog_contact=lambda: True)
    drive.beside = SimpleNamespace(inputs=inputs, ask_watchdog_contact=lambda: False)  # type: ignore[attr-defined]
    dog = steps_silence._Watchdog("the relay", (), "")
    fall, proofs = steps_silence._Fall("watchdog", ways, 0.1), list[str]()
    assert steps_silence._fall(context(MACHINE), axis, dog, fall, {}, proofs, own=True) == (None, 0.1)
    assert len(kills) == killed
    assert proofs[0].startswith("controller killed") is bool(killed)


def test_bands_are_proposed_from_0_0005_deg_and_0_005_deg_on() -> None:
    results = {
        "loop": StepResult("loop", Outcome.PASSED, "", {"rest_error_deg": Figure(0.0)}),
        "turn": StepResult(
            "turn", Outcome.PASSED, "", {"following_error_deg": Figure(0.0), "speed_deg_s": Figure(3.0)}
        ),
    }
    found = steps_motion.bands(context(MACHINE, **results))
    assert found.number("in_position_proposed_deg") == 0.0005
    assert found.number("following_error_proposed_deg") == 0.005
    # A result of before the times were kept.
    assert (found.seconds, found.axis_s) == (0.0, 0.0)


def test_a_picture_begins_with_its_motion() -> None:
    samples = [MotionSample(time_s, 0.0, 0.0, 0.0, 0.0) for time_s in (5.0, 5.5, 7.0)]
    assert [sample.time_s for sample in open_loop_axis._from_zero(samples)] == [0.0, 0.5, 2.0]
    assert open_loop_axis._from_zero([]) == []


@pytest.mark.parametrize(
    ("dec", "doubt", "hard"),
    [(5.4, 0.0, False), (6.2, 0.0, False), (6.3, 0.2, False), (6.3, 0.0, True), (math.nan, 0.0, True)],
)
def test_a_quick_stop_is_a_seventh_harder_at_the_most(
    monkeypatch: pytest.MonkeyPatch, dec: float, doubt: float, hard: bool
) -> None:
    """5.4 deg/s2 were set: 6.21 may be seen, less what one scan more or less makes of it."""
    monkeypatch.setattr(steps_motion, "_at_speed", lambda *_: nullcontext(None))
    seen = QuickStop(way_deg=3.0, dec_deg_s2=dec, uncertainty_deg_s2=doubt)
    monkeypatch.setattr(steps_motion, "measure_quick_stop", lambda *_: seen)
    decs: list[float] = []
    if hard:
        with pytest.raises(AlarmStop, match="too hard"):
            steps_motion._quick_stop(context(MACHINE), 6.0, decs)
    else:
        assert steps_motion._quick_stop(context(MACHINE), 6.0, decs)[:2] == ("quick stop", 3.0)
        assert decs == [dec]


@pytest.mark.parametrize(
    ("wired", "falls"),
    [
        ({}, None), ({"can.outputs.watchdog": 16}, [("watchdog", 0.1)]),
        ({"can.io.node": 3, "can.io.outputs.drive_enable": 0}, [("watchdog_heartbeat", 0.15), ("watchdog", 0.05)]),
    ],
)  # fmt: skip
def test_a_watchdog_acts_within_the_time_of_its_relay_or_of_its_node(
    wired: dict[str, object], falls: list[tuple[str, float]] | None
) -> None:
    """100 ms of the relay; the heartbeat is missed after 150 ms, and the node said 50 ms for a whole silence."""
    found = steps_silence._watchdog_of(with_values(MACHINE, wired), 0.05)
    told = None if found is None else [(fall.name, fall.limit_s) for fall in found.falls]
    assert told == falls
