"""Progress of a step and its pictures: what a person sees while it runs, and what the report draws."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from gantryctl.commissioning import Commissioning, Outcome, write_report
from gantryctl.commissioning.pictures import POINTS, MotionSample, line, motion_picture
from gantryctl.commissioning.results import load_progress, store_progress
from gantryctl.commissioning.run import Reach
from gantryctl.engineering.report.meter import FIRST_S, Meter
from gantryctl.machine import configs_folder, load_machine
from gantryctl.operation.store import StateStore
from support.reports import HEAD

MACHINE = load_machine(configs_folder() / "hust_can.toml")
LEFT = re.compile(r"  (\d+) %, about (\d+) (s|min) left")


class Clock:
    """A clock of a person that goes with the axis."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def test_a_short_run_shows_nothing_and_a_long_one_its_end() -> None:
    clock, said = Clock(), []
    meter = Meter(lambda text: said.append((clock.now_s, text)), 100.0, clock)
    for _ in range(1000):
        clock.now_s += 0.1
        meter.advance(0.1)
        if clock.now_s < FIRST_S - 0.05:
            assert not said
    assert said[0] == (pytest.approx(FIRST_S, abs=0.11), "  2 %, about 98 s left")
    # Every estimate is right to a percent, because the axis keeps the time that was expected; never less than 2 %.
    for at_s, text in said:
        found = LEFT.fullmatch(text)
        assert found is not None
        assert int(found[2]) == pytest.approx(100.0 - at_s, abs=2.1)
    assert 15 <= len(said) <= 60


def test_what_is_left_is_not_known_before_anything_is_done() -> None:
    clock = Clock()
    meter = Meter(lambda text: None, 100.0, clock)
    clock.now_s = 1.0
    assert math.isnan(meter.left_s)
    meter.advance(1.0)
    assert meter.left_s == pytest.approx(99.0)


def test_a_run_that_is_late_is_nearly_done_and_never_done() -> None:
    clock, said = Clock(), []
    meter = Meter(said.append, 1.0, clock)
    for _ in range(100):
        clock.now_s += 0.1
        meter.advance(0.1)
    assert {text.split("%")[0].strip() for text in said} == {"98"}


def test_a_picture_has_few_points_and_leaves_out_what_is_unknown() -> None:
    many = line("x", range(10_000), [math.nan if k % 3 else float(k) for k in range(10_000)], POINTS)
    assert len(many.x) <= POINTS
    assert all(map(math.isfinite, many.y))
    assert (many.x[0], many.x[-1]) == (0.0, 9999.0)
    still = [MotionSample(0.004 * k, 0.0, 0.0, 0.0, math.nan) for k in range(5)]
    picture = motion_picture("no torque", still)
    assert picture is not None
    assert [panel.y_label for panel in picture.panels] == ["speed, deg/s", "way, deg"]
    assert motion_picture("nothing", still[:1]) is None
    pushed = motion_picture("a push", [sample._replace(torque_nm=12.5) for sample in still])
    assert pushed is not None
    assert [panel.y_label for panel in pushed.panels][2:] == ["torque, N m"]
    assert list(pushed.panels[2].lines[0].y) == [12.5] * 5


@pytest.mark.slow
@pytest.mark.can
def test_every_moving_step_is_drawn_and_shows_its_progress(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a clock that goes with the axis, as before a real machine; the long turn and the chord test are left out."""
    clock, said = Clock(), []
    advance = Meter.advance

    def in_real_time(self: Meter, axis_s: float) -> None:
        clock.now_s += axis_s
        advance(self, axis_s)

    monkeypatch.setattr(Meter, "advance", in_real_time)
    with StateStore(MACHINE, tmp_path) as store:
        work = Commissioning(MACHINE, store, tmp_path, said.append, lambda step: True, now_s=clock)
        work.start(again=False)
        for step in work.steps:
            if step.key in ("turn", "bands", "accuracy") or step.by_hand:
                continue
            begun_s, first = clock.now_s, len(said)
            result = work.do(step)
            assert result is not None
            took_s = clock.now_s - begun_s
            told = [text for text in said[first:] if LEFT.fullmatch(text)]
            # A line after two seconds, and then at least every third.
            assert len(told) >= (took_s - FIRST_S) // 3.0, (step.key, took_s)
            # Brake and watchdog relay cannot be tested with this drive: nothing moves.
            moved = step.reach is not Reach.NOTHING and result.outcome is not Outcome.NOT_TESTABLE
            assert bool(result.pictures) is moved, step.key
            # What a step is expected to take is right to a factor of two, else its progress says nothing.
            if took_s > FIRST_S:
                assert 0.5 <= step.lasts_s(MACHINE) / took_s <= 2.0, (step.key, took_s)
        page = write_report(work.progress, work.ledger, tmp_path, HEAD).read_text(encoding="utf-8")
        store_progress(tmp_path / "again.json", work.progress)
        assert load_progress(tmp_path / "again.json") == work.progress
    assert page.count("<svg") == sum(len(result.pictures) for result in work.progress.results.values()) >= 9
    for text in (
        "Quick stop from +3°/s",
        "Process data silent",
        "Parameters of the drive",
        "6085:00",
        "Verdict.",
    ):
        assert text in page
    assert "The machine may not move. Not done: Slow turn, Bands." in page
    ids = re.findall(r'id="([^"]+)"', page)
    assert len(ids) == len(set(ids))
