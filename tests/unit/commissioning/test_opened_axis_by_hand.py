"""The axis that a step opens, by hand: what it is opened with, and what is left behind."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import pytest

from gantryctl.commissioning import open_loop_axis
from gantryctl.commissioning.watch import StepStopped
from gantryctl.errors import AlarmStop, CommandRefused
from gantryctl.image import DriveRequest
from gantryctl.machine import with_values
from gantryctl.operation.home_reference import RestVerdict
from gantryctl.runtime import Retained
from unit.commissioning.hand_drive import (
    COUNTS_PER_DEG,
    MACHINE,
    PERIOD_S,
    HandDrive,
    axis_of,
    context,
    enabled,
)

pytestmark = pytest.mark.can

ENABLE = DriveRequest.ENABLE


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Stands for a machine that was opened: why it may not be enabled, and what it keeps at the end."""
    drive = HandDrive()
    at = SimpleNamespace(drive=drive, reasons=[], kept=[])
    at.found = found = SimpleNamespace(
        drive=drive,
        feedback=drive.read(),
        reading=SimpleNamespace(angle_deg=0.0, verdict=RestVerdict.OK),
        retained=Retained("m", "h"),
        scale=SimpleNamespace(range_counts=2**20, axis_turn_counts=None),
    )
    monkeypatch.setattr(open_loop_axis, "CanopenDrive", HandDrive)
    monkeypatch.setattr(open_loop_axis, "open_machine", lambda machine, store: found)
    monkeypatch.setattr(open_loop_axis, "bus_reasons", lambda *some, **more: at.reasons)
    monkeypatch.setattr(
        open_loop_axis, "keep_machine", lambda machine, store, drive, retained: at.kept.append(retained)
    )
    return at


@pytest.mark.parametrize(
    ("how", "follows"), [({}, True), ({"following": True}, True), ({"following": False}, False)]
)
def test_an_axis_must_follow_unless_its_step_says_otherwise(
    opened: SimpleNamespace, how: dict[str, bool], follows: bool
) -> None:
    """A drive that turns the other way: 0.2 deg/s against its command."""
    opened.drive.way = -1.0
    with open_loop_axis.open_loop_axis(context(), 10.0, **how) as axis:
        axis.enable()
        if follows:
            with pytest.raises(AlarmStop, match=r"the axis turn(s|ed)"):
                axis.run(2.0, speed_deg_s=0.2)
        else:
            axis.run(2.0, speed_deg_s=0.2)


def test_a_drive_whose_parameters_were_refused_is_moved_by_no_step(opened: SimpleNamespace) -> None:
    opened.reasons = [SimpleNamespace(text="607F:00 is 1000, 1239 is wanted")]
    step = open_loop_axis.open_loop_axis(context(), 1.0)
    with pytest.raises(CommandRefused, match="607F:00 is 1000"):
        step.__enter__()
    assert all(output.request is DriveRequest.DISABLE for output in opened.drive.wrote)


@pytest.mark.parametrize("doubted_by", ["", "ENC-07"])
def test_an_axis_without_room_is_not_enabled_and_nothing_has_failed(
    opened: SimpleNamespace, doubted_by: str
) -> None:
    """At 175 deg of 180 a step on a leash of 8 deg could come to the limit switch at 182; so could one in doubt."""
    opened.found.reading.angle_deg = 0.0 if doubted_by else 175.0
    opened.found.retained = replace(opened.found.retained, doubted_by=doubted_by)
    step = open_loop_axis.open_loop_axis(context(), 8.0)
    with pytest.raises(StepStopped, match="in doubt" if doubted_by else "at 182 deg"):
        step.__enter__()
    assert all(output.request is DriveRequest.DISABLE for output in opened.drive.wrote)
    # Left off, with its rest position.
    assert opened.drive.wrote
    assert len(opened.kept) == 1
    with open_loop_axis.open_loop_axis(context(), 0.1):  # a step that stands
        pass


@pytest.mark.parametrize(("turned", "kept"), [(2**20 + 5.0, 5), (-3.0, 2**20 - 3)])
def test_where_a_step_has_left_the_shaft_is_where_it_is_looked_for_next(
    opened: SimpleNamespace, turned: float, kept: int
) -> None:
    """The encoder counts 2^20 and begins anew: 3 counts behind its 0 it shows 2^20 - 3."""
    with open_loop_axis.open_loop_axis(context(), 1.0):
        opened.drive.deg = turned / COUNTS_PER_DEG
    (retained,) = opened.kept
    assert retained.rest_position_counts == kept


def test_what_a_step_has_learned_of_the_machine_is_kept(opened: SimpleNamespace) -> None:
    with open_loop_axis.open_loop_axis(context(), 1.0) as axis:
        axis.retained = replace(axis.retained, brake_tests=7)
    assert [retained.brake_tests for retained in opened.kept] == [7]


def test_reasons_of_the_bus_are_those_that_commissioning_does_not_take_away(
    opened: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []
    monkeypatch.setattr(
        open_loop_axis, "bus_reasons", lambda *_, commissioning: (asked.append(commissioning), ())[1]
    )
    with open_loop_axis.open_loop_axis(context(), 1.0):
        pass
    assert asked == [True]


@pytest.mark.parametrize(
    ("period_s", "age", "stops"), [(0.02, 3, False), (0.02, 4, True), (0.002, 15, False), (0.002, 16, True)]
)
def test_a_telegram_may_be_three_scans_old_or_30_ms(period_s: float, age: int, stops: bool) -> None:
    drive, axis = enabled()
    axis.period_s = period_s
    drive.spoil = lambda seen: seen._replace(age_scans=age)
    if stops:
        with pytest.raises(AlarmStop, match="disturbed"):
            axis.scan(ENABLE)
    else:
        axis.scan(ENABLE)


def test_the_shaft_is_looked_at_behind_the_drive_that_is_off(opened: SimpleNamespace) -> None:
    """It sags by 0.001 deg, 1666 counts, as the brake closes."""

    def close() -> None:
        opened.drive.deg += 0.001

    opened.drive.close = close
    with open_loop_axis.open_loop_axis(context(), 1.0):
        pass
    assert opened.kept[0].rest_position_counts == 1666


@pytest.mark.parametrize("clock", [True, False])
def test_only_an_axis_by_the_clock_takes_the_priority_that_keeps_time(
    opened: SimpleNamespace, monkeypatch: pytest.MonkeyPatch, clock: bool
) -> None:
    did: list[str] = []

    @contextmanager
    def keeps_time() -> Iterator[None]:
        did.append("begins")
        yield
        did.append("ends")

    monkeypatch.setattr(open_loop_axis, "keeps_time", keeps_time)
    machine = (
        with_values(MACHINE, {"can.interface": "socketcan", "can.channel": "can0"}) if clock else MACHINE
    )
    with open_loop_axis.open_loop_axis(context(machine), 1.0):
        did.append("steps")
    assert did == (["begins", "steps", "ends"] if clock else ["steps"])


@pytest.mark.parametrize(("part", "titles"), [("there", ["there"]), ("", [])])
def test_what_moves_has_a_picture_with_what_was_commanded(
    opened: SimpleNamespace, part: str, titles: list[str]
) -> None:
    c = context()
    with open_loop_axis.open_loop_axis(c, 1.0, part) as axis:
        axis.enable()
        axis.run(0.02, speed_deg_s=0.3)
        axis.drive.silent_process_data = True  # type: ignore[misc]
        axis.scan(ENABLE, 0.3)
    assert [picture.title for picture in c.watch.pictures] == titles
    shown, silent = axis.samples[-2:]
    assert shown[1:4] == pytest.approx((0.3, 0.3, 5 * PERIOD_S * 0.3), abs=1e-6)
    # In silence the speed and the torque of the last telegram are no news.
    assert (silent.ref_deg_s, silent.way_deg) == pytest.approx((0.3, 6 * PERIOD_S * 0.3), abs=1e-6)
    assert math.isnan(silent.act_deg_s)
    assert math.isnan(silent.torque_nm)


def test_a_bus_of_its_own_time_has_the_time_of_its_link() -> None:
    now = [100.0]
    drive = HandDrive()
    drive.link = SimpleNamespace(stepped=False, now_s=lambda: now[0])
    axis = axis_of(drive)
    for now[0] in (100.004, 100.5):
        axis.scan(DriveRequest.DISABLE)
    assert [sample.time_s for sample in axis.samples] == [100.004, 100.5]
