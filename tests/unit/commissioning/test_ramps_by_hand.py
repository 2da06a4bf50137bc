"""The drive's own quick-stop ramp as a step measures it: which speeds, how far, what is believed, what it loads."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import steps_lacks
from gantryctl.commissioning.results import Context, Outcome
from gantryctl.commissioning.stopping.quick_stop import QuickStop
from gantryctl.engineering.stops.run import StopClass
from gantryctl.machine import Machine, with_values
from unit.commissioning.hand_drive import MACHINE, context

pytestmark = pytest.mark.can


class Ramps:
    """Stops of the drive: what was asked for, and what is seen."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *seen: tuple[float, float]) -> None:
        self.speeds: list[float] = []
        left = list(seen)

        def stop_from(c: Context, speed: float) -> QuickStop:
            self.speeds.append(speed)
            dec, uncertainty = left.pop(0) if left else (5.4, 0.0)
            return QuickStop(1.0, dec, uncertainty)

        def worst(machine: Machine, stop: StopClass, top: float, hardest: float) -> SimpleNamespace:
            self.computed.append((stop, top, hardest))
            return SimpleNamespace(torque_motor_nm=300.0, torque_reducer_nm=20e3 + len(self.computed))

        self.computed: list[tuple[StopClass, float, float]] = []
        monkeypatch.setattr(steps_lacks, "_stop_from", stop_from)
        monkeypatch.setattr(steps_lacks, "worst_stop", worst)
        monkeypatch.setattr(steps_lacks, "within_ratings", lambda *_: True)


@pytest.mark.parametrize(
    ("top_deg_s", "allowed_deg_s", "speeds"),
    [
        (6.0, math.inf, [0.3, -0.6, 1.0, -2.0, 3.0]),
        (2.0, math.inf, [0.3, -0.6, 1.0, -2.0]),
        (6.0, 0.9, [0.3, -0.6]),
    ],
)
def test_ramps_are_seen_forward_and_back_and_no_faster_than_the_axis_may_go(
    monkeypatch: pytest.MonkeyPatch, top_deg_s: float, allowed_deg_s: float, speeds: list[float]
) -> None:
    """So that the gantry ends near where it began."""
    ramps, machine = Ramps(monkeypatch), with_values(MACHINE, {"speed.setting_max_deg_s": top_deg_s})
    found = steps_lacks.ramp(replace(context(machine), speed_max_deg_s=allowed_deg_s))
    assert (found.outcome, ramps.speeds) == (Outcome.PASSED, speeds)


def test_a_ramp_that_is_not_known_within_5_percent_is_in_no_computed_stop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """5.15 deg/s2 to 6 % from the slowest speed, 5.2 to 5 % from the next one, and 5.4 beyond."""
    Ramps(monkeypatch, (5.15, 0.06 * 5.15), (5.2, 0.05 * 5.2))
    assert steps_lacks.ramp(context()).number(steps_lacks.RAMP_DEG_S2) == 5.2


def test_what_a_ramp_would_load_stands_beside_what_motor_and_reducer_bear(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Ramps(monkeypatch)
    figures = steps_lacks.ramp(context()).figures
    motor, reducer = figures["torque_at_top_nm"], figures["reducer_at_top_nm"]
    assert (motor.value, motor.high) == (300.0, MACHINE.motor.torque_max_nm)
    # Those of the last and fastest one.
    assert (reducer.value, reducer.high) == (20_005.0, MACHINE.reducer.torque_momentary_nm)


def test_the_loads_are_those_of_a_stop_from_the_highest_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ramp of 0.25 s: 1.2 deg/s2 from 0.3 deg/s may be a fixed one; with 2.4 from 0.6 deg/s it is 24 from 6 deg/s."""
    ramps = Ramps(monkeypatch, *((speed / 0.25, 0.0) for speed in (0.3, 0.6, 1.0, 2.0, 3.0)))
    found = steps_lacks.ramp(context(with_values(MACHINE, {"speed.setting_max_deg_s": 6.0})))
    # Each speed has the ramp that was seen from it.
    names = [f"ramp_{speed}_deg_s2" for speed in ("0p3", "0p6", "1", "2", "3")]
    assert [found.number(name) for name in names] == pytest.approx([1.2, 2.4, 4.0, 8.0, 12.0])
    assert ramps.computed == [
        (StopClass.QUICK, 6.0, pytest.approx(hardest)) for hardest in (1.2, 24.0, 24.0, 24.0, 24.0)
    ]


@pytest.mark.parametrize(
    ("second", "hardest"),
    # 1.2 deg/s2 from 0.3 deg/s. From twice the speed one of a fixed time shows 2.4, one of a fixed deceleration 1.2.
    [((1.8, 0.0), 18.0), ((1.79, 0.0), 1.79), ((2.3, 0.5), 18.0), ((2.3, 0.51), 1.79)],
)
def test_three_quarters_of_the_rise_of_a_fixed_time_are_taken_for_one(
    second: tuple[float, float], hardest: float
) -> None:
    """From 6 deg/s it is ten times as hard as from 0.6; of an uncertain ramp only what is sure counts."""
    seen = [steps_lacks._Ramp(0.3, QuickStop(0.0, 1.2, 0.0)), steps_lacks._Ramp(0.6, QuickStop(0.0, *second))]
    assert steps_lacks._at_top_deg_s2(seen, 6.0) == pytest.approx(hardest)


@pytest.mark.parametrize("speed", [3.0, -3.0])
def test_a_ramp_may_be_as_soft_as_that_of_a_jog_key(monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
    """1 deg/s2: 4.5 deg to 3 deg/s, 1.5 at it, 4.5 and 0.18 to rest, and 0.3 to spare."""
    asked: list[Any] = []

    @contextmanager
    def opened(c: Context, leash_deg: float, part: str, *, way: float) -> Iterator[SimpleNamespace]:
        assert way == speed
        asked.append(leash_deg)
        yield SimpleNamespace(
            enable=lambda: asked.append("enable"),
            ramp_to=lambda *to: asked.append(("ramp", *to)),
            run=lambda seconds, speed_deg_s: asked.append(("run", seconds, speed_deg_s)),
        )

    def measure(axis: object, speed_deg_s: float, softest: float) -> QuickStop:
        asked.append((speed_deg_s, softest))
        return QuickStop(1.0, 5.4, 0.0)

    monkeypatch.setattr(steps_lacks, "open_loop_axis", opened)
    monkeypatch.setattr(steps_lacks, "measure_quick_stop", measure)
    machine: Machine = with_values(MACHINE, {"virtual_axis.jog_release_dec_deg_s2": 1.0})
    steps_lacks._stop_from(context(machine), speed)
    assert asked == [pytest.approx(10.98), "enable", ("ramp", speed, 1.0), ("run", 0.5, speed), (speed, 1.0)]


def test_no_harder_ramp_is_proposed_than_was_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """4.98 deg/s2 are less than 0.95 of 5.4; the stops may be computed with 4.9."""
    Ramps(monkeypatch, *[(4.98, 0.0)] * 5)
    found = steps_lacks.ramp(context())
    assert found.outcome is Outcome.FAILED
    assert "quick_dec_deg_s2 = 4.9 at most" in found.to_do


def test_a_ramp_that_is_too_hard_from_a_higher_speed_ends_the_step_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ramps = Ramps(monkeypatch, (5.4, 0.0), (float("nan"), 0.0))
    found = steps_lacks.ramp(context())
    assert found.outcome is Outcome.FAILED
    assert found.proof == "the ramp from 0.6 deg/s ends within three scans: too hard to be measured"
    assert ramps.speeds == [0.3, -0.6]
