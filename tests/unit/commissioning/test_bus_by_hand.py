"""Telegrams and times of a bus by hand: counts that wrap, the worst telegram, the scans until a command shows."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import steps_bus
from gantryctl.commissioning.results import Outcome
from gantryctl.operation.home_reference import AbsoluteReading, RestVerdict
from unit.commissioning.hand_drive import HandDrive, context, opens

SPAN = 2**31


def judged(monkeypatch: pytest.MonkeyPatch, step: str, drive: HandDrive) -> Any:
    monkeypatch.setattr(steps_bus, "open_loop_axis", opens(drive))
    monkeypatch.setattr(
        steps_bus, "judge_statuswords", lambda samples: SimpleNamespace(agree=True, text="agrees")
    )
    monkeypatch.setattr(steps_bus, "_statusword_sample", lambda axis, scan: None)
    return getattr(steps_bus, step)(context())


@pytest.mark.parametrize(
    ("pdo", "sdo", "apart"),
    [
        (10, 10, 0),
        (10, 400, 390),
        (400, 10, 390),
        (SPAN - 5, 5, 10),
        (5, SPAN - 5, 10),
        (2000, 10, 1990),
        (10, 2000, 1990),
    ],
)
def test_positions_of_telegram_and_sdo_are_the_shorter_way_apart(
    monkeypatch: pytest.MonkeyPatch, pdo: int, sdo: int, apart: int
) -> None:
    """A thousandth of a turn of 524 288 increments is 524; 4096 turns are 2^31."""
    drive = bus_drive(pdo, sdo)
    found = judged(monkeypatch, "process_data", drive)
    assert found.number("apart_increments") == apart
    assert (found.outcome is Outcome.PASSED) is (apart < 524)


@pytest.mark.parametrize(("missed", "passes"), [((0, 0), True), ((0, 500), False), ((500, 0), False)])
def test_the_worst_telegram_decides(
    monkeypatch: pytest.MonkeyPatch, missed: tuple[int, ...], passes: bool
) -> None:
    """Half of 1000 telegrams."""
    found = judged(monkeypatch, "process_data", bus_drive(0, 0, missed))
    assert found.number("missed_ratio") == max(missed) / 1000
    assert (found.outcome is Outcome.PASSED) is passes


@pytest.mark.parametrize(("scans", "passes"), [(1, True), (60, False)])
def test_a_command_that_shows_too_late_fails(
    monkeypatch: pytest.MonkeyPatch, scans: int, passes: bool
) -> None:
    drive = bus_drive(0, 0)
    write, asked = drive.write, [0]

    def late(output: Any) -> None:
        asked[0] += output.request.name == "ENABLE"
        write(output if asked[0] >= scans else output._replace(request=type(output.request).DISABLE))

    drive.write = late  # type: ignore[method-assign]
    drive.process.answer_times_s = [0.001]
    found = judged(monkeypatch, "sync", drive)
    assert found.number("dead_scans") == scans
    assert (found.outcome is Outcome.PASSED) is passes


def bus_drive(pdo: int, sdo: int, missed: tuple[int, ...] = (0, 0)) -> HandDrive:
    drive = HandDrive()
    drive.sdo.values[0x6064] = sdo
    drive.process.counts = pdo
    encoder = {
        "inverted": False,
        "increments_per_turn": 524_288,
        "turns": 4096,
        "position_around_zero": False,
    }
    drive.settings = SimpleNamespace(**vars(drive.settings), **encoder)
    counters = SimpleNamespace(scans=1000, missed=missed, late=(0, 0))
    drive.health = lambda: counters  # type: ignore[attr-defined]
    return drive


@pytest.mark.parametrize(
    ("verdict", "angle_deg", "outcome"),
    [
        (RestVerdict.OK, 12.5, Outcome.PASSED),
        (RestVerdict.OK, None, Outcome.FAILED),
        (RestVerdict.MOVED, 12.5, Outcome.FAILED),
        (RestVerdict.OTHER_ENCODER, 12.5, Outcome.FAILED),
        (RestVerdict.TURNS, 12.5, Outcome.FAILED),
        (RestVerdict.NOT_VALID, 12.5, Outcome.FAILED),
    ],
)
def test_an_angle_that_is_read_but_not_valid_is_no_reference(
    monkeypatch: pytest.MonkeyPatch, verdict: RestVerdict, angle_deg: float | None, outcome: Outcome
) -> None:
    """Every limit is counted from it: a number alone does not do."""
    reading = AbsoluteReading("A", 0, 0, 0, angle_deg, 0.4, 100.0, 100.0, verdict)
    kept = SimpleNamespace(zero_set_by="anna", zero_witness="mark")
    seen = SimpleNamespace(retained=kept, reading=reading)
    monkeypatch.setattr(steps_bus, "read_only", lambda *_: nullcontext(seen))
    assert steps_bus.encoder(context()).outcome is outcome
